from __future__ import annotations

import zlib
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from app.errors import DamagedError
from app.geometry.resection import parameters_from_camera
from app.geometry.triangulation import triangulate_pairs
from app.soccer.annotation import BallAnnotation
from app.soccer.frames import ImagePoint
from app.soccer.solution import Calibration, MarkingFit, PaintFit
from app.solving.facts import (
    COLUMNS,
    LATER,
    NOTHING,
    STEP_PX,
    GroupFacts,
    collect_facts_of_views,
    facts_from_bytes,
    facts_to_bytes,
    join_facts,
)
from tests.cameras import SIZE
from tests.unit.solving.conftest import BEHIND_GOAL, MAIN, OPPOSITE, given_view
from tests.unit.solving.random_groups import random_views

BALL = (38.0, 2.0, -1.4)
SEEDS = st.lists(st.integers(0, 10_000), min_size=1, max_size=6)


def same(one: GroupFacts, other: GroupFacts) -> bool:
    return one.groups == other.groups and all(
        getattr(one, name).dtype == getattr(other, name).dtype == np.dtype(kind)
        and getattr(one, name).shape[1:] == shape
        and np.array_equal(getattr(one, name), getattr(other, name), equal_nan=True)
        for name, (kind, shape) in COLUMNS.items()
    )


def random_facts(seeds: list[int]) -> list[GroupFacts]:
    return [collect_facts_of_views(*random_views(seed)) for seed in seeds]


class TestGroupFacts:
    def facts(self) -> GroupFacts:
        fits = (MarkingFit("a", "tp", (1.0, 3.0, 2.0)), MarkingFit("b", "fp"))
        spread = tuple(np.diag(np.arange(1.0, 9.0)).ravel().tolist())
        views = [given_view(key, camera, BALL) for key, camera in zip("abc", CAMERAS, strict=True)]
        views[2] = replace(views[2], included=False)
        calibrations = [
            Calibration("lines", MAIN, jac=(0.5,) * 3, markings=fits, covariance=spread),
            Calibration("given", BEHIND_GOAL),
            Calibration("lines", None, markings=fits[:1]),
        ]
        return collect_facts_of_views(views, calibrations)

    def test_says_of_each_view_what_the_gates_read(self):
        facts = self.facts()
        assert facts.groups == 1
        assert facts.view_group.tolist() == [0, 0, 0]
        assert facts.view_included.tolist() == [True, True, False]
        assert facts.view_camera.tolist() == [True, True, False]
        assert facts.view_given.tolist() == [False, True, False]
        assert facts.view_measured.tolist() == [True, False, False]
        assert facts.view_ball.tolist() == [True, True, True]
        assert facts.view_diagonal.tolist() == [SIZE.diagonal] * 3
        assert np.array_equal(facts.view_position[:2], [MAIN.position, BEHIND_GOAL.position])
        assert np.isnan(facts.view_position[2]).all()
        parameters = parameters_from_camera(MAIN, SIZE.diagonal / 2)
        assert np.array_equal(facts.view_parameters, [parameters, np.zeros(8), np.zeros(8)])
        assert np.array_equal(facts.view_covariance[0], np.diag(np.arange(1.0, 9.0)))
        assert not facts.view_covariance[1:].any()
        assert (facts.view_ball_px > 0).all()

    def test_a_marking_has_its_largest_distance_and_none_is_infinite(self):
        facts = self.facts()
        assert facts.mark_view.tolist() == [0, 0, 2]
        assert facts.mark_px.tolist() == [3.0, np.inf, 3.0]

    def test_a_pair_has_the_numbers_of_its_meeting(self):
        facts = self.facts()
        assert facts.pair_view.tolist() == [[0, 1]]
        assert facts.pair_point == pytest.approx(np.array([BALL]), abs=1e-6)
        assert facts.pair_errors == pytest.approx(np.zeros((1, 2)), abs=1e-5)
        assert facts.pair_front.tolist() == [True]
        apart = np.linalg.norm(MAIN.position - BEHIND_GOAL.position)
        assert facts.pair_baseline == pytest.approx(apart)

    def test_a_pair_knows_where_its_point_moves_with_a_pixel(self):
        facts = self.facts()
        bare = [replace(camera, distortion=np.zeros(12)) for camera in (MAIN, BEHIND_GOAL)]
        pixels = [camera.project(np.array([BALL])) for camera in bare]
        pixels[1][0, 1] -= STEP_PX
        expected = triangulate_pairs(MAIN.P[None], BEHIND_GOAL.P[None], *pixels)
        assert facts.pair_moved[:, 1, 1, 1] == pytest.approx(expected, abs=1e-6)

    def test_an_inferred_ball_counts_as_no_ball(self):
        put = BallAnnotation(point=ImagePoint(9.0, 9.0), inferred=True)
        view = replace(given_view("a", MAIN, BALL), balls=(put,))
        facts = collect_facts_of_views([view], [Calibration("given", MAIN)])
        assert (facts.view_ball.tolist(), facts.view_ball_px.tolist()) == ([False], [0.0])

    def test_a_group_without_views_has_nothing(self):
        assert same(collect_facts_of_views([], []), replace(NOTHING, groups=1))


