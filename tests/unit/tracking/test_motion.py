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
    camera_from_parameters,
    parameters_from_camera,
)
from app.tracking.motion import BackgroundMatches, match_background, rotate_camera
from tests.unit.paint.lawns import SMALL, TRUE

HALF = SMALL.diagonal / 2


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
    found, apart = rotate_camera(TRUE, matches_between(truth), HALF)
    assert parameters_from_camera(found, HALF) == pytest.approx(truth, abs=1e-5)
    assert apart < 1e-3


def test_players_who_run_do_not_turn_the_camera():
    truth = parameters_from_camera(TRUE, HALF)
    truth[PAN] += np.radians(0.5)
    matches = matches_between(truth)
    matches.there[:25] += (9.0, 3.0)
    found, _ = rotate_camera(TRUE, matches, HALF)
    assert parameters_from_camera(found, HALF)[:3] == pytest.approx(truth[:3], abs=2e-4)


def test_backwards_is_the_way_back():
    truth = parameters_from_camera(TRUE, HALF)
    truth[PAN] += np.radians(2.0)
    matches = matches_between(truth)
    there, _ = rotate_camera(TRUE, matches, HALF)
    back, _ = rotate_camera(there, matches.reversed(), HALF)
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
