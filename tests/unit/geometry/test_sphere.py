from dataclasses import replace

import numpy as np
import pytest

from app.errors import DegenerateGeometryError
from app.geometry.camera import Camera
from app.geometry.sphere import optimal_diameter, position_from_diameter, tight_box
from tests.cameras import looking

BALL = 0.226
PLACE = np.array([5.0, 55.0, -12.0])
POINT = np.array([12.0, 4.0, -1.3])


def camera(**changes) -> Camera:
    level = looking(PLACE, (10.0, 0.0, 0.0), 3000.0)
    return replace(level, **{"focal_length": (3000.0, 2900.0), **changes})


CAMERAS = {
    "pinhole": camera(),
    "skewed": camera(skew=40.0),
    "distorted": camera(distortion=np.array([0.8, 0.32, *np.zeros(10)])),
}
each_camera = pytest.mark.parametrize("view", CAMERAS.values(), ids=CAMERAS.keys())


class TestPositionFromDiameter:
    def test_a_ball_of_one_pixel_per_focal_length_is_its_diameter_away_times_that(self):
        level = Camera(np.eye(3), np.zeros(3), (1000.0, 1000.0), (0.0, 0.0))
        # 0.226 m that appear as 10 px at f = 1000 are 22.6 m away.
        found = position_from_diameter(level, np.zeros(2), 10.0, BALL)
        assert np.allclose(found, [0.0, 0.0, 22.6])

    def test_a_ball_without_size_has_no_position(self):
        with pytest.raises(DegenerateGeometryError):
            position_from_diameter(camera(), np.zeros(2), 0.0, BALL)


class TestOptimalDiameter:
    @each_camera
    def test_undoes_the_monocular_position(self, view):
        center = view.project(POINT[None])[0]
        diameter, off_ray = optimal_diameter(view, center, POINT, BALL)
        assert off_ray == pytest.approx(0.0, abs=1e-9)
        if view.skew == 0:
            again = position_from_diameter(view, center, diameter, BALL)
            assert np.linalg.norm(again - POINT) < 1e-4 * np.linalg.norm(POINT - PLACE)

    def test_is_the_minimum_that_a_search_finds(self):
        view = camera()
        center = view.project(POINT[None])[0] + [4.0, -3.0]
        diameter, off_ray = optimal_diameter(view, center, POINT, BALL)
        tried = diameter * np.linspace(0.98, 1.02, 4001)
        apart = [
            np.linalg.norm(position_from_diameter(view, center, d, BALL) - POINT) for d in tried
        ]
        assert tried[int(np.argmin(apart))] == pytest.approx(diameter, rel=1e-4)
        assert min(apart) == pytest.approx(off_ray, rel=1e-6)

    def test_a_point_behind_the_camera_has_no_box(self):
        with pytest.raises(DegenerateGeometryError, match="behind"):
            optimal_diameter(camera(), np.array([640.0, 360.0]), np.array([0.0, 90.0, 0.0]), BALL)


class TestTightBox:
    @each_camera
    def test_bounds_every_point_of_the_sphere(self, view):
        left, top, right, bottom = tight_box(view, POINT, BALL / 2)
        generator = np.random.default_rng(3)
        directions = generator.normal(size=(200_000, 3))
        directions /= np.linalg.norm(directions, axis=1, keepdims=True)
        pixels = view.project(POINT + BALL / 2 * directions)
        brute = np.concatenate([pixels.min(axis=0), pixels.max(axis=0)])
        assert np.allclose([left, top, right, bottom], brute, atol=0.02)

    def test_on_the_axis_it_is_a_square_a_little_larger_than_the_pinhole_rule(self):
        level = Camera(np.eye(3), np.zeros(3), (1000.0, 1000.0), (0.0, 0.0))
        left, top, right, bottom = tight_box(level, np.array([0.0, 0.0, 2.0]), 0.5)
        # tan(asin(r / z)) = 0.5 / sqrt(4 - 0.25)
        assert np.allclose([-left, -top, right, bottom], 500 / np.sqrt(3.75))

    def test_a_ball_around_the_camera_has_no_outline(self):
        with pytest.raises(DegenerateGeometryError):
            tight_box(camera(), PLACE, 0.2)
