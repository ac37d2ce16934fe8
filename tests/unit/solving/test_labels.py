"""Markings under the wrong label, found by leaving markings out."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from app.soccer.annotation import make_lines
from app.soccer.pitch import MARKINGS
from app.soccer.policy import CalibrationPolicy
from app.solving.labels import (
    GAMMA_SHARE,
    MISFIT,
    RELABELLED,
    _find_markings_on_minority_half,
    _LabelSearch,
    _order_by_suspicion,
    _pitch_half,
    find_suspects,
)
from app.solving.observations import make_observations
from app.solving.resect import ResectionProblem
from tests.cameras import SIZE
from tests.unit.solving.conftest import MAIN, PITCH, click

PROBLEM = ResectionProblem.of(SIZE, CalibrationPolicy())
GAMMA = GAMMA_SHARE * SIZE.diagonal


def suspects(lines):
    observations = make_observations(make_lines(lines), PITCH, SIZE)
    fit = PROBLEM.search(observations)
    return observations, fit, find_suspects(PROBLEM, observations, fit)


class TestFindSuspects:
    @pytest.mark.parametrize("seed", range(3))
    def test_honest_noise_makes_no_suspect_and_changes_nothing(self, seed):
        observations, fit, (found, rest, named) = suspects(click(MAIN, 0.8, seed))
        assert named == ()
        assert found is fit
        assert rest is observations

    def test_another_class_that_fits_is_suggested(self):
        lines = dict(click(MAIN, 0.3, 1))
        lines["Circle left"] = lines.pop("Circle right")
        _, _, (found, rest, (suspect,)) = suspects(lines)
        assert (suspect.marking, suspect.suggested) == ("Circle left", "Circle right")
        assert suspect.error_px > MISFIT * GAMMA > suspect.suggested_error_px
        expected = 1 - suspect.suggested_error_px / suspect.error_px
        assert suspect.confidence == pytest.approx(expected)
        assert "Circle left" not in rest.markings
        camera = PROBLEM.parameters(MAIN)
        assert found.parameters == pytest.approx(camera, abs=0.5)

    def test_a_marking_that_no_class_fits_is_left_out_without_a_suggestion(self):
        lines = dict(click(MAIN, 0.3, 1))
        points = np.array(lines["Side line top"])
        lines["Side line top"] = points + np.linspace(60, 140, len(points))[:, None] * [0.2, 1.0]
        _, _, (_, rest, named) = suspects(lines)
        assert "Side line top" in [suspect.marking for suspect in named]
        assert "Side line top" not in rest.markings
        assert all(suspect.confidence == 0.5 for suspect in named if suspect.suggested is None)

    def test_where_too_little_would_be_left_nothing_is_left_out(self):
        kept = ("Side line top", "Big rect. right main", "Big rect. right top")
        lines = {name: at for name, at in click(MAIN).items() if name in kept}
        points = np.array(lines["Side line top"])
        lines["Side line top"] = (
            points + np.array([[0.0, 25.0]]) * (np.arange(len(points)) % 2)[:, None]
        )
        observations, fit, (found, rest, named) = suspects(lines)
        assert (found is fit, rest is observations, named) == (True, True, ())


class TestOtherLabels:
    @pytest.mark.parametrize(
        ("error", "nearest", "named"),
        [
            (5.0, 5.5, False),
            (5.0, 5.0, False),
            (5.0, 3.0, False),
            (5.0, 2.4, True),
            (2.0, RELABELLED, True),
            (RELABELLED, RELABELLED, False),
        ],
    )
    def test_a_class_is_proposed_only_where_it_fits_better_than_the_present_one(
        self, monkeypatch, error, nearest, named
    ):
        observations = make_observations(click(MAIN), PITCH, SIZE)
        distances = {"Side line top": error, "Side line bottom": nearest}
        monkeypatch.setattr(
            _LabelSearch,
            "measure_largest_distance",
            lambda _self, _parameters, of: distances.get(of.markings[0], 99.0),
        )
        search, fit = _LabelSearch(PROBLEM, GAMMA), PROBLEM.search(observations)
        rest = observations.without("Side line top", "Side line bottom")
        doubt = search.compare_with_other_labels(observations, rest, fit, "Side line top")
        assert doubt.suggested == ("Side line bottom" if named else None)


class TestOrder:
    @given(st.lists(st.sampled_from(MARKINGS), unique=True))
    def test_the_minority_lies_on_one_half_and_is_no_more_than_the_other(self, markings):
        few = _find_markings_on_minority_half(markings)
        halves = {_pitch_half(name) for name in few}
        assert len(halves) <= 1
        assert None not in halves
        rest = [name for name in markings if _pitch_half(name) not in (None, *halves)]
        assert len(few) <= len(rest) or not few

    @given(st.dictionaries(st.sampled_from(MARKINGS), st.floats(0, 100), min_size=1))
    def test_the_minority_is_tried_first_then_what_fits_worst(self, largest):
        order = _order_by_suspicion(largest)
        assert sorted(order) == sorted(largest)
        few = _find_markings_on_minority_half(tuple(largest))
        assert set(order[: len(few)]) == set(few)
        for part in (order[: len(few)], order[len(few) :]):
            errors = [largest[name] for name in part]
            assert errors == sorted(errors, reverse=True)

    @pytest.mark.parametrize(
        ("marking", "half"),
        [("Circle left", "left"), ("Big rect. right main", "right"), ("Middle line", None)],
    )
    def test_a_marking_belongs_to_the_half_that_its_name_says(self, marking, half):
        assert _pitch_half(marking) == half
