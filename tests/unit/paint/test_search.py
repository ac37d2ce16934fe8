from __future__ import annotations

from concurrent.futures import ThreadPoolExecutor

import numpy as np

from app.geometry.resection import PAN, TILT, camera_from_parameters, parameters_from_camera
from app.paint.search import compute_coarse_costs, compute_cost_terms, refine_cameras
from tests.unit.paint.lawns import PITCH, SMALL, TRUE, picture_of

HALF = SMALL.diagonal / 2
ROW = parameters_from_camera(TRUE, HALF)
PICTURE = picture_of(TRUE)
EXECUTOR = ThreadPoolExecutor(1)


def _turned(degrees: float) -> np.ndarray:
    row = ROW.copy()
    row[PAN : TILT + 1] += np.radians(degrees)
    return row


class TestLooks:
    def test_the_true_camera_leaves_no_paint_unexplained_and_no_marking_unsupported(self):
        unexplained, unsupported, on, off = compute_cost_terms(
            ROW[None], PICTURE, PITCH, 8.0, EXECUTOR
        )[0]
        assert unexplained < 0.15
        assert unsupported < 0.15
        assert on > 1000
        assert off == 0

    def test_the_farther_a_camera_is_turned_away_the_worse_it_looks(self):
        rows = np.array([ROW, _turned(0.3), _turned(1.0)])
        for cost in (
            compute_coarse_costs(rows, PICTURE, PITCH, 20.0, EXECUTOR),
            *compute_cost_terms(rows, PICTURE, PITCH, 20.0, EXECUTOR)[:, :2].T,
        ):
            assert cost[0] < cost[1] < cost[2]

    def test_a_camera_that_looks_at_the_sky_explains_nothing(self):
        row = ROW.copy()
        row[TILT] = np.radians(130)
        assert compute_coarse_costs(row[None], PICTURE, PITCH, 20.0, EXECUTOR)[0] == 1.0


class TestRefine:
    def test_a_camera_half_a_degree_off_comes_back_to_the_paint(self):
        start, sigma = _turned(0.5)[None], np.array([9, 9, 0.02, 3, 6, 3, 0.2, 0.01])
        rows = refine_cameras(
            start, start, sigma, PICTURE, PICTURE.points, PITCH, (16, 12, 8, 6, 4, 3), EXECUTOR
        )
        camera = camera_from_parameters(rows[0], TRUE.principal_point, HALF)
        corners = np.array([[52.5, -34.0, 0], [36.0, -20.16, 0], [36.0, 20.16, 0]])
        assert np.abs(camera.project(corners) - TRUE.project(corners)).max() < 3
