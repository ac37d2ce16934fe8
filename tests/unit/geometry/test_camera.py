from dataclasses import replace

import cv2
import numpy as np
import pytest

from app.errors import DegenerateGeometryError, ShapeError
from app.geometry.camera import Camera
from app.geometry.rotation import rotation_from_pan_tilt_roll
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
            assert np.allclose(camera.on_ground(camera.project(places)), places[:, :2], atol=1e-6)
        pixels = EVERY_COEFFICIENT.project(places)
        assert np.allclose(EVERY_COEFFICIENT.on_ground(pixels), places[:, :2], atol=1e-6)

    def test_what_looks_above_the_horizon_is_nowhere(self) -> None:
        pixels = np.array([[480.0, -2000.0], [480.0, 270.0]])
        found = main_camera().on_ground(pixels)
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
