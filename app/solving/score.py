"""Score: how well cameras fit the annotated lines of many frames."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np

from app.geometry.camera import Camera
from app.soccer.annotation import Lines
from app.soccer.frames import ImageSize
from app.soccer.pitch import Pitch
from app.soccer.solution import GAMMAS_PERCENT
from app.solving.jaccard import (
    camera_jaccard,
    jaccard,
    marking_outcomes,
    measure_markings,
    project_markings,
)

SHARE_ABOVE = 0.75
CHALLENGE_PX = 5.0
"""Threshold of the sn-calibration challenge."""


@dataclass(frozen=True)
class FrameScore:
    """One camera against the lines of its frame.

    Attributes:
        jac: At each of ``GAMMAS_PERCENT``.
        challenge: JaC at 5 px, the better of the labels as given and turned by 180 degrees.
        distances_px: Of the annotated points whose marking is visible.
    """

    jac: tuple[float, ...]
    challenge: float
    distances_px: tuple[float, ...]


@dataclass(frozen=True)
class Score:
    """Many frames together; a frame without a camera counts as 0 everywhere."""

    frames: int
    calibrated: int
    jac: tuple[float, ...]
    share: float
    challenge: float
    error_median_px: float | None
    error_p95_px: float | None

    @property
    def completeness(self) -> float:
        """Share of the frames that have a camera."""
        return self.calibrated / self.frames if self.frames else 0.0


def score_frame(camera: Camera, lines: Lines, pitch: Pitch, size: ImageSize) -> FrameScore:
    """One camera against the lines of its frame, pixels of ``size``."""
    pitch = pitch.with_goal("inner")
    measured = measure_markings(project_markings(camera, pitch, size), lines)
    jac = tuple(
        jaccard(marking_outcomes(measured, lines, gamma / 100 * size.diagonal))
        for gamma in GAMMAS_PERCENT
    )
    (challenge,) = camera_jaccard(camera, lines, pitch, size, (CHALLENGE_PX,), symmetric=True)
    distances = tuple(
        distance for seen in measured.values() for distance in seen.distances.tolist()
    )
    return FrameScore(jac, challenge, distances)


def score_frames(frames: Iterable[FrameScore | None]) -> Score:
    """Many frames together; None stands for a frame without a camera."""
    every = list(frames)
    found = [frame for frame in every if frame is not None]
    count = max(len(every), 1)
    jac = np.array([frame.jac for frame in found]).reshape(-1, len(GAMMAS_PERCENT))
    distances = np.array([distance for frame in found for distance in frame.distances_px])
    median, p95 = np.percentile(distances, [50, 95]).tolist() if len(distances) else (None, None)
    return Score(
        frames=len(every),
        calibrated=len(found),
        jac=tuple((jac.sum(axis=0) / count).tolist()),
        share=float((jac[:, 0] > SHARE_ABOVE).sum() / count),
        challenge=sum(frame.challenge for frame in found) / count,
        error_median_px=median,
        error_p95_px=p95,
    )
