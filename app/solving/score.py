"""Score: how well cameras fit the annotated lines of many frames, and a marking that they were not shown."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass

import numpy as np

from app.geometry.camera import Camera
from app.soccer.annotation import Lines, make_lines
from app.soccer.frames import ImageSize
from app.soccer.pitch import Pitch
from app.soccer.policy import CalibrationPolicy
from app.soccer.solution import GAMMAS_PERCENT
from app.solving.calibrate import calibrate
from app.solving.jaccard import (
    camera_jaccard,
    jaccard,
    marking_outcomes,
    measure_markings,
    project_markings,
)
from app.solving.match_position import NO_PLACES, Places, share_position
from app.solving.observations import observations_of_lines
from app.solving.resect import ResectionProblem

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


def leave_one_out(
    lines: Lines,
    pitch: Pitch,
    size: ImageSize,
    policy: CalibrationPolicy,
    others: Places = NO_PLACES,
) -> Iterator[tuple[str, float | None]]:
    """Each marking with the largest distance of its points from where the others put it.

    Args:
        lines: Annotated points by marking, pixels of ``size``.
        pitch: The pitch.
        size: Annotated size.
        policy: How the others are calibrated.
        others: Places of the match's other frames, if its camera's position is shared.

    Yields:
        Marking and pixels; None where the others do not give a camera.
    """
    for marking in lines:
        yield marking, error_without(lines, marking, pitch, size, policy, others)


def error_without(
    lines: Lines,
    marking: str,
    pitch: Pitch,
    size: ImageSize,
    policy: CalibrationPolicy,
    others: Places = NO_PLACES,
) -> float | None:
    """Largest distance of a marking's points from where the others put it, pixels."""
    rest = make_lines({name: points for name, points in lines.items() if name != marking})
    alone = calibrate(rest, pitch, size, policy)
    camera = share_position(alone, others, rest, pitch, size, policy).camera
    if camera is None:
        return None
    problem = ResectionProblem.of(size, policy)
    seen = observations_of_lines(make_lines({marking: lines[marking]}), policy.fitted(pitch), size)
    return float(problem.distances(problem.parameters(camera), seen).max())