class TestJoin:
    @given(SEEDS)
    @settings(max_examples=25, deadline=None)
    def test_each_group_comes_back_alone(self, seeds):
        parts = random_facts(seeds)
        whole = join_facts(parts)
        assert whole.groups == len(parts)
        for place, part in enumerate(parts):
            assert same(whole.only(np.arange(len(parts)) == place), part)

    @given(SEEDS, st.integers(1, 5))
    @settings(max_examples=15, deadline=None)
    def test_the_order_of_joining_does_not_matter(self, seeds, first):
        parts = random_facts(seeds)
        assert same(
            join_facts([join_facts([NOTHING, *parts[:first]]), *parts[first:]]), join_facts(parts)
        )

    def test_selecting_every_group_gives_the_facts_unchanged(self):
        whole = join_facts(random_facts([1, 2, 3]))
        assert same(whole.only(np.ones(3, bool)), whole)
        assert same(whole.only(np.zeros(3, bool)), NOTHING)


class TestCodec:
    @given(st.integers(0, 10_000))
    @settings(max_examples=25, deadline=None)
    def test_facts_come_back_to_the_last_bit(self, seed):
        (facts,) = random_facts([seed])
        assert same(facts_from_bytes([facts_to_bytes(facts)]), facts)

    def test_a_group_without_anything_comes_back(self):
        empty = replace(NOTHING, groups=1)
        assert same(facts_from_bytes([facts_to_bytes(empty)]), empty)


CAMERAS = MAIN, BEHIND_GOAL, OPPOSITE


class TestPart:
    def test_rows_of_a_column_are_those_of_all_of_it_read_before_or_not(self) -> None:
        parts = [collect_facts_of_views(*random_views(seed)) for seed in range(12)]
        kept = np.arange(12) % 3 != 1
        part, whole = join_facts(parts).part(kept), join_facts(parts).only(kept)
        for name in ("view_covariance", "pair_moved", "pair_point", "view_known"):
            rows = np.arange(len(getattr(whole, name)))[::-2]
            told = [part.rows(name, rows), getattr(part, name)[rows], part.rows(name, rows)]
            for array in told:
                assert np.array_equal(array, whole.rows(name, rows), equal_nan=True), name


ONE = PaintFit(0.9, 0.8, 200)


class TestFactsFromBytes:
    @pytest.mark.parametrize(
        "content", [b"", b"no zlib", zlib.compress(b"seven"), zlib.compress(bytes(7 * 8))[:-5]]
    )
    def test_what_was_not_written_is_damage(self, content: bytes) -> None:
        with pytest.raises(DamagedError, match="stored numbers of a solution") as refused:
            facts_from_bytes([content])
        assert refused.value.hint


class TestAgreement:
    def test_without_any_the_bytes_are_those_of_before_it_came(self) -> None:
        """Facts that were kept before have no such column, and decode."""
        views, calibrations = random_views(3)
        bare = collect_facts_of_views(views, [replace(item, paint=None) for item in calibrations])
        assert np.isnan(bare.view_agreement).all() and len(bare.view_agreement)
        counts = [len(bare.view_group), len(bare.mark_view), len(bare.pair_group)]
        before = [getattr(bare, name).ravel() for name in COLUMNS if name not in LATER]
        written = np.concatenate([counts, *before]).astype("<f8").tobytes()
        assert zlib.decompress(facts_to_bytes(bare)) == written
        assert np.isnan(facts_from_bytes([zlib.compress(written)]).view_agreement).tolist() == [
            True
        ] * len(views)

    def test_comes_back_where_a_view_has_some(self) -> None:
        views, calibrations = random_views(3)
        painted = [replace(calibrations[0], paint=ONE), *calibrations[1:]]
        found = facts_from_bytes([facts_to_bytes(collect_facts_of_views(views, painted))])
        assert found.view_agreement[0] == 0.9 * 0.8
