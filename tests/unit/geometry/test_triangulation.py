from itertools import product

import cv2
import numpy as np
import pytest

from app.errors import ShapeError
from app.geometry.camera import Camera
from app.geometry.triangulation import (
    parallax_angle,
    smallest_singular_vectors,
    triangulate_pairs,
    triangulation_shifts,
)
from tests.cameras import FULL_HD, looking

MAIN, REPLAY = (
    looking(place, (20.0, 0.0, 0.0), 2500.0, size=FULL_HD)
    for place in ((0.0, 60.0, -15.0), (75.0, -10.0, -8.0))
)
PLACES = MAIN.position[None], REPLAY.position[None]


class TestTriangulatePairs:
    def test_exact_images_give_the_exact_point(self):
        points = np.array([[20.0, 3.0, -1.0], [25.0, -8.0, -0.11]])
        P_a, P_b = np.stack([MAIN.P] * 2), np.stack([REPLAY.P] * 2)
        found = triangulate_pairs(P_a, P_b, MAIN.project(points), REPLAY.project(points))
        assert np.allclose(found, points, atol=1e-8)

    def test_equals_opencv_on_noisy_images(self):
        generator = np.random.default_rng(5)
        points = generator.uniform([10, -20, -5], [40, 20, 0], (50, 3))
        a = MAIN.project(points) + generator.normal(0, 3, (50, 2))
        b = REPLAY.project(points) + generator.normal(0, 3, (50, 2))
        expected = cv2.triangulatePoints(MAIN.P, REPLAY.P, a.T, b.T)
        found = triangulate_pairs(np.stack([MAIN.P] * 50), np.stack([REPLAY.P] * 50), a, b)
        assert np.allclose(found, (expected[:3] / expected[3]).T, atol=1e-6)

    def test_equals_the_singular_value_decomposition_on_arbitrary_systems(self):
        generator = np.random.default_rng(2)
        systems = generator.normal(size=(200, 4, 4)) * generator.uniform(1, 1e6, (200, 4, 1))
        found = np.empty((200, 4))
        smallest_singular_vectors(systems, found)
        expected = np.linalg.svd(systems)[2][:, -1]
        assert np.allclose(np.abs((found * expected).sum(axis=1)), 1.0, atol=1e-12)

    def test_parallel_rays_meet_at_infinity_and_stop_no_others(self):
        aside = Camera(MAIN.rotation, MAIN.position + np.eye(3)[0], (1.0, 1.0), (0.0, 0.0))
        alike = Camera(MAIN.rotation, MAIN.position, (1.0, 1.0), (0.0, 0.0))
        point = np.array([[20.0, 3.0, -1.0]])
        found = triangulate_pairs(
            np.stack([alike.P, MAIN.P]),
            np.stack([aside.P, REPLAY.P]),
            np.concatenate([np.zeros((1, 2)), MAIN.project(point)]),
            np.concatenate([np.zeros((1, 2)), REPLAY.project(point)]),
        )
        assert np.isposinf(found[0]).all()
        assert np.allclose(found[1], point, atol=1e-8)

    def test_flat_pixels_are_our_mistake(self):
        with pytest.raises(ShapeError, match="pixels_b"):
            triangulate_pairs(MAIN.P[None], REPLAY.P[None], np.zeros((1, 2)), np.zeros(2))


class TestMovedPoints:
    def test_each_is_the_pair_with_one_pixel_moved(self):
        generator = np.random.default_rng(3)
        points = generator.uniform([10, -20, -5], [40, 20, 0], (4, 3))
        P_a, P_b = np.stack([MAIN.P] * 4), np.stack([REPLAY.P] * 4)
        pixels = [MAIN.project(points), REPLAY.project(points)]
        moved = triangulation_shifts(P_a, P_b, *pixels, 0.5)
        assert moved.shape == (4, 2, 2, 2, 3)
        for view, axis, way in product((0, 1), repeat=3):
            seen = [place.copy() for place in pixels]
            seen[view][:, axis] += 0.5 - way
            expected = triangulate_pairs(P_a, P_b, *seen)
            assert np.array_equal(moved[:, view, axis, way], expected)

    def test_without_pairs_the_result_is_empty(self):
        none = np.empty((0, 2))
        found = triangulation_shifts(np.empty((0, 3, 4)), np.empty((0, 3, 4)), none, none, 0.5)
        assert found.shape == (0, 2, 2, 2, 3)


class TestParallaxAngle:
    def test_is_symmetric_in_the_two_cameras(self):
        points, main, replay = np.array([[20.0, 3.0, -1.0]]), *PLACES
        there = parallax_angle(main, replay, points)
        assert np.array_equal(there, parallax_angle(replay, main, points))

    def test_each_point_has_cameras_of_its_own(self):
        points, main, replay = np.array([[20.0, 3.0, -1.0], [9.0, 8.0, 0.0]]), *PLACES
        cameras = np.concatenate([main, replay])
        both = parallax_angle(cameras, cameras[::-1], points)
        assert both[0] == parallax_angle(main, replay, points[:1])[0]
        assert both[1] == parallax_angle(replay, main, points[1:])[0]

    def test_a_one_millimetre_baseline_at_a_hundred_metres_keeps_its_digits(self):
        near, far = np.zeros((1, 3)), np.array([[1e-3, 0.0, 0.0]])
        angle = parallax_angle(near, far, np.array([[0.0, 100.0, 0.0]]))[0]
        assert angle == pytest.approx(1e-5, rel=1e-9)

    def test_a_point_at_a_camera_has_no_angle(self):
        for here, there in ((0.0, 1.0), (1.0, 0.0)):
            places = np.full((1, 3), here), np.full((1, 3), there)
            assert np.isnan(parallax_angle(*places, np.zeros((1, 3)))).all()

    def test_a_flat_point_is_our_mistake(self):
        with pytest.raises(ShapeError):
            parallax_angle(np.zeros((1, 3)), np.ones((1, 3)), np.zeros(3))
