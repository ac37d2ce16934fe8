"""Snap: a camera drawn onto the paint that its picture shows.

The camera at hand says where each marking should be; paint is sought there, first far to either
side and then ever closer, and the camera is moved onto what is found. Clicks, or any other
start, say which line is which; the paint decides where it lies.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from app.geometry.arrays import BoolArray, FloatArray
from app.geometry.camera import Camera
from app.geometry.resection import camera_from_parameters, parameters_from_camera
from app.paint.evidence import (
    SPACING_PX,
    DetectedPaint,
    Image,
    PreparedPicture,
    find_paint,
    prepare_picture,
    trace_visible_markings,
)
from app.soccer.frames import Box, ImageSize
from app.soccer.paint_evidence import NO_PAINT, PAINT_DISAGREES
from app.soccer.pitch import CIRCLES, MARKINGS, Pitch
from app.soccer.policy import CalibrationPolicy
from app.solving.paint_camera import MOST_SURPRISING, WORST_PX, PaintProblem
from app.solving.paint_noise import PaintOffsets
from app.solving.resect import ResectionProblem

WINDOWS = (10.0, 8.0, 6.0, 5.0, 4.0, 3.0, 3.0)
"""Pixels at 960 x 540 that paint is sought to either side, round by round."""
STRICT_ROUNDS = 3
"""In the last rounds what lies far off counts little."""
COARSE_PX = 8.0
"""Pixels between the places of the first rounds."""
LEAST_POINTS, LEAST_MARKINGS = 24, 3
"""Fewer points of paint, or markings with ``LEAST_ON_MARKING``, determine no camera, however far apart they lie."""
LEAST_ON_MARKING = 4
LEAST_ON_CIRCLE = 60
"""Places of a circle, ``SPACING_PX`` apart, from which on it tells as much as two lines."""
CURVED = [MARKINGS.index(name) for name in sorted(CIRCLES)]
LEAST_SEEN = 0.2
"""Of the visible markings: where less shows paint, chance decides what the rest is."""
KEPT_SHARE = 0.9
"""Paint disagrees, too, where fewer places show paint than before."""
START_SIGMAS, START_PX = 4.0, 2.0
"""A start that is known is not sought farther off than so many of its sigmas, and pixels more."""


@dataclass(frozen=True)
class SnappedCamera:
    """A camera after snapping.

    Attributes:
        camera: On the paint; the start where ``reason`` says why.
        evidence: The paint at the end, marking by marking.
        error_px: Median distance of the paint to its marking, pixels; None without paint.
        covariance: Of the camera's parameters (``geometry.resection``), shape (8, 8); None where
            the paint does not determine them. It knows that no pitch is quite the plan.
        moved_px: Median distance that the visible markings moved, or would have, pixels.
        reason: ``no_paint`` where too little is seen, ``paint_disagrees`` where it contradicts
            the start or itself; None where the camera is the paint's.
        size: Height and width of the picture, pixels.
        planned: The same if the pitch was, which is what the paint itself leaves open.
    """

    camera: Camera
    evidence: DetectedPaint
    error_px: float | None
    covariance: FloatArray | None
    moved_px: float
    reason: str | None
    size: tuple[int, int]
    planned: FloatArray | None = None

    @property
    def point_count(self) -> int:
        """How many places of paint hold the camera."""
        return len(self.evidence.offsets)


def snap_camera(
    image: Image,
    field: BoolArray,
    start: Camera,
    pitch: Pitch | None = None,
    *,
    hidden: Sequence[Box] = (),
    policy: CalibrationPolicy | None = None,
    start_covariance: FloatArray | None = None,
) -> SnappedCamera:
    """The camera that the paint of a picture determines, near a start.

    Args:
        image: Red green blue, shape (H, W, 3).
        field: The field of play (``grass.find_field_of_play``), shape (H, W).
        start: A camera of the picture that is right to about the first window.
        pitch: The pitch.
        hidden: Boxes in which nothing is believed, pixels.
        policy: Prior of the distortion.
        start_covariance: How well the start is known, where it is known, shape (8, 8).
    """
    reading = prepare_picture(image, field, hidden)
    return snap_to_prepared_picture(
        reading, start, pitch or Pitch(), WINDOWS, policy or CalibrationPolicy(), start_covariance
    )


def snap_to_prepared_picture(
    reading: PreparedPicture,
    start: Camera,
    pitch: Pitch,
    windows: Sequence[float],
    policy: CalibrationPolicy,
    start_covariance: FloatArray | None = None,
    circles_count_twice: bool = False,
    position_is_known: bool = False,
    most_surprising: float = MOST_SURPRISING,
) -> SnappedCamera:
    """As ``snap_camera``, for a picture that is prepared already.

    Args:
        windows: How far to either side paint is sought, round by round, pixels at 960 x 540.
        circles_count_twice: A circle of which much is seen stands for two markings, as it tells
            as much as two lines: with the middle line it determines a camera.
        position_is_known: Whether the start's covariance knows where the camera stands: that
            stands for a marking, as two lines then tell where it looks and how far it zooms.
        most_surprising: How far the camera may leave a start that is known, squared sigmas.
    """
    least = LEAST_MARKINGS - position_is_known
    problem = ResectionProblem.of(ImageSize(reading.width, reading.height), policy)
    twice = CURVED if circles_count_twice else []
    rounds = _SnapProblem(reading, start, pitch, problem, start_covariance)
    parameters = rounds.first
    for index, window in enumerate(windows):
        strict = index >= len(windows) - STRICT_ROUNDS
        spacing = SPACING_PX if strict else COARSE_PX
        evidence = rounds.find_paint_near(parameters, window, spacing)
        if not _has_enough_paint(evidence, twice, spacing, least):
            return _keep_start(rounds, evidence, NO_PAINT)
        parameters = parameters + rounds.problem.compute_step(
            parameters, rounds.to_paint_offsets(evidence), strict
        )
        if not np.isfinite(parameters).all():
            return _keep_start(rounds, evidence, PAINT_DISAGREES)
    evidence = rounds.find_paint_near(parameters, windows[-1])
    if (
        not _has_enough_paint(evidence, twice, least=least)
        or evidence.painted_fraction < LEAST_SEEN
    ):
        return _keep_start(rounds, evidence, NO_PAINT)
    places = evidence.traced.places[:, :2]
    noise = rounds.problem.noise(parameters, rounds.to_paint_offsets(evidence), places, pitch)
    if noise is None:
        return _keep_start(rounds, evidence, NO_PAINT)
    camera, before = rounds.camera(parameters), rounds.find_paint_near(rounds.first, windows[-1])
    error, moved = (
        float(np.median(np.abs(evidence.offsets))),
        _median_shift_px(start, camera, evidence),
    )
    if (
        error > rounds.unit * WORST_PX
        or moved > rounds.unit * (windows[0] if start_covariance is None else np.inf)
        or rounds.problem.mahalanobis_squared(parameters) > most_surprising
        or evidence.painted_fraction < KEPT_SHARE * before.painted_fraction
    ):
        return _keep_start(rounds, evidence, PAINT_DISAGREES, error, moved)
    own, size = noise.parameters, rounds.size
    return SnappedCamera(camera, evidence, error, own + noise.pitch, moved, None, size, planned=own)


class _SnapProblem:
    """What all rounds of one snap share."""

    def __init__(
        self,
        reading: PreparedPicture,
        start: Camera,
        pitch: Pitch,
        resection: ResectionProblem,
        covariance: FloatArray | None,
    ):
        self._reading, self.start, self._pitch = reading, start, pitch
        self.first = parameters_from_camera(start, reading.half_diagonal)
        self.problem = PaintProblem.of(resection, self.first, covariance)
        self._covariance = covariance
        self.size = reading.height, reading.width
        self.unit = self.problem.pixels_per_reference_pixel

    def camera(self, parameters: FloatArray) -> Camera:
        return camera_from_parameters(
            parameters, self.start.principal_point, self._reading.half_diagonal
        )

    def find_paint_near(
        self, parameters: FloatArray, window: float, spacing: float = SPACING_PX
    ) -> DetectedPaint:
        traced = trace_visible_markings(
            self._reading, self.camera(parameters), self._pitch, spacing
        )
        window *= self.unit
        if self._covariance is None:
            return find_paint(self._reading, traced, window)
        rows = traced.jacobian
        sigma = np.sqrt(np.maximum(((rows @ self._covariance) * rows).sum(axis=1), 0.0))
        known = START_SIGMAS * sigma + START_PX * self.unit
        return find_paint(self._reading, traced, np.minimum(window, known))

    def to_paint_offsets(self, evidence: DetectedPaint) -> PaintOffsets:
        """The evidence as it is solved with."""
        traced = evidence.traced
        apart = (traced.pixels - self.start.principal_point) / self._reading.half_diagonal
        return PaintOffsets(
            evidence.offsets,
            evidence.sigmas,
            traced.marking,
            traced.jacobian,
            np.hypot(*apart.T),
        )


def _has_enough_paint(
    evidence: DetectedPaint,
    twice: list[int],
    spacing: float = SPACING_PX,
    least: int = LEAST_MARKINGS,
) -> bool:
    counts = np.bincount(evidence.traced.marking, minlength=len(MARKINGS))
    markings = int((counts >= LEAST_ON_MARKING).sum())
    markings += int((counts[twice] * spacing >= LEAST_ON_CIRCLE * SPACING_PX).sum())
    return len(evidence.offsets) >= LEAST_POINTS and markings >= least


def _keep_start(
    rounds: _SnapProblem,
    evidence: DetectedPaint,
    reason: str,
    error: float | None = None,
    moved: float = 0.0,
) -> SnappedCamera:
    """The start, with why it was kept and what snapping would have done."""
    return SnappedCamera(rounds.start, evidence, error, None, moved, reason, rounds.size)


def _median_shift_px(start: Camera, camera: Camera, evidence: DetectedPaint) -> float:
    places = evidence.traced.places
    apart = np.hypot(*(camera.project(places) - start.project(places)).T)
    known = apart[np.isfinite(apart)]
    return float(np.median(known)) if len(known) else 0.0
