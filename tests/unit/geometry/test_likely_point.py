"""Likely point: what several cameras say of a point, each looking as it does by itself."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from app.geometry.likely_point import CameraTable, LikelyPoints, _project, find_most_likely_points
from tests.cameras import EVERY_COEFFICIENT, WIDE_LENSES, looking, wide

MIDDLE = (10.0, 0.0, 0.0)
PLACES = ((2.0, 62.0, -14.0), (75.0, -10.0, -8.0), (-30.0, -70.0, -20.0))
PINHOLES = [looking(place, MIDDLE, 2000.0) for place in PLACES]
BENT = [looking(place, MIDDLE, 2000.0, bend=-0.02) for place in PLACES]
WIDE = [wide(PLACES[0], MIDDLE, lens) for lens in WIDE_LENSES]
SKEWED = [replace(EVERY_COEFFICIENT, skew=2.5)]
BALL = np.array([12.0, 3.0, -2.0])
ONE_PIXEL = np.eye(2)


def found_from(cameras, views, start=(10.0, 0.0, -1.0), off=0.0) -> LikelyPoints:
    """What cameras find of the ball from what some of them see, each off by some pixels."""
    pixels = np.array([camera.project(BALL[None])[0] for camera in cameras]) + off
    spreads = np.tile(ONE_PIXEL, (1, len(views), 1, 1))
    table = CameraTable.of(cameras)
    return find_most_likely_points(table, pixels, np.array([views]), np.array([start]), spreads)


def look(cameras: CameraTable, number, point):
    """Pixel of a point in one of the cameras, NaN where it does not show it, and its derivative."""
    pixel, slope = np.empty(2), np.empty((2, 3))
    if not _project(*cameras.kernel_arrays, number, point, pixel, slope):
        pixel[:] = np.nan
    return pixel, slope


class TestLook:
    @pytest.mark.parametrize("cameras", [PINHOLES, BENT, SKEWED, WIDE, [*WIDE, *BENT, *PINHOLES]])
    def test_each_pixel_and_derivative_is_that_of_its_camera(self, cameras):
        table = CameraTable.of(cameras)
        for point in np.random.default_rng(5).uniform([-20, -20, -5], [30, 20, 0], (6, 3)):
            for number, camera in enumerate(cameras):
                pixel, slope = look(table, number, point)
                assert np.allclose(pixel, camera.project(point[None])[0], rtol=1e-12, atol=1e-9)
                assert np.allclose(slope, camera.jacobian(point), rtol=1e-9, atol=1e-9)

    def test_what_a_camera_does_not_show_has_no_pixel(self):
        behind, beyond = np.array([2.0, 90.0, -10.0]), np.array([60.0, 35.0, 0.0])
        folding = replace(
            PINHOLES[0], focal_length=(600.0, 600.0), distortion=np.array([-0.3, *np.zeros(11)])
        )
        table = CameraTable.of([folding, PINHOLES[0], WIDE[0]])
        assert np.isnan([look(table, number, behind)[0] for number in range(3)]).all()
        assert np.isnan(look(table, 0, beyond)[0]).all()
        assert not np.isnan(look(table, 1, beyond)[0]).any()

    def test_a_wide_lens_shows_its_own_axis(self):
        camera = WIDE[0]
        pixel, slope = look(CameraTable.of([camera]), 0, np.array(MIDDLE))
        assert np.allclose(pixel, camera.principal_point)
        assert np.isfinite(slope).all()


class TestLikelyPoints:
    @pytest.mark.parametrize("cameras", [PINHOLES, BENT, [*WIDE[:1], *BENT[1:]]])
    @pytest.mark.parametrize("views", [[0, 1], [0, 2], [2, 1, 0]])
    def test_exact_pixels_give_the_exact_point(self, cameras, views):
        made = found_from(cameras, views)
        assert made.found.tolist() == [True]
        assert np.allclose(made.points[0], BALL, atol=1e-9)
        assert np.allclose(made.distances, 0.0, atol=1e-9)

    def test_covariance_and_distances_are_those_of_the_normal_equations(self):
        made = found_from(BENT, [0, 1, 2], off=np.array([[1.0, -2.0], [0.5, 0.0], [0.0, 3.0]]))
        slopes = np.concatenate([camera.jacobian(made.points[0]) for camera in BENT])
        assert np.allclose(made.covariances[0], np.linalg.inv(slopes.T @ slopes), rtol=1e-8)
        # At the minimum no step is left.
        pixels = np.array([camera.project(BALL[None])[0] for camera in BENT])
        pixels += np.array([[1.0, -2.0], [0.5, 0.0], [0.0, 3.0]])
        now = np.array([camera.project(made.points[:1])[0] for camera in BENT])
        assert np.allclose(slopes.T @ (pixels - now).ravel(), 0.0, atol=1e-4)
        assert np.allclose(made.distances[0], ((pixels - now) ** 2).sum(axis=1), rtol=1e-6)

    def test_cameras_that_look_along_one_ray_determine_nothing_and_disturb_nobody(self):
        cameras = [PINHOLES[0], PINHOLES[0], PINHOLES[1]]
        pixels = np.array([camera.project(BALL[None])[0] for camera in cameras])
        chosen, starts = np.array([[0, 1], [0, 2]]), np.array([[10.0, 0.0, -1.0]] * 2)
        spreads = np.tile(ONE_PIXEL, (2, 2, 1, 1))
        table = CameraTable.of(cameras)
        both = find_most_likely_points(table, pixels, chosen, starts, spreads)
        alone = find_most_likely_points(table, pixels, chosen[1:], starts[1:], spreads[1:])
        assert both.found.tolist() == [False, True]
        assert np.array_equal(both.points[1], alone.points[0])
        assert np.array_equal(both.covariances[1], alone.covariances[0])

    @pytest.mark.parametrize("start", [(np.nan,) * 3, (2.0, 90.0, -10.0)])
    def test_a_start_that_is_nowhere_or_behind_a_camera_settles_nowhere(self, start):
        assert found_from(PINHOLES, [0, 1], start).found.tolist() == [False]

    def test_an_uncertainty_that_is_none_is_no_answer(self):
        pixels = np.array([camera.project(BALL[None])[0] for camera in PINHOLES])
        spreads = np.zeros((1, 2, 2, 2))
        made = find_most_likely_points(
            CameraTable.of(PINHOLES), pixels, np.array([[0, 1]]), BALL[None], spreads
        )
        assert made.found.tolist() == [False]
