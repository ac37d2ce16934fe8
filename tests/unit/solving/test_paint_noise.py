"""What a pitch is other than the plan, and what a camera takes it for."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from app.geometry.resection import CurvePoints, X, Z
from app.soccer.pitch import CIRCLES, MARKINGS, Pitch
from app.soccer.policy import CalibrationPolicy
from app.solving.lone_frame import (
    CROWN_SIGMA_M,
    INWARD_SIGMA_M,
    LINE_SIGMA_M,
    PAINT_SIZE_SIGMA_M,
)
from app.solving.observations import make_observations
from app.solving.paint_camera import PaintProblem, measure_offsets
from app.solving.paint_noise import paint_derivatives_by_layout, paint_derivatives_by_size
from app.solving.resect import ResectionProblem
from tests.cameras import SIZE
from tests.unit.solving.conftest import MAIN, click

PITCH = Pitch()
PROBLEM = PaintProblem.of(ResectionProblem.of(SIZE, CalibrationPolicy()), np.zeros(8), None)
TRUE = PROBLEM.resection.parameters(MAIN)


def seen_by(camera, pitch=PITCH):
    """Places on the grass markings of a pitch, and how they lie beside those of the plan."""
    grass = {name: at for name, at in click(camera, pitch=pitch).items() if name[:4] != "Goal"}
    observed = make_observations(grass, pitch, SIZE)
    curve_points = CurvePoints(observed.pixels, observed.marking, np.ones(len(observed.pixels)))
    seen = measure_offsets(PROBLEM, TRUE, curve_points, np.full(len(observed.pixels), 0.1), PITCH)
    places = MAIN.project_to_ground(observed.pixels + np.array(MAIN.principal_point))
    return seen, places


def across_middles(moved):
    """Rows whose marking runs on beside the place: ends of a marking know nothing of its length."""
    names = np.array([name in CIRCLES for name in MARKINGS])
    return ~names[moved.marking]


class TestSizeTerms:
    @pytest.mark.parametrize(("number", "other"), [(0, Pitch(105.2, 68)), (1, Pitch(105, 68.2))])
    def test_they_are_how_the_paint_of_another_pitch_moves(self, number, other):
        seen, _ = seen_by(MAIN, other)
        told = paint_derivatives_by_size(seen.marking, seen.jacobian, PITCH)[:, number]
        told = told * 0.2 / PAINT_SIZE_SIGMA_M[number]
        assert np.abs(told).max() > 0.3
        rows = across_middles(seen)
        assert np.abs(seen.offsets - told)[rows] == pytest.approx(0, abs=0.05 * np.abs(told).max())

    def test_which_line_of_a_goal_is_meant_changes_nothing(self):
        seen, _ = seen_by(MAIN)
        one, other = (
            paint_derivatives_by_size(seen.marking, seen.jacobian, PITCH.with_goal_edge(goal))
            for goal in ("inner", "middle")
        )
        assert one.any() and (one == other).all()

    def test_a_pitch_that_was_measured_has_none(self):
        seen, _ = seen_by(MAIN)
        assert not paint_derivatives_by_size(seen.marking, seen.jacobian, Pitch(104, 68)).any()


class TestPaintedTerms:
    def terms(self):
        seen, places = seen_by(MAIN)
        terms = paint_derivatives_by_layout(places, seen.marking, seen.jacobian, PITCH)
        return seen, places, terms

    def test_the_grass_is_raised_between_the_touchlines(self):
        seen, places, terms = self.terms()
        lifted = -CROWN_SIGMA_M * (1 - (places[:, 1] / 34) ** 2)
        raised = MAIN.project(np.column_stack([places, lifted]))
        apart = np.hypot(*(raised - MAIN.project(np.column_stack([places, 0 * lifted]))).T)
        assert (np.abs(terms[:, 0]) <= apart + 0.05).all()
        bottom = seen.marking == MARKINGS.index("Big rect. right main")
        assert np.abs(terms[bottom, 0]).max() > 0.1

    def test_paint_lies_inside_what_it_bounds_by_half_its_width(self):
        seen, places, terms = self.terms()
        for name, way in (
            ("Big rect. right main", (1.0, 0.0)),
            ("Big rect. right top", (0.0, 1.0)),
            ("Side line right", (-1.0, 0.0)),
        ):
            rows = seen.marking == MARKINGS.index(name)
            assert rows.any()
            by_place = -seen.jacobian[rows, X : Z + 1]
            assert terms[rows, 1] == pytest.approx(INWARD_SIGMA_M * by_place[:, :2] @ way)
        circle = seen.marking == MARKINGS.index("Circle right")
        spokes = np.array([41.5, 0.0]) - places[circle]
        spokes /= np.hypot(*spokes.T)[:, None]
        by_place = -seen.jacobian[circle, X:Z]
        assert terms[circle, 1] == pytest.approx(INWARD_SIGMA_M * (by_place * spokes).sum(axis=1))

    def test_each_marking_may_lie_elsewhere_for_itself(self):
        seen, _, terms = self.terms()
        lines = terms[:, 2:]
        assert lines.shape[1] == len(np.unique(seen.marking))
        assert ((lines != 0).sum(axis=1) == 1).all()
        scale = LINE_SIGMA_M / INWARD_SIGMA_M
        bounded = seen.marking != MARKINGS.index("Middle line")
        assert lines.sum(axis=1)[bounded] == pytest.approx(scale * terms[bounded, 1])


class TestCovariance:
    def test_it_holds_what_a_longer_pitch_does_to_a_camera(self):
        """A camera sees one half and the middle of a pitch that is 1.5 m longer."""
        seen, places = seen_by(MAIN, Pitch(105 + PAINT_SIZE_SIGMA_M[0], 68))
        moved = PROBLEM.compute_step(TRUE, seen, strict=False)
        sized = PROBLEM.noise(
            TRUE, replace(seen, offsets=np.zeros(len(seen.offsets))), places, PITCH
        )
        place = slice(X, Z + 1)
        off, paint = moved[place], sized.parameters[place, place]
        assert np.linalg.norm(off) > 0.5
        assert off @ np.linalg.solve(paint, off) > 50
        assert off @ np.linalg.solve(paint + sized.pitch[place, place], off) < 7.8
