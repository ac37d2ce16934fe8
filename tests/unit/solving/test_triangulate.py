"""Sights and where their rays meet; laws on random scenes, numbers by hand."""

from __future__ import annotations

from dataclasses import replace
from itertools import combinations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from app.geometry.camera import Camera
from app.geometry.resection import parameters_from_camera
from app.soccer.annotation import BallAnnotation
from app.soccer.frames import Box, ImagePoint, ImageSize
from app.soccer.group import Station, View
from app.soccer.picture import PictureGeometry
from app.soccer.policy import PAPER
from app.soccer.solution import Calibration
from app.solving.triangulate import (
    BallObservation,
    UncertainCameraParameters,
    collect_ball_observations,
    stack_pair_arrays,
    triangulate_observation_pairs,
)
from tests.cameras import SIZE
from tests.unit.solving.conftest import BEHIND_GOAL, MAIN, OPPOSITE, given_view

KNOWN = tuple(np.arange(64.0))


class TestOf:
    def test_without_a_camera_and_of_unknown_exactness_there_are_none(self):
        assert UncertainCameraParameters.of(Calibration("none", None), SIZE.diagonal) is None
        assert UncertainCameraParameters.of(Calibration("given", MAIN), SIZE.diagonal) is None

    def test_a_picture_as_it_was_taken_says_nothing_of_its_own(self):
        calibration = Calibration("lines", MAIN, covariance=KNOWN)
        found = UncertainCameraParameters.of(calibration, SIZE.diagonal)
        assert np.array_equal(found.parameters, parameters_from_camera(MAIN, SIZE.diagonal / 2))
        assert np.array_equal(found.covariance, np.reshape(KNOWN, (8, 8)))
        assert found.picture is None

    def test_a_changed_picture_has_the_camera_that_took_it(self):
        changed = PictureGeometry(1.2).camera_of_annotated_picture(BEHIND_GOAL, SIZE)
        whole = np.arange(121.0).reshape(11, 11)
        calibration = Calibration(
            "lines", changed, covariance=KNOWN, picture_covariance=tuple(whole.ravel())
        )
        found = UncertainCameraParameters.of(calibration, SIZE.diagonal)
        taken = parameters_from_camera(BEHIND_GOAL, SIZE.diagonal / 2)
        assert np.allclose(found.parameters, taken, atol=1e-12)
        assert np.array_equal(found.covariance, whole[:8, :8])
        assert np.array_equal(found.picture, whole[8:])


BALL = (38.0, 2.0, -1.4)
# 1000 px a radian, looking along +y from 20 m before and along -x from 10 m beside the origin.
ALONG_Y = Camera(
    np.array([[1.0, 0.0, 0.0], [0.0, 0.0, 1.0], [0.0, 1.0, 0.0]]),
    np.array([0.0, -20.0, 0.0]),
    (1000.0, 1000.0),
    (500.0, 500.0),
)
ALONG_X = Camera(
    np.array([[0.0, 1.0, 0.0], [0.0, 0.0, 1.0], [-1.0, 0.0, 0.0]]),
    np.array([10.0, 0.0, 0.0]),
    (1000.0, 1000.0),
    (500.0, 500.0),
)


def sight(key: str, camera: Camera, center: tuple[float, float]) -> BallObservation:
    return BallObservation(
        key, Calibration("given", camera), ImagePoint(*center), 8.0, ImageSize(1001, 1001)
    )


def looks_at(key: str, camera: Camera, point: tuple[float, float, float]) -> BallObservation:
    return sight(key, camera, tuple(camera.project(np.array([point]))[0]))


def sights(*views: View, cameras=(MAIN, BEHIND_GOAL)) -> list[BallObservation]:
    return collect_ball_observations(views, [Calibration("given", camera) for camera in cameras])


class TestSight:
    def test_knows_its_camera_and_its_matrix(self):
        one = sight("a", ALONG_Y, (500.0, 500.0))
        assert one.camera is ALONG_Y
        assert np.array_equal(one.P, ALONG_Y.P)

    def test_the_ideal_centre_is_what_a_pinhole_shows(self):
        bare = replace(MAIN, distortion=np.zeros(12))
        found = looks_at("a", MAIN, BALL).ideal_center
        assert np.allclose(found, bare.project(np.array([BALL]))[0], atol=1e-6)
        assert not np.allclose(found, looks_at("a", MAIN, BALL).center, atol=1e-3)

    def test_tau_is_a_share_of_the_diagonal(self):
        one = replace(sight("a", ALONG_Y, (0.0, 0.0)), size=ImageSize(300, 400))
        assert one.tau_px(replace(PAPER, tau_percent=2.0)) == pytest.approx(10.0)


