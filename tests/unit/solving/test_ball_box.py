"""The 3D ball seen again in a view; numbers by hand for a camera along the y axis."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from app.geometry.camera import Camera
from app.geometry.resection import camera_from_parameters
from app.geometry.sphere import tight_box
from app.soccer.annotation import BallAnnotation
from app.soccer.frames import Box, ImagePoint, ImageSize
from app.soccer.policy import PAPER
from app.soccer.solution import Ball3D, Calibration
from app.solving.ball_box import measure_ball_fit, predict_ball_in_view
from app.solving.solve import solve_group
from tests.cameras import SIZE as STADIUM
from tests.unit.solving.conftest import BEHIND_GOAL, MAIN, OPPOSITE, given_view, group

SIZE = ImageSize(600, 800)  # a diagonal of 1000 px
BALL_M = 0.2
POLICY = replace(PAPER, ball_diameter_m=BALL_M)
BALL = (38.0, 2.0, -1.4)
# 1000 px a radian, level, from 20 m before the origin: a pixel is 2 cm there, a ball 10 px.
CAMERA = Camera(
    np.array([[1.0, 0.0, 0.0], [0.0, 0.0, 1.0], [0.0, 1.0, 0.0]]),
    np.array([0.0, -20.0, 0.0]),
    (1000.0, 1000.0),
    (300.0, 400.0),
)
ORIGIN = np.zeros(3)


def boxed(x: float, y: float, width: float, height: float) -> BallAnnotation:
    """A ball with that centre."""
    return BallAnnotation(box=Box(x - width / 2, y - height / 2, width, height))


def fit(ball: BallAnnotation, point=ORIGIN, camera: Camera = CAMERA):
    return measure_ball_fit(camera, SIZE, ball, np.array(point), BALL_M)


def ball3d(*point: float, variance: float = 0.0) -> Ball3D:
    return Ball3D(point, tuple((variance * np.eye(3)).ravel()), 0.0, 90.0, ("a", "b"))


class TestFitBall:
    def test_numbers_by_hand(self):
        found = fit(boxed(303.0, 404.0, 14.0, 26.0))
        assert found.reprojected == (300.0, 400.0)
        assert isinstance(found.reprojected, ImagePoint)
        assert found.error_px == pytest.approx(5.0)
        assert found.error_percent == pytest.approx(0.5)
        assert found.depth_m == pytest.approx(20.0)
        assert found.optimized_diameter_px == pytest.approx(10.0, rel=1e-4)
        assert found.optimized_box.center == pytest.approx((303.0, 404.0))
        assert found.optimized_box.width == found.optimized_diameter_px
        assert found.optimized_error_m == pytest.approx(0.1, rel=1e-3)
        assert found.size_ratio == pytest.approx(2.0, rel=1e-4)
        assert found.depth_per_px_m == pytest.approx(2.0, rel=1e-4)

    def test_one_view_alone_takes_the_depth_from_the_size(self):
        found = fit(boxed(300.0, 400.0, 5.0, 5.0))
        assert found.monocular == pytest.approx((0.0, 20.0, 0.0), abs=1e-9)
        assert found.monocular_error_m == pytest.approx(20.0)
        aside = fit(boxed(400.0, 350.0, 10.0, 10.0))
        assert aside.monocular == pytest.approx((2.0, 0.0, -1.0), abs=1e-9)
        assert aside.monocular_error_m == pytest.approx(np.hypot(2.0, 1.0))
        flying = fit(boxed(400.0, 350.0, 10.0, 10.0), (0.0, 0.0, -1.0))
        assert flying.monocular_error_m == pytest.approx(2.0)

    def test_the_exact_box_is_that_of_the_outline(self):
        box = fit(boxed(300.0, 400.0, 10.0, 10.0), (0.0, 0.0, -1.0)).exact_box
        left, top, right, bottom = tight_box(CAMERA, np.array([0.0, 0.0, -1.0]), BALL_M / 2)
        assert (box.x, box.y) == (left, top)
        assert (box.x + box.width, box.y + box.height) == pytest.approx((right, bottom))
        assert box.center == pytest.approx((300.0, 350.0), abs=0.01)

    def test_a_point_has_no_size_to_compare(self):
        found = fit(BallAnnotation(point=ImagePoint(303.0, 404.0)))
        assert (found.size_ratio, found.monocular, found.monocular_error_m) == (None, None, None)
        assert found.error_px == pytest.approx(5.0)
        assert found.optimized_diameter_px == pytest.approx(10.0, rel=1e-4)

    def test_a_box_without_area_has_no_size_to_compare(self):
        found = fit(boxed(300.0, 400.0, 0.0, 0.0))
        assert (found.size_ratio, found.monocular, found.monocular_error_m) == (None, None, None)

    def test_a_box_below_a_pixel_still_has_a_size(self):
        found = fit(boxed(300.0, 400.0, 0.5, 0.5))
        assert found.size_ratio == pytest.approx(0.05)
        assert found.monocular == pytest.approx((0.0, 380.0, 0.0), abs=1e-6)

    def test_a_point_behind_the_camera_has_neither_image_nor_boxes(self):
        found = fit(boxed(300.0, 400.0, 10.0, 10.0), (0.0, -25.0, 0.0))
        assert (found.reprojected, found.error_px, found.error_percent) == (None, None, None)
        assert (found.optimized_diameter_px, found.optimized_box) == (None, None)
        assert (found.optimized_error_m, found.exact_box) == (None, None)
        assert (found.size_ratio, found.depth_per_px_m) == (None, None)
        assert found.depth_m == pytest.approx(-5.0)
        assert found.monocular_error_m == pytest.approx(25.0)

    def test_a_ball_that_reaches_the_camera_has_an_image_and_no_outline(self):
        found = fit(boxed(300.0, 400.0, 10.0, 10.0), (0.0, -19.95, 0.0))
        assert found.reprojected == pytest.approx((300.0, 400.0))
        assert found.exact_box is None

    def test_a_monocular_place_beyond_the_lens_is_none(self):
        barrel = replace(CAMERA, distortion=np.array([-5.0, *np.zeros(11)]))
        found = fit(boxed(30.0, 30.0, 10.0, 10.0), camera=barrel)
        assert (found.monocular, found.monocular_error_m) == (None, None)
        assert found.reprojected == pytest.approx((300.0, 400.0))

    @given(
        st.floats(-3, 3), st.floats(-10, 60), st.floats(-3, 0), st.floats(2, 40), st.floats(2, 40)
    )
    @settings(max_examples=40, deadline=None)
    def test_the_optimised_size_does_not_depend_on_the_annotated_one(self, x, y, z, width, height):
        u, v = CAMERA.project(np.array([[x, y, z]]))[0]
        found = fit(boxed(u, v, width, height), (x, y, z))
        assert found.optimized_diameter_px == pytest.approx(1000 * BALL_M / (20 + y), rel=0.02)
        assert found.size_ratio * found.optimized_diameter_px == pytest.approx((width + height) / 2)
        assert found.depth_per_px_m * found.optimized_diameter_px == pytest.approx(found.depth_m)
        assert found.error_px == pytest.approx(0.0, abs=1e-6)


class TestExpectBall:
    GIVEN = Calibration("given", CAMERA)

    def test_a_place_by_hand_with_the_uncertainty_of_the_ball(self):
        found = predict_ball_in_view(
            self.GIVEN, SIZE, ball3d(2.0, 0.0, -1.0, variance=0.04), POLICY
        )
        assert found.place == pytest.approx((400.0, 350.0))
        assert isinstance(found.place, ImagePoint)
        # 20 cm are 10 px; the depth of a ball aside of the axis moves it a little, too.
        expected = 100.0 * np.array([[1.01, -0.005], [-0.005, 1.0025]])
        assert np.allclose(np.reshape(found.covariance, (2, 2)), expected)
        left, top, right, bottom = tight_box(CAMERA, np.array([2.0, 0.0, -1.0]), BALL_M / 2)
        assert (found.box.x, found.box.y) == (left, top)
        assert (found.box.width, found.box.height) == pytest.approx((right - left, bottom - top))

    def test_the_uncertainty_of_a_calibration_adds_to_it(self):
        half = SIZE.diagonal / 2
        parameters = np.array([0.0, np.pi / 2, 0.0, 0.0, 20.0, 0.0, np.log(1000.0), 0.0])
        camera = camera_from_parameters(parameters, (300.0, 400.0), half)
        moved = np.zeros((8, 8))
        moved[3, 3] = 0.01  # a camera that stands 10 cm to either side: 5 px
        point = np.array([[0.0, 0.0, 0.0]])
        assert np.allclose(camera.project(point), [[300.0, 400.0]])
        lines = Calibration("lines", camera, covariance=tuple(moved.ravel()))
        found = predict_ball_in_view(lines, SIZE, ball3d(0.0, 0.0, 0.0), POLICY)
        assert np.allclose(np.reshape(found.covariance, (2, 2)), [[25.0, 0.0], [0.0, 0.0]])

    def test_without_a_camera_nothing_is_expected(self):
        assert (
            predict_ball_in_view(Calibration("lines", None), SIZE, ball3d(0, 0, 0), POLICY) is None
        )

    def test_behind_the_camera_nothing_is_expected(self):
        assert predict_ball_in_view(self.GIVEN, SIZE, ball3d(0.0, -21.0, 0.0), POLICY) is None

    def test_a_ball_that_reaches_the_camera_is_expected_without_a_box(self):
        found = predict_ball_in_view(self.GIVEN, SIZE, ball3d(0.0, -19.95, 0.0), POLICY)
        assert found.place == pytest.approx((300.0, 400.0))
        assert found.box is None

    def test_the_truth_lies_in_the_ellipse_of_a_given_camera_as_often_as_it_says(self):
        """Nothing is known of the given cameras but how far off they are."""
        policy = replace(PAPER, given_sigma_px=6.0, click_sigma_px=1.0)
        scale = STADIUM.diagonal / np.hypot(1920, 1080)
        generator = np.random.default_rng(7)
        cameras = (MAIN, BEHIND_GOAL, OPPOSITE)
        views = [given_view(key, camera, BALL) for key, camera in zip("abc", cameras, strict=True)]
        inside = 0
        for _ in range(400):
            seen = [replace(views[2], balls=())]
            for view in views[:2]:
                off = generator.normal(0, scale * np.hypot(6.0, 1.0), 2)
                center = view.ball.center
                point = ImagePoint(center.x + off[0], center.y + off[1])
                seen.append(replace(view, balls=(BallAnnotation(point=point),)))
            expected = solve_group(group(*seen), policy).view("c").expected
            # The picture is that of a camera which is off as far as the policy says.
            shown = views[2].ball.center + generator.normal(0, scale * 6.0, 2)
            apart = shown - np.array(expected.place)
            covariance = np.reshape(expected.covariance, (2, 2))
            inside += apart @ np.linalg.solve(covariance, apart) < 5.991
        assert 0.92 <= inside / 400 <= 0.98
