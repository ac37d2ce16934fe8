"""Annotation distance: how far two people's annotations of one group lie apart, and how far one is from the truth.

Lines and balls are compared in pixels, view by view, 3D balls and cameras in metres. Nothing here
says who is right: every number is the same when both change places, but those that say a side.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np
from scipy.special import chdtrc

from app.geometry.arrays import FloatArray
from app.geometry.camera import Camera
from app.geometry.polyline import distance_to_polyline, trace_ellipse_arc
from app.soccer.annotation import BallAnnotation, Lines
from app.soccer.frames import ImagePoint
from app.soccer.group import Group, View
from app.soccer.pitch import CIRCLES
from app.soccer.solution import GAMMAS_PERCENT, Ball3D, Calibration, Solution
from app.solving.jaccard import camera_jaccard, measure_markings, project_markings

EXPLAINED_P = 0.05
"""A difference with a smaller p-value is larger than both uncertainties explain."""

Side = Literal["a", "b"]
"""The two whose annotations are compared."""
BallState = Literal["seen", "occluded", "out_of_view", "none", "several"]
"""How somebody saw the ball of a view."""


@dataclass(frozen=True)
class LineDistance:
    """One marking of one view as two people drew it.

    Attributes:
        only: ``a`` or ``b`` where only that one drew it, else None.
        mean_px: Mean distance of the points of each from the line of the other, both ways;
            None where only one drew it.
        largest_px: The largest of them.
    """

    marking: str
    only: Side | None = None
    mean_px: float | None = None
    largest_px: float | None = None


@dataclass(frozen=True)
class BallDistance:
    """The ball of one view as two people saw it.

    Attributes:
        a: ``seen``, ``occluded``, ``out_of_view``, ``none`` or ``several``; ``b`` likewise.
        center_px: Distance of both centres; None unless both have one ball with a place.
        diameter_px: Difference of both diameters, b less a; None unless both drew boxes.
    """

    a: BallState
    b: BallState
    center_px: float | None = None
    diameter_px: float | None = None

    @property
    def is_same_state(self) -> bool:
        """Whether both say the same of whether the ball is to be seen."""
        return self.a == self.b


@dataclass(frozen=True)
class ViewDistance:
    """One view.

    Attributes:
        view: Its key.
        included: Whether each of a and b left it in the group.
        lines: Markings that either drew, by name.
        jac: JaC of a's camera with b's lines, and of b's camera with a's, at 0.5 % of
            the diagonal; None where there is no camera or no line.
        position_m: Between both cameras; None where either is missing.
    """

    view: str
    included: tuple[bool, bool]
    lines: tuple[LineDistance, ...]
    ball: BallDistance
    jac: tuple[float | None, float | None]
    position_m: float | None

    @property
    def largest_px(self) -> float:
        """The largest distance of a line or the ball; 0 where nothing was drawn twice."""
        found = [line.largest_px for line in self.lines] + [self.ball.center_px]
        return max((value for value in found if value is not None), default=0.0)

    @property
    def lowest_jac(self) -> float | None:
        """The lower of both JaC; None where there is none."""
        return min((value for value in self.jac if value is not None), default=None)


@dataclass(frozen=True)
class Ball3DDistance:
    """Both 3D balls.

    Attributes:
        a: Whether a has one; ``b`` likewise.
        distance_m: Between them; None unless both have one.
        sigmas_m: Of each, along its longest axis.
        p_value: How often chance alone would put them as far apart, were both uncertainties
            true and independent; None where they are not known.
    """

    a: bool
    b: bool
    distance_m: float | None = None
    sigmas_m: tuple[float | None, float | None] = (None, None)
    p_value: float | None = None

    @property
    def is_explained(self) -> bool | None:
        """Whether both uncertainties explain the difference; None where that is not known."""
        return None if self.p_value is None else self.p_value >= EXPLAINED_P


@dataclass(frozen=True)
class GroupDistance:
    """Two annotations of one group."""

    views: tuple[ViewDistance, ...]
    ball: Ball3DDistance


def compare_annotations(
    a: Group, b: Group, solution_a: Solution | None, solution_b: Solution | None
) -> GroupDistance:
    """Two annotations of the same frames, view by view in the order of ``a``.

    Args:
        a: One person's group.
        b: The other's; views are known by their keys, one that either lacks is left out.
        solution_a: Of a; None while it is not computed.
        solution_b: Of b.
    """
    views = []
    for first in a.views:
        second = b.view(first.key)
        if second is not None:
            cameras = (
                _find_view_calibration(solution_a, first.key),
                _find_view_calibration(solution_b, first.key),
            )
            views.append(_compare_views(first, second, (a, b), cameras))
    ball_a = None if solution_a is None else solution_a.ball
    ball_b = None if solution_b is None else solution_b.ball
    return GroupDistance(tuple(views), compare_balls_3d(ball_a, ball_b))


def compare_lines(a: Lines, b: Lines) -> tuple[LineDistance, ...]:
    """Every marking that either drew, by name.

    The distance goes from the points of each to the polyline of the other, of a circle also to the
    arc of the ellipse on which the other's points lie: what is nearer counts. Points beyond the other's ends do not count: how long a line is drawn does not say where it lies.
    """
    found = []
    for marking in sorted({*a, *b}):
        first, second = _get_marking_points(a, marking), _get_marking_points(b, marking)
        if not len(first) or not len(second):
            only: Side = "a" if len(first) else "b"
            if len(first) or len(second):
                found.append(LineDistance(marking, only))
            continue
        there, back = (
            _measure_distances_within_line_ends(first, _list_lines(second, marking)),
            _measure_distances_within_line_ends(second, _list_lines(first, marking)),
        )
        if not len(there) + len(back):
            # Drawn one behind the other: what is left is how far apart they are.
            there = distance_to_polyline(first, second)[0]
            back = distance_to_polyline(second, first)[0]
        means = [float(part.mean()) for part in (there, back) if len(part)]
        largest = float(np.concatenate([there, back]).max())
        found.append(LineDistance(marking, None, sum(means) / len(means), largest))
    return tuple(found)


def compare_balls(a: tuple[BallAnnotation, ...], b: tuple[BallAnnotation, ...]) -> BallDistance:
    """The balls of one view, in its pixels; several on either side are not told apart.

    The distance is that of the centres; the difference of diameters is ``b`` less ``a``, None
    where either is a point without a box.
    """
    states = classify_ball_state(a), classify_ball_state(b)
    places = [_find_only_visible_ball(a), _find_only_visible_ball(b)]
    first, second = places
    if first is None or second is None:
        return BallDistance(*states)
    (center_a, diameter_a), (center_b, diameter_b) = first, second
    apart = math.dist(center_a, center_b)
    wider = None if diameter_a is None or diameter_b is None else diameter_b - diameter_a
    return BallDistance(*states, apart, wider)


def compare_balls_3d(a: Ball3D | None, b: Ball3D | None) -> Ball3DDistance:
    """Two triangulated balls, pitch frame, and whether their covariances explain the difference.

    With d the difference and S the sum of both covariances, d' S^-1 d has a chi-square
    distribution of three degrees of freedom if both are right and independent (Hartley &
    Zisserman, A2.1). They share their frames and what the policy assumes of them, so a
    difference that is not explained is one between the people.
    """
    sigmas = (None if a is None else a.sigma_m, None if b is None else b.sigma_m)
    if a is None or b is None:
        return Ball3DDistance(a is not None, b is not None, sigmas_m=sigmas)
    step = np.subtract(b.point, a.point)
    spread = np.add(a.covariance, b.covariance).reshape(3, 3)
    p_value: float | None = None
    if np.isfinite(spread).all() and np.linalg.eigvalsh(spread)[0] > 0:
        p_value = float(chdtrc(3, step @ np.linalg.solve(spread, step)))
    return Ball3DDistance(True, True, float(np.linalg.norm(step)), sigmas, p_value)


def classify_ball_state(balls: tuple[BallAnnotation, ...]) -> BallState:
    """What a person says of the ball in a view: ``seen``, ``occluded``, ``out_of_view``, ..."""
    seen = [ball for ball in balls if not ball.out_of_view]
    if len(seen) > 1:
        return "several"
    if seen:
        return "occluded" if seen[0].occluded else "seen"
    return "out_of_view" if balls else "none"


def _compare_views(
    a: View, b: View, groups: tuple[Group, Group], found: tuple[Calibration | None, ...]
) -> ViewDistance:
    cameras = [None if item is None else item.camera for item in found]
    position = None
    if cameras[0] is not None and cameras[1] is not None:
        position = float(np.linalg.norm(cameras[0].position - cameras[1].position))
    jac: list[float | None] = []
    for camera, lines, view, group in (
        (cameras[0], b.station.lines, a, groups[0]),
        (cameras[1], a.station.lines, b, groups[1]),
    ):
        if camera is None or not lines:
            jac.append(None)
            continue
        gamma = GAMMAS_PERCENT[0] / 100 * view.size.diagonal
        jac.append(camera_jaccard(camera, lines, group.pitch, view.size, (gamma,))[0])
    return ViewDistance(
        view=a.key,
        included=(a.included, b.included),
        lines=compare_lines(a.station.lines, b.station.lines),
        ball=compare_balls(a.balls, b.balls),
        jac=(jac[0], jac[1]),
        position_m=position,
    )


def _find_view_calibration(solution: Solution | None, view: str) -> Calibration | None:
    found = None if solution is None else solution.view(view)
    return None if found is None else found.calibration


def _get_marking_points(lines: Lines, marking: str) -> FloatArray:
    return np.array(lines.get(marking) or (), dtype=float).reshape(-1, 2)


def _list_lines(points: FloatArray, marking: str) -> list[FloatArray]:
    """Polylines through the points of a marking: of a circle its chords and, where there is one, its arc."""
    arc = trace_ellipse_arc(points) if marking in CIRCLES else None
    return [points] if arc is None else [points, arc]


def _measure_distances_within_line_ends(
    points: FloatArray, lines: Sequence[FloatArray]
) -> FloatArray:
    """Distances of the points that lie beside the nearest of polylines, not beyond its ends, shape (<= N,)."""
    if len(lines[0]) < 2:
        return distance_to_polyline(points, lines[0])[0]
    measured = [distance_to_polyline(points, line) for line in lines]
    apart: FloatArray = np.min([distances for distances, _ in measured], axis=0)
    beyond = np.zeros(len(points), bool)
    for line, (distances, nearest) in zip(lines, measured, strict=True):
        for end, inward in ((line[0], line[1] - line[0]), (line[-1], line[-2] - line[-1])):
            at_end = (distances == apart) & (nearest == end).all(axis=1)
            beyond |= at_end & ((points - end) @ inward < 0)
    return apart[~beyond]


def _find_only_visible_ball(
    balls: tuple[BallAnnotation, ...],
) -> tuple[tuple[float, float], float | None] | None:
    """Centre and diameter of the only ball to be seen, pixels."""
    seen = [ball for ball in balls if not ball.out_of_view]
    center = seen[0].center if len(seen) == 1 else None
    if center is None:
        return None
    box = seen[0].box
    return center, None if box is None else box.diameter


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


def measure_distance_from_truth(
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
    lines = [distance for view, other in pairs for distance in _measure_line_distances(view, other)]
    missing = sum(len({*view.station.lines} - {*other.station.lines}) for view, other in pairs)
    centers = [
        (_find_first_ball_center(view), _find_first_ball_center(other)) for view, other in pairs
    ]
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
class GroundTruthView:
    """What is true of a view whose world is known: its camera, and where its ball is, in pixels."""

    camera: Camera
    center: ImagePoint


def measure_error_against_true_cameras(
    truth: Group,
    views: Mapping[str, GroundTruthView],
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
    centers = [(_find_first_ball_center(other), known.center) for _, other, known in seen]
    balls = [float(np.hypot(a.x - b.x, a.y - b.y)) for a, b in centers if a is not None]
    return DistanceFromTruth(
        line_px=float(np.median(lines)) if lines else None,
        lines_missing=sum(
            len({*view.station.lines} - {*other.station.lines}) for view, other, _ in seen
        ),
        ball_px=max(balls) if balls else None,
        balls_missing=sum(
            _find_first_ball_center(view) is not None and _find_first_ball_center(other) is None
            for view, other, _ in seen
        ),
        ball_m=None if own is None else float(np.linalg.norm(np.subtract(ball, own))),
    )


def _find_first_ball_center(view: View) -> ImagePoint | None:
    return next((center for ball in view.balls if (center := ball.center) is not None), None)


def _measure_line_distances(view: View, other: View) -> list[float]:
    """Mean distance of each marking that both have, from either to the other, pixels."""
    mine, theirs = view.station.lines, other.station.lines
    return [
        measure_marking_distance(name, mine[name], theirs[name]) for name in mine if name in theirs
    ]


def measure_marking_distance(
    marking: str, one: tuple[ImagePoint, ...], other: tuple[ImagePoint, ...]
) -> float:
    """Mean distance of the points that two drew of a marking from the other's line, pixels.

    Both ways, so that neither a short piece of a long line nor the long line is nearer.
    """
    a, b = (np.array([(p.x, p.y) for p in points], dtype=float) for points in (one, other))
    apart = [
        np.min([_distances_from_polyline(points, line) for line in lines], axis=0)
        for points, lines in ((a, _list_lines(b, marking)), (b, _list_lines(a, marking)))
    ]
    return float(np.concatenate(apart).mean())


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
