"""Pitch size: length and width of a match's pitch, estimated from many of its frames.

One frame cannot tell a longer pitch from another camera; many frames of the same pitch can. The
robust cost of all frames, each with its own best camera, is nearly a parabola in length and
width: it is sampled on a small grid, and its minimum is where the grid is laid next.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from app.errors import DegenerateGeometryError
from app.geometry.arrays import FloatArray
from app.soccer.annotation import Lines
from app.soccer.frames import ImageSize
from app.soccer.pitch import LENGTH_RANGE, WIDTH_RANGE, Pitch
from app.soccer.policy import CalibrationPolicy
from app.solving.observations import Observations, observe, pitch_curves
from app.solving.resect import Resection, ResectionProblem, measurement_count

MIN_FRAMES = 5
MIN_MEASUREMENTS = 12
"""Frames with fewer say nothing about the pitch that they do not need for their camera."""
KEPT_SHARE = 0.8
_GRID_STEPS_M = (1.0, 0.25)
_MAX_ROUNDS = 12
_OFFSETS = np.array([(x, y) for x in (-1.0, 0.0, 1.0) for y in (-1.0, 0.0, 1.0)])


@dataclass(frozen=True)
class PitchEstimate:
    """An estimated pitch.

    Attributes:
        pitch: The pitch.
        length_sigma_m: Standard deviation of the length; ``width_sigma_m`` of the width.
        frames: Number of frames that it rests on.
    """

    pitch: Pitch
    length_sigma_m: float
    width_sigma_m: float
    frames: int


def estimate_pitch(
    frames: Sequence[Lines], size: ImageSize, policy: CalibrationPolicy, start: Pitch | None = None
) -> PitchEstimate:
    """The size of the pitch that explains the lines of many frames best.

    Args:
        frames: Annotated points by marking, pixels of ``size``; frames of one match.
        size: Annotated size.
        policy: How frames are calibrated.
        start: Where to begin, 105 x 68 m by default.

    Raises:
        DegenerateGeometryError: Too few frames, or none shows enough of length or width.
    """
    pitch = start or Pitch()
    problem = ResectionProblem.of(size, policy)
    for step in _GRID_STEPS_M:
        for _ in range(_MAX_ROUNDS):
            seen = _sound_frames(frames, pitch, problem)
            costs = [_total_cost(seen, _moved(pitch, at * step), problem) for at in _OFFSETS]
            shift, curvature = _parabola(_OFFSETS * step, np.array(costs))
            pitch = _moved(pitch, np.clip(shift, -2 * step, 2 * step))
            if np.abs(shift).max() < step:
                break
    points = sum(len(observations.pixels) for observations, _ in seen)
    variance = 2 * _total_cost(seen, pitch, problem) / points
    spread = variance * np.linalg.inv(curvature)
    return PitchEstimate(
        pitch, float(np.sqrt(spread[0, 0])), float(np.sqrt(spread[1, 1])), len(seen)
    )


def _sound_frames(
    frames: Sequence[Lines], pitch: Pitch, problem: ResectionProblem
) -> list[tuple[Observations, Resection]]:
    """Frames with markings to spare, without the fifth that fits worst.

    Labels are not checked here: on a pitch of the wrong size the touchlines look mislabelled.

    Raises:
        DegenerateGeometryError: Too few are left.
    """
    observed = [observe(lines, pitch, problem.size) for lines in frames]
    rich = [item for item in observed if measurement_count(item) >= MIN_MEASUREMENTS]
    fitted = [(item, problem.resect(item)) for item in rich]
    fitted.sort(key=lambda item: item[1].cost / len(item[0].pixels))
    if len(fitted) < MIN_FRAMES:
        raise DegenerateGeometryError(
            f"{len(fitted)} frames show enough markings, the size of a pitch needs {MIN_FRAMES}"
        )
    return fitted[: math.ceil(KEPT_SHARE * len(fitted))]


def _total_cost(
    seen: Sequence[tuple[Observations, Resection]], pitch: Pitch, problem: ResectionProblem
) -> float:
    """Robust cost of all frames on this pitch, each with its best camera."""
    curves = pitch_curves(pitch)
    total = 0.0
    for observations, fit in seen:
        moved = Observations(curves, observations.pixels, observations.marking)
        total += problem.refine(moved, fit.parameters[None]).cost
    return total


def _parabola(offsets: FloatArray, costs: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Minimum and second derivatives of the parabola through samples of a cost.

    Raises:
        DegenerateGeometryError: The cost does not curve upwards in both directions.
    """
    x, y = offsets.T
    terms = np.column_stack([np.ones_like(x), x, y, x * x / 2, x * y, y * y / 2])
    _, by_x, by_y, xx, xy, yy = np.linalg.lstsq(terms, costs, rcond=None)[0]
    curvature = np.array([[xx, xy], [xy, yy]])
    if np.linalg.eigvalsh(curvature)[0] <= 0:
        raise DegenerateGeometryError("the frames do not show both length and width of the pitch")
    return np.linalg.solve(curvature, [-by_x, -by_y]), curvature


def _moved(pitch: Pitch, by: FloatArray) -> Pitch:
    """The pitch with another length and width, within the Laws of the Game."""
    return Pitch(
        float(np.clip(pitch.length + by[0], *LENGTH_RANGE)),
        float(np.clip(pitch.width + by[1], *WIDTH_RANGE)),
    )
