"""Frames of one tripod say together which pitch they show, and how far cameras on the plan are off."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from app.geometry.arrays import FloatArray
from app.geometry.resection import (
    LOG_FOCAL,
    PAN,
    CurvePoints,
    X,
    Z,
    camera_from_parameters,
    parameters_from_camera,
)
from app.soccer.pitch import GOAL_PARTS, MARKINGS, Pitch
from app.soccer.policy import CalibrationPolicy
from app.solving.lone_frame import CROWN_SIGMA_M, INWARD_SIGMA_M
from app.solving.paint_camera import PaintProblem, measure_offsets
from app.solving.paint_noise import CROWN, INWARD, TERMS, compute_paint_shift
from app.solving.resect import ResectionProblem
from app.solving.tripod_pitch import (
    FrameWithPaint,
    TripodPitch,
    find_tripod_pitch,
    second_moment_about_plan,
)
from tests.cameras import SIZE
from tests.unit.solving.conftest import MAIN

PLAN, POLICY, HALF = Pitch(), CalibrationPolicy(), SIZE.diagonal / 2
CENTER = np.array(MAIN.principal_point)
NOISE_PX, ROUNDS, STRICT = 0.1, 10, 2
WITHIN = 3.5
"""Standard deviations within which numbers of a few seeds lie."""


def posed(pan_degrees: float, zoom: float = 1.0) -> FloatArray:
    parameters = parameters_from_camera(MAIN, HALF)
    parameters[PAN] += np.radians(pan_degrees)
    parameters[LOG_FOCAL] += np.log(zoom)
    return parameters


def laid(crown: float = 0.0, inward: float = 0.0) -> FloatArray:
    values = np.zeros(TERMS)
    values[CROWN], values[INWARD] = crown / CROWN_SIGMA_M, inward / INWARD_SIGMA_M
    return values


def painted(
    truth: FloatArray, pitch: Pitch, values: FloatArray, rng: np.random.Generator
) -> FrameWithPaint:
    """Paint of a frame, and the camera that lays the plan's markings on it."""
    camera = camera_from_parameters(truth, MAIN.principal_point, HALF)
    places, marking = [], []
    for number, name in enumerate(MARKINGS):
        if name not in GOAL_PARTS:
            line = pitch.sample(name, 0.7, 0.7)
            which = np.full(len(line), number)
            seen = camera.project(line + compute_paint_shift(line[:, :2], which, values, pitch))
            inside = ((seen > 0) & (seen < (SIZE.width, SIZE.height))).all(axis=1)
            places.append(seen[inside])
            marking.append(which[inside])
    pixels = np.concatenate(places)
    pixels = pixels + rng.normal(0, NOISE_PX, pixels.shape) - CENTER
    curves = CurvePoints(pixels, np.concatenate(marking), np.ones(len(pixels)))
    sigmas = np.full(len(pixels), NOISE_PX)
    problem = PaintProblem.of(ResectionProblem.of(SIZE, POLICY), truth, None)
    parameters = truth
    for at in range(ROUNDS):
        offsets = measure_offsets(problem, parameters, curves, sigmas, PLAN)
        parameters = parameters + problem.compute_step(
            parameters, offsets, strict=at >= ROUNDS - STRICT
        )
    return FrameWithPaint(parameters, curves, sigmas)


def film(
    pitch: Pitch, values: FloatArray, seed: int = 1
) -> tuple[list[FloatArray], list[FrameWithPaint]]:
    rng = np.random.default_rng(seed)
    truths = [posed(pan, 1 + 0.02 * at) for at, pan in enumerate(np.linspace(-22, 22, 8))]
    return truths, [painted(truth, pitch, values, rng) for truth in truths]


def shown_by(frames: list[FrameWithPaint]) -> TripodPitch:
    found = find_tripod_pitch(frames, SIZE, PLAN, POLICY)
    assert found is not None
    return found


