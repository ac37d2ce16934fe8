from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from app.geometry.camera import Camera
from app.soccer.frames import ImagePoint
from app.soccer.policy import PAPER
from app.soccer.solution import Calibration
from app.solving.sides import SwappedView, find_swapped_views, turn_camera
from app.solving.triangulate import BallObservation
from tests.cameras import SIZE, looking
from tests.unit.solving.conftest import BEHIND_GOAL, MAIN, OPPOSITE, PITCH

BALL = (38.0, 2.0, -1.4)


def sight(
    view: str, camera: Camera, *, labelled: Camera | None = None, source="lines"
) -> BallObservation:
    """The ball as a camera sees it, calibrated as that camera or as another."""
    x, y = camera.project(np.array([BALL]))[0]
    calibration = Calibration(source, labelled or camera)
    return BallObservation(view, calibration, ImagePoint(float(x), float(y)), 9.0, SIZE)


A, B, C = sight("a", MAIN), sight("b", BEHIND_GOAL), sight("c", OPPOSITE)
TURNED = sight("b", BEHIND_GOAL, labelled=turn_camera(BEHIND_GOAL))
TURNED_C = sight("c", OPPOSITE, labelled=turn_camera(OPPOSITE))


def swaps(
    *sights: BallObservation, first: BallObservation | None = A, **changes: float
) -> tuple[SwappedView, ...]:
    return find_swapped_views(first, sights, PITCH, replace(PAPER, **changes))


class TestTurnedCamera:
    @given(st.floats(5, 50), st.floats(-30, 30), st.floats(-8, 0))
    def test_sees_the_turned_point_where_the_camera_sees_the_point(self, x, y, z):
        there = turn_camera(MAIN).project(np.array([[-x, -y, z]]))
        assert np.allclose(there, MAIN.project(np.array([[x, y, z]])), equal_nan=True)

    def test_turned_twice_is_the_camera(self):
        assert turn_camera(turn_camera(OPPOSITE)) == OPPOSITE