class TestSightsOf:
    def test_views_with_camera_and_ball_give_a_line_of_sight(self):
        a, b = given_view("a", MAIN, BALL), given_view("b", BEHIND_GOAL, BALL)
        first, second = sights(a, b)
        assert (first.view, second.view) == ("a", "b")
        assert first.center == a.ball.center
        assert first.diameter_px == a.ball.box.diameter
        assert first.size == SIZE
        assert (first.camera, second.camera) == (MAIN, BEHIND_GOAL)

    def test_a_view_that_is_left_out_gives_none_and_stops_no_other(self):
        a, b = given_view("a", MAIN, BALL), given_view("b", BEHIND_GOAL, BALL)
        assert [one.view for one in sights(replace(a, included=False), b)] == ["b"]

    def test_a_view_without_a_camera_gives_none(self):
        a, b = given_view("a", MAIN, BALL), given_view("b", BEHIND_GOAL, BALL)
        assert [one.view for one in sights(a, b, cameras=(None, BEHIND_GOAL))] == ["b"]

    @pytest.mark.parametrize(
        "balls",
        [
            (),
            (BallAnnotation(out_of_view=True),),
            (BallAnnotation(point=ImagePoint(9.0, 9.0)),) * 2,
            (BallAnnotation(point=ImagePoint(9.0, 9.0), inferred=True),),
            (BallAnnotation(),),
        ],
    )
    def test_a_view_without_exactly_one_visible_ball_gives_none(self, balls):
        a, b = given_view("a", MAIN, BALL), given_view("b", BEHIND_GOAL, BALL)
        assert [one.view for one in sights(replace(a, balls=balls), b)] == ["b"]

    def test_a_point_has_no_diameter(self):
        a = replace(given_view("a", MAIN, BALL), balls=(BallAnnotation(point=ImagePoint(9, 8)),))
        (found,) = collect_ball_observations([a], [Calibration("given", MAIN)])
        assert (found.diameter_px, found.center) == (0.0, (9, 8))

    def test_a_ball_where_the_lens_shows_nothing_is_none(self):
        barrel = replace(MAIN, distortion=np.array([-5.0, *np.zeros(11)]))
        a = View("a", Station("a", SIZE, given=barrel), (BallAnnotation(box=Box(0, 0, 9, 9)),))
        assert collect_ball_observations([a], [Calibration("given", barrel)]) == []

    def test_every_view_needs_its_calibration(self):
        with pytest.raises(ValueError, match="longer"):
            sights(given_view("a", MAIN, BALL))


