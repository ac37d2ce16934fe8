from dataclasses import replace

import cv2
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from app.errors import DegenerateGeometryError, ShapeError
from app.geometry.camera import (
    Camera,
    pan_tilt_roll_from_rotation,
    rotation_from_pan_tilt_roll,
    rotation_from_vector,
)
from app.soccer.frames import ImageSize
from tests.cameras import EVERY_COEFFICIENT, WIDE_LENSES, looking, wide

SMALL = ImageSize(960, 540)


def main_camera(**changes) -> Camera:
    return replace(looking((2.0, 62.0, -14.0), (10.0, 0.0, 0.0), 2000.0, size=SMALL), **changes)


class TestConventions:
    def test_a_camera_above_the_grass_has_negative_z(self):
        pixel = main_camera(rotation=rotation_from_pan_tilt_roll(0.0, np.radians(77), 0.0))
        # The nearer touchline lies lower in the image than the far one.
        near, far = pixel.project(np.array([[2.0, 30.0, 0.0], [2.0, -30.0, 0.0]]))
        assert near[1] > far[1]

    def test_what_stands_higher_above_the_grass_is_higher_in_the_image(self):
        crossbar, foot = main_camera().project(np.array([[10.0, 0.0, -2.44], [10.0, 0.0, 0.0]]))
        assert crossbar[1] < foot[1]

    def test_the_right_goal_is_on_the_right_for_a_main_camera(self):
        left, right = main_camera().project(np.array([[0.0, 0.0, 0.0], [20.0, 0.0, 0.0]]))
        assert left[0] < right[0]


class TestProject:
    def test_equals_opencv_with_distortion(self):
        distortion = np.array([0.2, -0.1, 1e-3, 2e-3, 0.05, 0, 0, 0, 1e-4, 0, 0, 2e-4])
        camera = main_camera(distortion=distortion)
        points = np.array([[5.0, 3.0, 0.0], [15.0, -20.0, -2.0]])
        vector, _ = cv2.Rodrigues(camera.rotation)
        shift = -camera.rotation @ camera.position
        expected, _ = cv2.projectPoints(points, vector, shift, camera.K, distortion)
        assert np.allclose(camera.project(points), expected[:, 0], atol=1e-8)

    def test_equals_the_projection_matrix_without_distortion(self):
        camera = main_camera(skew=3.0)
        point = np.array([5.0, 3.0, -1.0])
        homogeneous = camera.P @ np.append(point, 1.0)
        assert np.allclose(camera.project(point[None])[0], homogeneous[:2] / homogeneous[2])

    def test_a_point_behind_the_camera_has_no_pixel(self):
        assert np.isnan(main_camera().project(np.array([[2.0, 90.0, -10.0]]))).all()

    def test_a_point_beyond_the_fold_has_no_pixel_unless_asked_for(self):
        camera = main_camera(
            focal_length=(600.0, 600.0), distortion=np.array([-0.3, *np.zeros(11)])
        )
        wide = np.array([[60.0, 35.0, 0.0]])
        assert np.isnan(camera.project(wide)).all()
        assert np.isfinite(camera.project(wide, folded=True)).all()

    def test_points_of_another_shape_are_our_mistake(self):
        with pytest.raises(ShapeError, match="points has shape"):
            main_camera().project(np.zeros((4, 2)))


class TestJacobian:
    def test_equals_its_finite_difference(self):
        distortion = np.array([0.2, -0.1, 1e-3, 2e-3, 0.05, 0, 0, 0, 1e-4, 0, 0, 2e-4])
        camera, point = main_camera(distortion=distortion, skew=2.0), np.array([15.0, -20.0, -2.0])
        steps = 1e-4 * np.vstack([np.eye(3), -np.eye(3)])
        pixels = camera.project(point + steps)
        assert np.allclose(camera.jacobian(point), (pixels[:3] - pixels[3:]).T / 2e-4, atol=1e-5)


class TestRays:
    def test_a_ray_meets_the_point_that_it_came_from(self):
        camera = main_camera(distortion=np.array([0.3, 0.045, *np.zeros(10)]))
        point = np.array([[12.0, 4.0, -1.5]])
        ray = camera.rays(camera.project(point))[0]
        assert np.allclose(np.cross(ray, point[0] - camera.position), 0.0, atol=1e-7)


class TestOnGround:
    def test_a_place_on_the_grass_comes_back_through_any_lens(self) -> None:
        places = np.array([[0.0, 0.0, 0.0], [10.0, -5.0, 0.0], [-7.5, 3.0, 0.0]])
        for lens in WIDE_LENSES:
            camera = wide((0.0, 60.0, -15.0), (0.0, 0.0, 0.0), lens, focal=700.0)
            assert np.allclose(
                camera.project_to_ground(camera.project(places)), places[:, :2], atol=1e-6
            )
        pixels = EVERY_COEFFICIENT.project(places)
        assert np.allclose(EVERY_COEFFICIENT.project_to_ground(pixels), places[:, :2], atol=1e-6)

    def test_what_looks_above_the_horizon_is_nowhere(self) -> None:
        pixels = np.array([[480.0, -2000.0], [480.0, 270.0]])
        found = main_camera().project_to_ground(pixels)
        assert np.isnan(found).tolist() == [[True, True], [False, False]]