class TestFindSwaps:
    def test_views_that_agree_are_left_alone(self):
        assert swaps(A, B, C) == ()

    def test_a_replay_that_fits_once_turned_is_found(self):
        (found,) = swaps(A, TURNED, C)
        assert (found.view, found.turned_error_px) == ("b", pytest.approx(0.0, abs=1e-3))
        assert 0.5 < found.confidence <= 1.0

    def test_a_meeting_far_from_any_pitch_counts_only_where_the_policy_allows_it(self):
        assert swaps(A, TURNED)[0].error_px is None
        (found,) = swaps(A, TURNED, max_height_m=1e6, outside_pitch_m=1e6, below_grass_m=1e6)
        assert found.error_px > 50.0
        assert found.confidence == 0.99

    def test_a_given_camera_rests_on_no_labels(self):
        given_ = replace(TURNED, calibration=replace(TURNED.calibration, source="given"))
        assert swaps(A, given_, C) == ()

    def test_without_a_main_camera_every_replay_may_be_turned(self):
        assert "b" in [swap.view for swap in swaps(TURNED, C, first=None)]

    def test_one_view_alone_tells_nothing(self):
        assert swaps(TURNED, first=None) == ()
        assert swaps(A) == ()

    def test_views_too_close_tell_nothing(self):
        assert swaps(A, TURNED, C, min_baseline_m=1000.0) == ()

    def test_a_view_whose_lines_fit_badly_is_still_told_that_it_is_turned(self):
        (found,) = find_swapped_views(A, (A, C), PITCH, PAPER, doubtful=(TURNED,))
        assert (found.view, found.turned_error_px) == ("b", pytest.approx(0.0, abs=1e-3))
        (alone,) = find_swapped_views(A, (A,), PITCH, PAPER, doubtful=(TURNED,))
        assert alone.view == "b"

    def test_a_view_whose_lines_fit_badly_says_nothing_of_others(self):
        assert find_swapped_views(A, (A,), PITCH, PAPER, doubtful=(B, C)) == ()
        assert find_swapped_views(None, (TURNED,), PITCH, PAPER, doubtful=()) == ()
        wrong = sight("c", OPPOSITE, labelled=turn_camera(OPPOSITE))
        named = find_swapped_views(A, (A, B), PITCH, PAPER, doubtful=(wrong,))
        assert [swap.view for swap in named] == ["c"]

    def test_a_main_camera_on_the_far_side_is_the_one_to_turn(self):
        wrong = sight("a", MAIN, labelled=turn_camera(MAIN))
        (found,) = swaps(wrong, B, C, first=wrong)
        assert (found.view, found.turned_error_px) == ("a", pytest.approx(0.0, abs=1e-3))

    @pytest.mark.parametrize("usable", [(), (0,), (0, 1)])
    def test_a_main_camera_on_the_far_side_is_named_though_all_agree_or_nobody_can_tell(
        self, usable
    ):
        wrong = sight("a", MAIN, labelled=turn_camera(MAIN))
        others = (wrong, TURNED)
        found = swaps(*(others[place] for place in usable), first=wrong)
        assert found == (SwappedView("a", None, None, 0.9),)

    def test_a_first_view_that_no_main_camera_stands_opposite_is_left_alone(self):
        goal = sight("a", looking((-75.0, -3.0, -8.0), (38.0, 2.0, 0.0), 1300.0))
        assert swaps(goal, B, C, first=goal) == ()
        # What is turned besides is found all the same.
        assert [swap.view for swap in swaps(goal, B, TURNED_C, first=goal)] == ["c"]

    def test_the_first_of_static_cameras_may_stand_on_the_far_side(self):
        far = sight("a", looking((10.0, -60.0, -12.0), (38.0, 2.0, 0.0), 2000.0))
        assert [swap.view for swap in swaps(far, B, first=far)] == ["a"]
        assert find_swapped_views(far, (far, B), PITCH, PAPER, is_static=True) == ()
        named = find_swapped_views(far, (far, TURNED), PITCH, PAPER, is_static=True)
        assert [swap.view for swap in named] == ["b"]

    def test_a_given_main_camera_may_stand_where_it_likes(self):
        far = sight("a", turn_camera(MAIN), source="given")
        far = replace(far, center=ImagePoint(9.0, 9.0))
        assert [swap.view for swap in swaps(far, B, first=far)] != ["a"]


ANYWHERE = {"max_height_m": 1e6, "outside_pitch_m": 1e6, "below_grass_m": 1e6}


class TestAnAccident:
    """Rays of a swapped replay that meet the main camera's by accident."""

    def test_a_meeting_within_tau_and_far_beyond_sigma_does_not_clear_a_view(self):
        (found,) = swaps(A, TURNED, tau_percent=10.0, **ANYWHERE)
        assert found.error_px < 0.10 * SIZE.diagonal

    def test_a_ball_that_is_as_large_as_it_should_be_speaks_for_a_view(self):
        """The same rays, within one sigma of each other: only the sizes of the boxes tell."""
        vague = {"click_sigma_px": 150.0, "tau_percent": 10.0, **ANYWHERE}
        a, b = replace(A, diameter_px=0.0), replace(TURNED, diameter_px=0.0)
        assert swaps(a, b, first=a, **vague) == ()
        depth = BEHIND_GOAL.pitch_to_camera(np.array([BALL]))[0, 2]
        right = 1.15 * PAPER.ball_diameter_m * BEHIND_GOAL.focal_length[1] / depth
        (found,) = swaps(a, replace(b, diameter_px=right), first=a, **vague)
        assert found.view == "b"

    def test_two_replays_that_are_both_swapped_do_not_clear_each_other(self):
        other = sight("c", OPPOSITE, labelled=turn_camera(OPPOSITE))
        assert [swap.view for swap in swaps(A, TURNED, other)] == ["b", "c"]
