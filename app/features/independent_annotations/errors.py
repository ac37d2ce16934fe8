"""Errors of an annotation against the truth: pixels of lines and balls, metres of the 3D ball."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from app.geometry.arrays import FloatArray
from app.geometry.camera import Camera
from app.soccer.frames import ImagePoint
from app.soccer.group import Group, View
from app.solving.jaccard import measure_markings, project_markings

Point3 = tuple[float, float, float]


@dataclass(frozen=True)
class DistanceFromTruth:
    """How far an annotation is from the truth.

    Attributes:
        line_px: Median over the markings that both have of their mean distance, pixels of the
            annotated size; None: they have none in common.
        lines_missing: Markings that the truth has and the annotation has not.
        ball_px: The largest distance of the two balls' centres over the views; None: there is no
            view in which both have one.
        balls_missing: Views in which one of the two has a ball and the other has none.
        ball_m: Distance of the 3D balls, metres; None: one of them has none.
    """

    line_px: float | None
    lines_missing: int
    ball_px: float | None
    balls_missing: int
    ball_m: float | None


def distance_from_truth(
    truth: Group, annotated: Group, ball: Point3 | None, own: Point3 | None
) -> DistanceFromTruth:
    """The error of an annotation; views are those of the truth that the annotation has, too.

    Args:
        truth: What is true.
        annotated: What somebody annotated; its views have the keys of the truth's.
        ball: The true 3D ball, pitch frame, metres.
        own: The 3D ball of the annotation.
    """
    pairs = [
        (view, other) for view in truth.views if (other := annotated.view(view.key)) is not None
    ]
    lines = [distance for view, other in pairs for distance in _line_distances(view, other)]
    missing = sum(len({*view.station.lines} - {*other.station.lines}) for view, other in pairs)
    centers = [(_ball_center(view), _ball_center(other)) for view, other in pairs]
    balls = [float(np.hypot(a.x - b.x, a.y - b.y)) for a, b in centers if a and b]
    return DistanceFromTruth(
        line_px=float(np.median(lines)) if lines else None,
        lines_missing=missing,
        ball_px=max(balls) if balls else None,
        balls_missing=sum((a is None) != (b is None) for a, b in centers),
        ball_m=None
        if ball is None or own is None
        else float(np.linalg.norm(np.subtract(ball, own))),
    )


@dataclass(frozen=True)
class TrueView:
    """What is true of a view whose world is known: its camera, and where its ball is, in pixels."""

    camera: Camera
    center: ImagePoint


def world_error(
    truth: Group,
    views: Mapping[str, TrueView],
    annotated: Group,
    ball: Point3,
    own: Point3 | None,
) -> DistanceFromTruth:
    """The error of an annotation against the true cameras and ball, and nobody's annotation.

    A marking's distance is the mean of its annotated points' from where the true camera shows it;
    one that the true camera does not show is not measured.

    Args:
        truth: The group with its usual annotation, which says what is to be drawn.
        views: The true views by key; others are not measured.
        annotated: What somebody annotated; its views have the keys of the truth's.
        ball: The true 3D ball, pitch frame, metres.
        own: The 3D ball of the annotation.
    """
    seen = [
        (view, other, views[view.key])
        for view in truth.views
        if view.key in views and (other := annotated.view(view.key)) is not None
    ]
    lines: list[float] = []
    for _, other, known in seen:
        projected = project_markings(known.camera, truth.pitch, other.size)
        measured = measure_markings(projected, other.station.lines).values()
        lines += [float(one.distances.mean()) for one in measured if one.distances.size]
    centers = [(_ball_center(other), known.center) for _, other, known in seen]
    balls = [float(np.hypot(a.x - b.x, a.y - b.y)) for a, b in centers if a is not None]
    return DistanceFromTruth(
        line_px=float(np.median(lines)) if lines else None,
        lines_missing=sum(
            len({*view.station.lines} - {*other.station.lines}) for view, other, _ in seen
        ),
        ball_px=max(balls) if balls else None,
        balls_missing=sum(
            _ball_center(view) is not None and _ball_center(other) is None
            for view, other, _ in seen
        ),
        ball_m=None if own is None else float(np.linalg.norm(np.subtract(ball, own))),
    )


def _ball_center(view: View) -> ImagePoint | None:
    return next((center for ball in view.balls if (center := ball.center) is not None), None)


def _line_distances(view: View, other: View) -> list[float]:
    """Mean distance of each marking that both have, from either to the other, pixels."""
    mine, theirs = view.station.lines, other.station.lines
    return [polyline_distance(mine[name], theirs[name]) for name in mine if name in theirs]


def polyline_distance(one: tuple[ImagePoint, ...], other: tuple[ImagePoint, ...]) -> float:
    """Mean distance of the points of two polylines from the other one, pixels.

    Both ways, so that neither a short piece of a long line nor the long line is nearer.
    """
    a, b = (np.array([(p.x, p.y) for p in points], dtype=float) for points in (one, other))
    return float(
        np.concatenate([_distances_from_polyline(a, b), _distances_from_polyline(b, a)]).mean()
    )


def _distances_from_polyline(points: FloatArray, line: FloatArray) -> FloatArray:
    """Distance of points (n, 2) from a polyline (m, 2); one point is a polyline, too."""
    if len(line) == 1:
        alone: FloatArray = np.linalg.norm(points - line, axis=1)
        return alone
    start, step = line[:-1], np.diff(line, axis=0)
    length = np.maximum((step**2).sum(1), 1e-12)
    share = ((points[:, None] - start) * step).sum(2) / length
    foot = start + np.clip(share, 0, 1)[..., None] * step
    distances: FloatArray = np.linalg.norm(points[:, None] - foot, axis=2).min(1)
    return distances
