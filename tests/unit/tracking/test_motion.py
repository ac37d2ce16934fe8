"""The background of two frames says how a camera turned and zoomed."""

from __future__ import annotations

import cv2
import numpy as np
import pytest

from app.geometry.resection import (
    LOG_FOCAL,
    PAN,
    ROLL,
    TILT,
    X,
    Z,
    camera_from_parameters,
    parameters_from_camera,
)
from app.tracking.motion import (
    BackgroundMatches,
    apply_background_motion,
    match_background,
    rotate_and_zoom_to_points,
)
from tests.unit.paint.lawns import SMALL, TRUE

HALF = SMALL.diagonal / 2
START = parameters_from_camera(TRUE, HALF)


def matches_between(parameters: np.ndarray) -> BackgroundMatches:
    """Corners at many distances, seen by the camera of the lawns and by another one there."""
    rng = np.random.default_rng(3)
    here = rng.uniform((20, 20), (940, 520), (120, 2))
    places = TRUE.position + rng.uniform(20, 150, (120, 1)) * TRUE.rays(here)
    other = camera_from_parameters(parameters, TRUE.principal_point, HALF)
    return BackgroundMatches(here, other.project(places))


def test_turn_and_zoom_are_found_whatever_the_distance():
    truth = parameters_from_camera(TRUE, HALF)
    truth[[PAN, TILT, ROLL]] += np.radians([1.5, -0.4, 0.1])
    truth[LOG_FOCAL] += 0.03
    found, apart = apply_background_motion(TRUE, matches_between(truth), HALF)
    assert parameters_from_camera(found, HALF) == pytest.approx(truth, abs=1e-5)
    assert apart < 1e-3


def test_players_who_run_do_not_turn_the_camera():
    truth = parameters_from_camera(TRUE, HALF)
    truth[PAN] += np.radians(0.5)
    matches = matches_between(truth)
    matches.there[:25] += (9.0, 3.0)
    found, _ = apply_background_motion(TRUE, matches, HALF)
    assert parameters_from_camera(found, HALF)[:3] == pytest.approx(truth[:3], abs=2e-4)


def test_backwards_is_the_way_back():
    truth = parameters_from_camera(TRUE, HALF)
    truth[PAN] += np.radians(2.0)
    matches = matches_between(truth)
    there, _ = apply_background_motion(TRUE, matches, HALF)
    back, _ = apply_background_motion(there, matches.swap_frames(), HALF)
    start = parameters_from_camera(TRUE, HALF)
    assert parameters_from_camera(back, HALF) == pytest.approx(start, abs=1e-5)


def test_a_shifted_picture_has_shifted_corners_and_a_caption_stays_out():
    rng = np.random.default_rng(2)
    scene = cv2.GaussianBlur(rng.integers(0, 255, (400, 700), np.uint8).astype(np.uint8), (0, 0), 2)
    here, there = scene[20:340, 20:600].copy(), scene[25:345, 31:611].copy()
    caption = rng.integers(0, 255, (40, 120), np.uint8).astype(np.uint8)
    here[10:50, 10:130] = there[10:50, 10:130] = caption
    found = match_background(here, there)
    assert found is not None
    off = np.abs(found.there - found.here + (11.0, 5.0)).max(axis=1)
    assert len(off) > 40 and np.percentile(off, 95) < 0.3


def test_two_pictures_of_different_things_have_no_background():
    rng = np.random.default_rng(4)
    one, other = rng.integers(0, 255, (2, 270, 480), np.uint8).astype(np.uint8)
    assert match_background(one, other) is None
    assert match_background(np.zeros_like(one), other) is None


def seen_after(turn: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Points of the picture at many distances, and where a turned camera shows them."""
    rng = np.random.default_rng(8)
    here = rng.uniform((20, 20), (940, 520), (90, 2))
    points = TRUE.position + rng.uniform(20, 150, (90, 1)) * TRUE.rays(here)
    turned = camera_from_parameters(START + turn, TRUE.principal_point, HALF)
    return points, turned.project(points) - TRUE.principal_point


def turned_to(points: np.ndarray, pixels: np.ndarray, rounds: int) -> tuple[np.ndarray, np.ndarray]:
    parameters, apart = START.copy(), np.empty(len(points))
    rotate_and_zoom_to_points(parameters, points, pixels, HALF, rounds, 0.5, apart)
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