def test_a_shorter_pitch_with_a_crown_is_found_within_its_sigma():
    truths, frames = film(Pitch(101, 67.5), laid(crown=0.15, inward=0.06))
    found = shown_by(frames)
    sizes = np.array([found.pitch.length - 101, found.pitch.width - 67.5])
    assert (np.abs(sizes) < WITHIN * found.size_sigmas).all() and found.size_sigmas.max() < 0.5
    for (value, sigma), truth in ((found.crown, 0.15), (found.inward_paint_shift, 0.06)):
        assert abs(value - truth) < WITHIN * sigma and sigma < 0.05
    away = found.tripod_position - truths[0][X : Z + 1]
    assert away @ np.linalg.solve(found.tripod_position_covariance, away) < WITHIN**2
    other = found.clearly_different_pitch()
    assert other is not None and other.length == pytest.approx(101, abs=0.7)
    assert found.frames == len(frames) and found.are_sizes_known == (True, True)


def test_the_planned_pitch_is_left_alone():
    _, frames = film(PLAN, laid())
    found = shown_by(frames)
    assert found.clearly_different_pitch() is None
    assert found.crown[0] == pytest.approx(0, abs=WITHIN * found.crown[1])


def test_cameras_on_the_plan_know_how_far_off_they_are():
    truths, frames = film(Pitch(101, 68), laid(crown=0.15))
    found = shown_by(frames)
    position, off_plan, off_shown = slice(X, Z + 1), [], []
    for truth, frame in zip(truths, frames, strict=True):
        parameters, covariance = found.fit_camera(frame)
        off = (frame.parameters - truth)[position]
        about = second_moment_about_plan(frame.parameters, parameters, covariance)
        assert off @ np.linalg.solve(about[position, position], off) < WITHIN**2
        assert np.linalg.eigvalsh(about)[0] > 0
        off_plan.append(np.linalg.norm(off))
        off_shown.append(np.linalg.norm((parameters - truth)[position]))
    assert np.mean(off_plan) > 1.0 and np.mean(off_shown) < 0.6 * np.mean(off_plan)


def test_lines_are_drawn_where_the_pitch_has_them():
    truths, frames = film(Pitch(101, 68), laid(crown=0.15))
    found = shown_by(frames)
    (parameters, _), pitch = found.fit_camera(frames[-1]), Pitch(101, 68)
    camera, truth = (
        camera_from_parameters(each, MAIN.principal_point, HALF)
        for each in (parameters, truths[-1])
    )
    name = MARKINGS[np.bincount(frames[-1].sightings.curve).argmax()]
    line = pitch.sample(name, 0.2, 0.2)
    which = np.full(len(line), MARKINGS.index(name))
    there = truth.project(line + compute_paint_shift(line[:, :2], which, laid(crown=0.15), pitch))
    there = there[((there > 0) & (there < (SIZE.width, SIZE.height))).all(axis=1)]
    drawn = camera.project(found.sample_marking(name))
    apart = np.hypot(*(there[:, None] - drawn[None]).T)
    # Points of a line are 0.2 m apart.
    assert np.median(apart.min(axis=1)) < 2.5


def test_a_size_that_somebody_measured_is_no_unknown():
    measured = Pitch(101, 68)
    _, frames = film(measured, laid())
    found = find_tripod_pitch(frames, SIZE, measured, POLICY)
    assert found is not None
    assert found.pitch == measured and found.are_sizes_known == (False, False)


def test_too_few_frames_and_frames_of_several_places_show_none():
    _, frames = film(PLAN, laid())
    assert find_tripod_pitch(frames[:2], SIZE, PLAN, POLICY) is None
    rng = np.random.default_rng(1)
    moved = posed(5)
    moved[X] += 8
    frames[3] = painted(moved, PLAN, laid(), rng)
    assert find_tripod_pitch(frames, SIZE, PLAN, POLICY) is None


def test_frames_that_turn_past_half_a_circle_are_one_tripod():
    _, frames = film(Pitch(103, 68), laid())
    turned = [replace(frame, parameters=frame.parameters.copy()) for frame in frames]
    turned[2].parameters[PAN] += 2 * np.pi
    one, other = shown_by(frames), shown_by(turned)
    assert one.pitch.length == pytest.approx(other.pitch.length, abs=0.01)