class TestMeet:
    def test_the_baseline_lies_between_the_cameras_wherever_they_stand(self):
        (found,) = triangulate_observation_pairs(
            [(looks_at("a", MAIN, BALL), looks_at("b", BEHIND_GOAL, BALL))]
        )
        apart = np.linalg.norm(MAIN.position - BEHIND_GOAL.position)
        assert found.baseline_m == pytest.approx(float(apart))

    def test_a_meeting_by_hand(self):
        # Both look at the origin: 2 px across are 4 cm at 20 m, and 2 cm at 10 m.
        (found,) = triangulate_observation_pairs(
            [(sight("a", ALONG_Y, (500.0, 500.0)), sight("b", ALONG_X, (500.0, 502.0)))]
        )
        assert (found.a.view, found.b.view) == ("a", "b")
        assert found.baseline_m == pytest.approx(np.hypot(10, 20))
        assert found.parallax_degrees == pytest.approx(90.0, abs=0.1)
        assert found.in_front
        assert found.point_as_tuple == tuple(found.point)
        assert found.point[:2] == pytest.approx([0.0, 0.0], abs=1e-3)
        assert 0.0 < found.point[2] < 0.02
        depth = 0.001 * np.array([20.0, 10.0])
        assert found.errors_px == pytest.approx(
            (found.point[2] / depth[0], 2 - found.point[2] / depth[1]), abs=1e-3
        )

    def test_the_parallax_is_at_the_point(self):
        couple = (
            looks_at("a", ALONG_Y, (0.0, -10.0, 0.0)),
            looks_at("b", ALONG_X, (0.0, -10.0, 0.0)),
        )
        assert triangulate_observation_pairs([couple])[0].parallax_degrees == pytest.approx(135.0)

    @given(
        st.floats(5, 50),
        st.floats(-30, 30),
        st.floats(-8, 0),
        st.permutations(range(3)),
    )
    @settings(max_examples=40, deadline=None)
    def test_exact_sights_meet_at_the_truth_in_any_order(self, x, y, z, order):
        seen = [
            looks_at(key, camera, (x, y, z))
            for key, camera in (("a", MAIN), ("b", BEHIND_GOAL), ("c", OPPOSITE))
        ]
        couples = [
            (a, b)
            for a, b in combinations([seen[place] for place in order], 2)
            if np.isfinite([*a.center, *b.center]).all()
        ]
        found = triangulate_observation_pairs(couples)
        assert [(item.a, item.b) for item in found] == couples
        for item in found:
            assert item.point == pytest.approx([x, y, z], abs=1e-3)
            assert max(item.errors_px) < 0.01
            assert item.in_front

    def test_a_couple_gives_the_same_bits_alone_and_among_others(self):
        seen = [looks_at(key, camera, BALL) for key, camera in (("a", MAIN), ("b", OPPOSITE))]
        seen.append(sight("c", BEHIND_GOAL, (700.0, 300.0)))
        together = triangulate_observation_pairs(combinations(seen, 2))
        alone = [
            found
            for couple in combinations(seen, 2)
            for found in triangulate_observation_pairs([couple])
        ]
        assert [item.point_as_tuple for item in together] == [item.point_as_tuple for item in alone]
        assert [item.errors_px for item in together] == [item.errors_px for item in alone]

    def test_one_camera_twice_meets_nowhere(self):
        a, b = looks_at("a", MAIN, BALL), looks_at("b", MAIN, BALL)
        assert triangulate_observation_pairs([(a, b)]) == []
        other = looks_at("c", OPPOSITE, BALL)
        assert [item.b.view for item in triangulate_observation_pairs([(a, b), (a, other)])] == [
            "c"
        ]

    def test_parallel_rays_meet_nowhere_and_others_do(self):
        square = Camera(ALONG_Y.rotation, ALONG_Y.position, (1.0, 1.0), (0.0, 0.0))
        aside = replace(square, position=ALONG_Y.position + np.array([1.0, 0.0, 0.0]))
        parallel = sight("a", square, (0.0, 0.0)), sight("b", aside, (0.0, 0.0))
        crossing = looks_at("c", ALONG_Y, (0.0, 0.0, 0.0)), looks_at("d", ALONG_X, (0.0, 0.0, 0.0))
        assert [item.a.view for item in triangulate_observation_pairs([parallel, crossing])] == [
            "c"
        ]

    def test_without_couples_there_are_no_meetings(self):
        assert triangulate_observation_pairs([]) == []

    def test_a_point_behind_a_camera_is_measured_and_not_in_front(self):
        # The rays part before the cameras; their lines cross 20 m behind both.
        aside = replace(ALONG_Y, position=np.array([4.0, -20.0, 0.0]))
        (found,) = triangulate_observation_pairs(
            [(sight("a", ALONG_Y, (400.0, 500.0)), sight("b", aside, (600.0, 500.0)))]
        )
        assert found.point == pytest.approx([2.0, -40.0, 0.0], abs=1e-6)
        assert not found.in_front
        assert found.errors_px == pytest.approx((0.0, 0.0), abs=1e-6)

    def test_behind_one_camera_alone_is_not_in_front(self):
        behind = (0.0, -25.0, 0.0)
        pixel = ALONG_Y.P @ np.array([*behind, 1.0])
        a = sight("a", ALONG_Y, tuple(pixel[:2] / pixel[2]))
        b = looks_at("b", ALONG_X, behind)
        for couple in ((a, b), (b, a)):
            (found,) = triangulate_observation_pairs([couple])
            assert found.point == pytest.approx(behind, abs=1e-6)
            assert not found.in_front

    @pytest.mark.parametrize(("depth", "in_front"), [(2e-3, True), (5e-4, False)])
    def test_a_millimetre_is_the_least_depth(self, depth: float, in_front: bool):
        place = (0.0, -20.0 + depth, 0.0)
        (found,) = triangulate_observation_pairs(
            [(sight("a", ALONG_Y, (500.0, 500.0)), looks_at("b", ALONG_X, place))]
        )
        assert found.point == pytest.approx(place, abs=1e-6)
        assert found.in_front is in_front


class TestLinesOfSight:
    def test_come_in_the_order_that_triangulation_takes(self):
        a, b = looks_at("a", MAIN, BALL), looks_at("b", OPPOSITE, BALL)
        P_a, P_b, pixels_a, pixels_b = stack_pair_arrays([a, b], [b, a])
        assert np.array_equal(P_a, [MAIN.P, OPPOSITE.P])
        assert np.array_equal(P_b, [OPPOSITE.P, MAIN.P])
        assert np.array_equal(pixels_a, [a.ideal_center, b.ideal_center])
        assert np.array_equal(pixels_b, [b.ideal_center, a.ideal_center])
