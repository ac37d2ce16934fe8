"""JaC, the Jaccard index for camera calibration.

Numbers equal those of the public sn-calibration evaluator: a marking that is annotated and
visible counts as found when every annotated point lies closer than gamma to its projection.

Source: SoccerNet-v3D (arXiv 2504.10106), JaC; Magera et al., "A universal protocol to benchmark
camera calibration for sports", 2024.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping
from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from app.geometry.arrays import FloatArray
from app.geometry.camera import Camera
from app.geometry.polyline import clip_polyline, distance_to_polyline, is_inside_image
from app.soccer.annotation import Lines
from app.soccer.frames import ImageSize
from app.soccer.pitch import GOAL_PARTS, MARKINGS, Pitch, opposite_marking

SPACING_M = 0.9
CIRCLE_SPACING_M = 0.2

TRUE_POSITIVE, FALSE_POSITIVE, FALSE_NEGATIVE = "tp", "fp", "fn"


@dataclass(frozen=True)
class ProjectedMarking:
    """A marking as the camera sees it, with the annotation measured against it.

    Attributes:
        polyline: Pixels, clipped at the border, shape (M, 2).
        distances: Of the annotated points, pixels, shape (N,); empty when not annotated.
        nearest: Nearest places on the polyline, shape (N, 2).
    """

    polyline: FloatArray
    distances: FloatArray
    nearest: FloatArray

    @property
    def length(self) -> float:
        """Of the polyline, pixels."""
        return float(np.hypot(*np.diff(self.polyline, axis=0).T).sum())


def project_markings(
    camera: Camera, pitch: Pitch, size: ImageSize, names: tuple[str, ...] = MARKINGS
) -> dict[str, FloatArray]:
    """The visible markings as clipped polylines, in the order of ``MARKINGS``.

    Args:
        camera: In the pitch frame.
        pitch: Its size, metres.
        size: Of the picture, pixels.
        names: The markings to look for.

    Returns:
        Of each marking that is seen its places in the picture, pixels, shape (N, 2).
    """
    samples, limits = _sample_markings(pitch, names)
    pixels = camera.project(samples, folded=True)
    seen = is_inside_image(pixels, size.width, size.height)
    return {
        marking: clip_polyline(pixels[first:last], size.width, size.height)
        for marking, first, last in limits
        if seen[first:last].any()
    }


def measure_markings(projected: dict[str, FloatArray], lines: Lines) -> dict[str, ProjectedMarking]:
    """Each visible marking with the distances of its annotated points, pixels.

    Args:
        projected: Of ``project_markings``: a polyline, shape (N, 2), for each visible marking.
        lines: The annotated points of each marking, pixels.
    """
    measured = {}
    for marking, polyline in projected.items():
        apart, nearest = np.empty(0), np.empty((0, 2))
        if lines.get(marking):
            apart, nearest = distance_to_polyline(np.array(lines[marking]), polyline)
        measured[marking] = ProjectedMarking(polyline, apart, nearest)
    return measured


def project_markings_like_evaluator(
    camera: Camera,
    pitch: Pitch,
    size: ImageSize,
    lines: Lines,
    measured: Mapping[str, ProjectedMarking],
) -> dict[str, ProjectedMarking]:
    """Visible markings as the public evaluator has them: inner edges of goals, lines of the plan.

    Args:
        camera: In the pitch frame.
        pitch: The pitch with the goals and lines that ``measured`` is about.
        size: Of the picture, pixels.
        lines: The annotated points of each marking, pixels.
        measured: Of ``measure_markings`` for that pitch.
    """
    judged = pitch.with_goal_edge("inner")
    if judged == pitch:
        return dict(measured)
    others = MARKINGS if pitch.goal == "laws" else GOAL_PARTS
    projected = project_markings(camera, judged, size, others)
    again = measure_markings(projected, lines)
    both = {name: one for name, one in measured.items() if name not in others} | again
    return {name: both[name] for name in MARKINGS if name in both}


def classify_markings(
    measured: dict[str, ProjectedMarking], lines: Lines, gamma_px: float
) -> dict[str, str]:
    """The class of each marking at a threshold: ``tp``, ``fp`` or ``fn``."""
    result = {}
    for marking in MARKINGS:
        annotated = bool(lines.get(marking))
        if marking in measured:
            close = annotated and bool(np.all(measured[marking].distances < gamma_px))
            result[marking] = TRUE_POSITIVE if close else FALSE_POSITIVE
        elif annotated:
            result[marking] = FALSE_NEGATIVE
    return result


def find_unannotated_not_missing(
    measured: dict[str, ProjectedMarking],
    lines: Lines,
    not_visible: Collection[str],
    shortest_px: float,
) -> frozenset[str]:
    """Visible markings that nobody annotated and that are not counted as missing.

    The public evaluator counts every one: this is for curation alone.

    Args:
        measured: The visible markings.
        lines: Annotated points by marking.
        not_visible: Markings that a person says the picture does not show.
        shortest_px: A shorter stub is none that people draw; 0: each is.
    """
    return frozenset(
        marking
        for marking, seen in measured.items()
        if not lines.get(marking) and (marking in not_visible or seen.length < shortest_px)
    )


def jaccard(found: dict[str, str]) -> float:
    """TP / (TP + FN + FP); 0 when nothing is visible and nothing annotated."""
    if not found:
        return 0.0
    return sum(outcome == TRUE_POSITIVE for outcome in found.values()) / len(found)


def camera_jaccard(
    camera: Camera,
    lines: Lines,
    pitch: Pitch,
    size: ImageSize,
    gammas_px: tuple[float, ...],
    *,
    symmetric: bool = False,
) -> tuple[float, ...]:
    """JaC of a camera at each threshold, by the evaluator's goals whatever those of the pitch.

    Args:
        camera: The camera to measure.
        lines: Annotated points by marking, pixels.
        pitch: The pitch.
        size: Annotated size.
        gammas_px: Thresholds, pixels.
        symmetric: Benchmark mode: the better of the labels as given and turned by 180 degrees.
            Never for curation, where a wrong side is an error to be found.
    """
    projected = project_markings(camera, pitch.with_goal_edge("inner"), size)
    measured = measure_markings(projected, lines)
    values = tuple(jaccard(classify_markings(measured, lines, gamma)) for gamma in gammas_px)
    if not symmetric:
        return values
    turned: Lines = {opposite_marking(marking): points for marking, points in lines.items()}
    measured = measure_markings(projected, turned)
    twins = (jaccard(classify_markings(measured, turned, gamma)) for gamma in gammas_px)
    return tuple(max(pair) for pair in zip(values, twins, strict=True))


@lru_cache(maxsize=8)
def _sample_markings(
    pitch: Pitch, names: tuple[str, ...] = MARKINGS
) -> tuple[FloatArray, tuple[tuple[str, int, int], ...]]:
    parts, limits, count = [], [], 0
    for marking in names:
        part = pitch.sample(marking, SPACING_M, CIRCLE_SPACING_M)
        parts.append(part)
        limits.append((marking, count, count + len(part)))
        count += len(part)
    return np.vstack(parts), tuple(limits)