class TestScaled:
    def test_a_point_moves_with_its_pixel(self):
        camera = main_camera()
        point = np.array([[12.0, 4.0, 0.0]])
        small, large = camera.project(point)[0], camera.scaled(2.0, 2.0).project(point)[0]
        assert np.allclose(large, (small + 0.5) * 2 - 0.5)


class TestCamera:
    def test_refuses_numbers_that_are_not_finite(self):
        with pytest.raises(DegenerateGeometryError):
            main_camera(position=np.array([np.nan, 0.0, 0.0]))

    def test_refuses_a_negative_focal_length(self):
        with pytest.raises(DegenerateGeometryError):
            main_camera(focal_length=(-2000.0, 2000.0))

    def test_equal_numbers_are_equal_cameras(self):
        assert main_camera() == main_camera()
        assert main_camera() != main_camera(skew=1.0)


ANGLE = st.floats(-3.1, 3.1)


class TestRotationFromPanTiltRoll:
    def test_pan_zero_and_tilt_ninety_look_along_minus_y(self):
        rotation = rotation_from_pan_tilt_roll(0.0, np.pi / 2, 0.0)
        assert np.allclose(rotation @ [0.0, -1.0, 0.0], [0.0, 0.0, 1.0])

    def test_less_tilt_looks_down(self):
        forward = rotation_from_pan_tilt_roll(0.0, np.radians(70), 0.0)[2]
        assert forward[2] > 0  # z points down

    def test_is_the_published_matrix_of_a_soccernet_camera(self):
        # From the camera JSON convention: R = (Rz(pan) Rx(tilt) Rz(roll))^T, written out.
        pan, tilt, roll = np.radians([40.5, 75.8, -0.23])
        sp, cp, st_, ct = np.sin(pan), np.cos(pan), np.sin(tilt), np.cos(tilt)
        sr, cr = np.sin(roll), np.cos(roll)
        expected = [
            [-sp * sr * ct + cp * cr, sp * cr + sr * cp * ct, sr * st_],
            [-sp * cr * ct - sr * cp, -sp * sr + cp * cr * ct, st_ * cr],
            [sp * st_, -st_ * cp, ct],
        ]
        assert np.allclose(rotation_from_pan_tilt_roll(pan, tilt, roll), expected, atol=1e-15)


class TestPanTiltRollFromRotation:
    @given(ANGLE, st.floats(0.05, 3.0), st.floats(-1.5, 1.5))
    def test_gives_back_the_angles_of_a_camera_that_is_not_upside_down(self, pan, tilt, roll):
        rotation = rotation_from_pan_tilt_roll(pan, tilt, roll)
        assert pan_tilt_roll_from_rotation(rotation) == pytest.approx((pan, tilt, roll), abs=1e-9)

    @given(ANGLE, st.floats(-3.1, 3.1), ANGLE)
    def test_any_rotation_is_rebuilt_from_its_angles(self, pan, tilt, roll):
        rotation = rotation_from_pan_tilt_roll(pan, tilt, roll)
        again = rotation_from_pan_tilt_roll(*pan_tilt_roll_from_rotation(rotation))
        assert np.allclose(again, rotation, atol=1e-9)

    def test_straight_down_has_no_roll(self):
        rotation = rotation_from_pan_tilt_roll(0.4, 0.0, 0.3)
        pan, tilt, roll = pan_tilt_roll_from_rotation(rotation)
        assert (pan, tilt, roll) == pytest.approx((0.7, 0.0, 0.0))


class TestRotationFromVector:
    @pytest.mark.parametrize("angle", [0.0, 1e-12, 1e-6, 0.3, 2.0, np.pi, 7.0])
    def test_is_what_the_library_of_computer_vision_makes_of_it(self, angle: float) -> None:
        axis = np.array([0.48, -0.6, 0.64])
        expected, _ = cv2.Rodrigues(axis * angle)
        assert np.allclose(rotation_from_vector(axis * angle), expected, atol=1e-14)

    def test_is_a_rotation_also_for_a_tiny_vector(self) -> None:
        found = rotation_from_vector(np.array([1e-9, -2e-9, 1e-10]))
        assert np.allclose(found @ found.T, np.eye(3), atol=1e-15)

    def test_another_shape_is_refused(self) -> None:
        with pytest.raises(ShapeError):
            rotation_from_vector(np.zeros((3, 1)))
