from dataclasses import replace

import cv2
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

    def test_no_ray_goes_through_what_lies_beyond_the_fold_of_a_lens(self):
        folded = replace(camera(), distortion=np.array([-0.35, *[0.0] * 11]))
        with pytest.raises(DegenerateGeometryError, match="outside the field of view"):
            optimal_diameter(folded, np.array([9000.0, 360.0]), POINT, BALL)


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


class TestThroughAWideLens:
    """Judged by points all over the sphere, each sent through cv2.fisheye."""

    K = (0.021, -0.017, 0.006, -0.0011)
    VIEW = Camera(
        np.eye(3), np.zeros(3), (640.0, 630.0), (959.5, 539.5), 2.0, np.array(K), lens="fisheye"
    )
    FAR = 14.0
    OFF_AXIS = pytest.mark.parametrize("degrees", [0.0, 25.0, 50.0, 70.0, 80.0, 86.0])

    def place(self, degrees: float, around: float = 0.7) -> np.ndarray:
        angle = np.radians(degrees)
        aside = np.sin(angle) * np.array([np.cos(around), np.sin(around)])
        return self.FAR * np.append(aside, np.cos(angle))

    def outline(self, center: np.ndarray) -> np.ndarray:
        """Bounds of 40,000 points of the sphere: left, top, right, bottom."""
        random = np.random.default_rng(1).normal(size=(40_000, 3))
        points = center + BALL / 2 * random / np.linalg.norm(random, axis=1, keepdims=True)
        pixels, _ = cv2.fisheye.projectPoints(
            points[:, None], np.zeros(3), np.zeros(3), self.VIEW.K, np.array(self.K),
            alpha=2.0 / 640.0,
        )  # fmt: skip
        return np.concatenate([pixels[:, 0].min(axis=0), pixels[:, 0].max(axis=0)])

    @OFF_AXIS
    def test_the_tight_box_holds_the_whole_sphere_and_no_more(self, degrees):
        center = self.place(degrees)
        found, expected = tight_box(self.VIEW, center, BALL / 2), self.outline(center)
        assert np.abs(found - expected).max() < 0.005 * (expected[2] - expected[0])

    @OFF_AXIS
    def test_the_optimal_diameter_is_the_mean_side_of_that_box(self, degrees):
        center = self.place(degrees)
        left, top, right, bottom = self.outline(center)
        pixel = self.VIEW.project(center[None])[0]
        diameter, off_ray = optimal_diameter(self.VIEW, pixel, center, BALL)
        assert diameter == pytest.approx((right - left + bottom - top) / 2, rel=5e-3)
        assert off_ray < 1e-6

    @OFF_AXIS
    def test_the_monocular_position_undoes_it(self, degrees):
        center = self.place(degrees)
        pixel = self.VIEW.project(center[None])[0]
        diameter, _ = optimal_diameter(self.VIEW, pixel, center, BALL)
        assert np.allclose(position_from_diameter(self.VIEW, pixel, diameter, BALL), center)

    def test_on_the_axis_it_is_the_papers(self):
        pinhole = replace(self.VIEW, lens="brown_conrady", distortion=np.zeros(12), skew=0.0,
                          focal_length=(640.0, 640.0))  # fmt: skip
        wide = replace(pinhole, lens="fisheye", distortion=np.array(self.K))
        center, point = np.array([959.5, 539.5]), np.array([0.0, 0.0, self.FAR])
        papers = optimal_diameter(pinhole, center, point, BALL)
        assert optimal_diameter(wide, center, point, BALL) == pytest.approx(papers, rel=1e-12)

    def test_a_ball_that_is_cut_by_the_edge_has_no_box(self):
        folding = replace(self.VIEW, distortion=np.array([-0.12, 0.01, -0.02, 0.0]))
        edge = np.degrees(np.arctan(folding.model.fold_radius(folding.distortion)))
        assert np.isfinite(tight_box(folding, self.place(edge - 2.0), BALL / 2)).all()
        with pytest.raises(DegenerateGeometryError, match="field of view"):
            tight_box(folding, self.place(edge - 0.2), BALL / 2)

    def test_a_centre_beyond_the_edge_has_no_diameter(self):
        with pytest.raises(DegenerateGeometryError, match="field of view"):
            optimal_diameter(self.VIEW, np.array([9000.0, 0.0]), self.place(50.0), BALL)
