"""The compiled turn of a camera to points that are seen."""

from __future__ import annotations

import numpy as np
import pytest

from app.geometry.resection import (
    LOG_FOCAL,
    PAN,
    TILT,
    X,
    Z,
    camera_from_parameters,
    parameters_from_camera,
)
from app.tracking.motion_kernels import turn_to_points
from tests.unit.paint.lawns import SMALL, TRUE

HALF = SMALL.diagonal / 2
START = parameters_from_camera(TRUE, HALF)


def seen_after(turn: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Points of the picture at many distances, and where a turned camera shows them."""
    rng = np.random.default_rng(8)
    here = rng.uniform((20, 20), (940, 520), (90, 2))
    points = TRUE.position + rng.uniform(20, 150, (90, 1)) * TRUE.rays(here)
    turned = camera_from_parameters(START + turn, TRUE.principal_point, HALF)
    return points, turned.project(points) - TRUE.principal_point


def turned_to(points: np.ndarray, pixels: np.ndarray, rounds: int) -> tuple[np.ndarray, np.ndarray]:
    parameters, apart = START.copy(), np.empty(len(points))
    turn_to_points(parameters, points, pixels, HALF, rounds, 0.5, apart)
    return parameters, apart


def a_turn() -> np.ndarray:
    turn = np.zeros(8)
    turn[[PAN, TILT, LOG_FOCAL]] = np.radians(1.2), np.radians(-0.3), 0.02
    return turn


def test_the_camera_turns_and_zooms_where_it_stands():
    found, apart = turned_to(*seen_after(a_turn()), rounds=8)
    assert found == pytest.approx(START + a_turn(), abs=1e-8)
    assert found[X : Z + 1].tolist() == START[X : Z + 1].tolist()
    assert apart.max() < 1e-3


def test_a_point_behind_the_camera_says_nothing():
    points, pixels = seen_after(a_turn())
    points[0] = TRUE.position - 30.0 * TRUE.rotation[2]
    found, apart = turned_to(points, pixels, rounds=8)
    assert found == pytest.approx(START + a_turn(), abs=1e-5)
    assert apart[0] > 1000.0


def test_points_without_any_extent_are_an_error():
    points, pixels = seen_after(a_turn())
    with pytest.raises(np.linalg.LinAlgError):
        turned_to(points[:0], pixels[:0], rounds=1)
