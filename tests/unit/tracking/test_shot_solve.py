"""All frames of a shot together say where its camera stands and how it zooms."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from app.geometry.arrays import FloatArray
from app.geometry.camera import Camera
from app.geometry.resection import (
    LOG_FOCAL,
    PAN,
    X,
    Z,
    camera_from_parameters,
    parameters_from_camera,
)
from app.paint.evidence import DetectedPaint
from app.paint.snap import SnappedCamera
from app.paint.tracing import trace_places
from app.soccer.pitch import Pitch
from app.soccer.policy import CalibrationPolicy
from app.tracking.follow import BRIDGED, LOST, TRACKED, TrackedFrame
from app.tracking.motion import BackgroundMatches
from app.tracking.shot import _stand_on_one_tripod
from app.tracking.shot_equations import compute_inverse_diagonal_blocks, solve_tridiagonal
from app.tracking.shot_solve import solve_shot
from tests.unit.paint.lawns import SMALL, TRUE

HALF = SMALL.diagonal / 2
COUNT = 12


def posed(number: int, speed_m: float = 0.0, aside_m: float = 0.0) -> Camera:
    parameters = parameters_from_camera(TRUE, HALF)
    parameters[X] += speed_m * number + aside_m
    parameters[PAN] += np.radians(0.4) * number
    parameters[LOG_FOCAL] += 0.004 * number
    return camera_from_parameters(parameters, TRUE.principal_point, HALF)


def shot(
    rng: np.random.Generator,
    off_m: float,
    speed_m: float = 0.0,
    count: int = COUNT,
    aside_m: float = 0.0,
) -> tuple[list[TrackedFrame], list[BackgroundMatches | None]]:
    """Frames whose cameras were found up to metres off, and the paint and background that they saw."""
    frames: list[TrackedFrame] = []
    matches: list[BackgroundMatches | None] = []
    for number in range(count):
        truth = posed(number, speed_m, aside_m)
        parameters = parameters_from_camera(truth, HALF)
        moved = rng.normal(0, off_m, 3)
        parameters[X : Z + 1] += moved
        parameters[PAN] += moved[0] / 62
        found = camera_from_parameters(parameters, truth.principal_point, HALF)
        traced = trace_places(truth, Pitch(), SMALL.width, SMALL.height, 8.0, 2000)
        sigmas = np.full(len(traced.pixels), 0.1)
        noise = rng.normal(0, 0.1, len(sigmas))
        # Of the found camera: the places are the same, and the paint lies where the truth has it.
        apart = truth.project(traced.places) - found.project(traced.places)
        offsets = (apart * traced.normals).sum(axis=1) + noise
        evidence = DetectedPaint(traced, offsets, sigmas, np.full(len(sigmas), 50.0))
        error = float(np.median(np.abs(noise)))
        snapped = SnappedCamera(
            found, evidence, error, None, 0.0, None, (SMALL.height, SMALL.width)
        )
        frames.append(TrackedFrame(number, number / 25, TRACKED, found, snapped))
        if number:
            here = rng.uniform((20, 20), (940, 520), (80, 2))
            before = posed(number - 1, speed_m)
            places = before.position + 80 * before.rays(here)
            there = truth.project(places) + rng.normal(0, 0.1, (80, 2))
            matches.append(BackgroundMatches(here, there))
        else:
            matches.append(None)
    return frames, matches


def solve(
    frames: list[TrackedFrame], matches: list[BackgroundMatches | None]
) -> list[TrackedFrame]:
    return solve_shot(frames, matches, SMALL, Pitch(), CalibrationPolicy()).frames


def positions(frames: list[TrackedFrame]) -> FloatArray:
    return np.array([frame.camera.position for frame in frames if frame.camera is not None])


def test_positions_come_together_where_the_tripod_stands():
    frames, matches = shot(np.random.default_rng(1), 0.4)
    solved = solve(frames, matches)
    before, after = positions(frames), positions(solved)
    assert np.linalg.norm(after - TRUE.position, axis=1).max() < 0.2
    assert np.ptp(after, axis=0).max() < 0.3 * np.ptp(before, axis=0).max()
    assert all(frame.error_px is not None and frame.error_px < 0.15 for frame in solved)


def test_sigma_holds_what_no_pitch_has_as_planned_and_the_truth():
    frames, matches = shot(np.random.default_rng(2), 0.3)
    for number, frame in enumerate(solve(frames, matches)):
        assert frame.camera is not None and frame.covariance is not None
        assert np.linalg.eigvalsh(frame.covariance)[0] > 0
        sigma = np.sqrt(np.diag(frame.covariance))
        assert 0.1 < sigma[X : Z + 1].max() < 3
        rest = parameters_from_camera(frame.camera, HALF) - parameters_from_camera(
            posed(number), HALF
        )
        assert (np.abs(rest) < 3 * sigma).all()


@pytest.mark.parametrize("speed_m", [0.2, 0.4])
def test_a_camera_that_travels_stands_on_no_tripod_and_keeps_to_its_paint(speed_m: float):
    frames, matches = shot(np.random.default_rng(5), 0.1, speed_m, 40)
    solved = solve_shot(frames, matches, SMALL, Pitch(), CalibrationPolicy())
    assert solved.shown is None
    for number, frame in enumerate(solved.frames):
        truth = posed(number, speed_m)
        assert frame.camera is not None and frame.covariance is not None
        assert frame.error_px is not None and frame.error_px < 0.15
        away = frame.camera.position - truth.position
        assert np.linalg.norm(away) < 0.4
        own = frame.covariance[X : Z + 1, X : Z + 1]
        assert away @ np.linalg.solve(own, away) < 11.3


def test_bridged_frames_of_a_camera_that_travels_lie_between_those_beside_them():
    frames, matches = shot(np.random.default_rng(6), 0.1, 0.3, 40)
    for number in (20, 21, 22):
        frames[number] = replace(frames[number], outcome=BRIDGED, snapped=None)
    solved = solve(frames, matches)
    for number in (20, 21, 22):
        camera, own, tracked = (
            solved[number].camera, solved[number].covariance, solved[10].covariance
        )  # fmt: skip
        assert camera is not None and own is not None and tracked is not None
        assert np.linalg.norm(camera.position - posed(number, 0.3).position) < 0.5
        assert own[X, X] > tracked[X, X]


@pytest.mark.parametrize(
    ("aside_m", "count", "same"),
    [(0.0, 2, True), (0.0, 20, True), (4.0, 3, False), (15.0, 1, False), (15.0, 20, False)],
)
def test_frames_behind_a_gap_stand_on_the_tripod_of_those_before_it_or_do_not(
    aside_m: float, count: int, same: bool
):
    frames, _ = shot(np.random.default_rng(7), 0.05, count=16)
    frames[5] = replace(frames[5], is_key=True)
    later, _ = shot(np.random.default_rng(8), 0.05, count=18 + count, aside_m=aside_m)
    gap = [replace(frame, outcome=LOST, camera=None, snapped=None) for frame in later[16:18]]
    asked = later[18:]
    both = [*frames, *gap, *asked]
    assert _stand_on_one_tripod(both, asked, Pitch(), CalibrationPolicy()) is same
    assert not _stand_on_one_tripod(both, [], Pitch(), CalibrationPolicy())


def test_frames_without_paint_lie_between_those_beside_them_and_lost_ones_stay_lost():
    frames, matches = shot(np.random.default_rng(3), 0.2)
    for number in (5, 6):
        frames[number] = replace(frames[number], outcome=BRIDGED, snapped=None)
    frames[9] = replace(frames[9], outcome=LOST, camera=None, snapped=None)
    solved = solve(frames, matches)
    assert solved[9] == frames[9]
    grass = np.array([[36.0, -4.0, 0.0], [30.0, 10.0, 0.0]])
    for number in (5, 6):
        camera = solved[number].camera
        assert camera is not None
        assert np.abs(camera.project(grass) - posed(number).project(grass)).max() < 1.5
        own, beside = (solved[each].covariance for each in (number, 3))
        assert own is not None and beside is not None
        assert own[PAN, PAN] > 0 and solved[number].error_px is None


def test_two_frames_are_no_shot_and_keep_what_their_paint_says():
    frames, matches = shot(np.random.default_rng(4), 0.2)
    solved = solve(frames[:2], matches[:2])
    assert [frame.camera for frame in solved] == [frame.camera for frame in frames[:2]]
    assert [frame.error_px for frame in solved] == [
        frame.snapped.error_px for frame in frames[:2] if frame.snapped is not None
    ]


@pytest.mark.parametrize("count", [1, 2, 6])
def test_a_block_tridiagonal_system_is_solved_as_the_whole_matrix(count: int):
    rng = np.random.default_rng(count)
    size = 3
    whole = np.zeros((count * size, count * size))
    diagonal, beside = np.empty((count, size, size)), rng.normal(size=(count - 1, size, size))
    for n in range(count):
        root = rng.normal(size=(size, size))
        diagonal[n] = root @ root.T + 20 * np.eye(size)
        at = slice(n * size, (n + 1) * size)
        whole[at, at] = diagonal[n]
        if n:
            above = slice((n - 1) * size, n * size)
            whole[above, at], whole[at, above] = beside[n - 1], beside[n - 1].T
    right = rng.normal(size=(count, size, 2))
    found = solve_tridiagonal(diagonal, beside, right).reshape(-1, 2)
    assert found == pytest.approx(np.linalg.solve(whole, right.reshape(-1, 2)))
    inverse = np.linalg.inv(whole)
    for n, block in enumerate(compute_inverse_diagonal_blocks(diagonal, beside)):
        at = slice(n * size, (n + 1) * size)
        assert block == pytest.approx(inverse[at, at])
