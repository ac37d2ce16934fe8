"""Search: what the ball does when, by the likeliest history of all modes and events."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from app.geometry.arrays import BoolArray, FloatArray, IntArray
from app.soccer.pitch import Pitch
from app.tracking.ball_constraints import (
    ConstraintsByKnot,
    TrackConstraints,
    build_constraints_by_knot,
)
from app.tracking.ball_models import REST
from app.tracking.ball_search_kernels import find_likeliest_modes
from app.tracking.ball_track import BallMeasurements

_WIDTH = 96
"""Histories that are kept."""
_FEWEST_PAIRS = 10
"""Of rays of the same instant, that the noise of a view is taken from."""
_SAME_S = 1e-4
"""Instants that are closer are one."""
_ASIDE_M, _ABOVE_M, _BELOW_M = 12.0, 45.0, 0.0
"""How far from the pitch a ball is looked for."""
_START_S, _MOST_WRONG = 1.0, 3
"""How long a run tells whether its first rays are of the ball, and of how many instants they may not be."""


@dataclass(frozen=True)
class TrackKnots:
    """Instants of a stretch and the rays of the ball at each.

    Attributes:
        times: Increasing, seconds, shape (K,).
        rows: Measurement of each ray, by time, shape (R,).
        at: Knot of each ray, shape (R,).
        starts: First ray of each knot, and the end, shape (K + 1,).
        centres: Of the cameras, shape (R, 3).
        along: Unit directions of the rays, shape (R, 3).
        across: Two unit vectors at right angles to each, shape (R, 2, 3).
        scale: Pixels per radian, shape (R,).
        noise: Radians, shape (R,).
        far, far_sigma: Distance from the camera by size, 0 where unknown, metres, shape (R,).
        view: Number of each ray's view, shape (R,).
        asked: What is said beside the rays.
    """

    times: FloatArray
    rows: IntArray
    at: IntArray
    starts: IntArray
    centres: FloatArray
    along: FloatArray
    across: FloatArray
    scale: FloatArray
    noise: FloatArray
    far: FloatArray
    far_sigma: FloatArray
    view: IntArray
    asked: ConstraintsByKnot


@dataclass(frozen=True)
class BallHistory:
    """The likeliest one.

    Attributes:
        mode: At each knot, by number, shape (K,).
        event: Before each knot, by number, shape (K,).
        state: Position and velocity, as the past alone knows them, shape (K, 6).
        used: Whether each ray is of the ball, shape (R,).
        score: Logarithm of its likelihood.
    """

    mode: IntArray
    event: IntArray
    state: FloatArray
    used: BoolArray
    score: float


def build_knots(
    measurements: BallMeasurements,
    times: FloatArray,
    shift: FloatArray,
    said: TrackConstraints | None = None,
) -> TrackKnots:
    """Instants and rays; pixels through which no ray goes have none.

    Args:
        measurements: Of a stretch.
        times: Further instants, seconds.
        shift: Seconds to add to each view's times, by ``measurements.names``.
        said: What is said beside the measurements.
    """
    names = {name: number for number, name in enumerate(measurements.view_names)}
    view = np.array([names[name] for name in measurements.views], dtype=int)
    by_camera: dict[int, list[int]] = {}
    for row, camera in enumerate(measurements.cameras):
        by_camera.setdefault(id(camera), []).append(row)
    direction = np.full((len(measurements), 3), np.nan)
    centre, focal = np.zeros((len(measurements), 3)), np.zeros(len(measurements))
    for of_camera in by_camera.values():
        camera = measurements.cameras[of_camera[0]]
        direction[of_camera] = camera.rays(measurements.pixels[of_camera])
        centre[of_camera] = camera.position
        focal[of_camera] = np.sqrt(camera.focal_length[0] * camera.focal_length[1])
    at_time = measurements.times + shift[view]
    good = np.isfinite(direction).all(axis=1) & np.isfinite(at_time)
    rows = np.flatnonzero(good)[np.argsort(at_time[good], kind="stable")]
    every = np.sort(np.concatenate([times, at_time[rows]]))
    knots = every[np.concatenate([[True], np.diff(every) > _SAME_S])]
    at = np.clip(np.searchsorted(knots, at_time[rows] + _SAME_S) - 1, 0, len(knots) - 1)
    length = np.linalg.norm(direction[rows], axis=1)
    along = direction[rows] / length[:, None]
    # A pixel off the axis turns the ray by less than one in the middle of the picture.
    scale = focal[rows] * length
    size, size_sigma = measurements.sizes[rows], measurements.size_sigma[rows]
    known = np.isfinite(size) & np.isfinite(size_sigma) & (size > 0)
    far = np.where(known, 2 * REST * scale / np.where(known, size, 1.0), 0.0)
    return TrackKnots(
        knots,
        rows,
        at,
        np.searchsorted(at, np.arange(len(knots) + 1)),
        centre[rows],
        along,
        _perpendicular_axes(along),
        scale,
        measurements.sigma[rows] / scale,
        far,
        np.where(known, far * size_sigma / np.where(known, size, 1.0), 0.0),
        view[rows],
        build_constraints_by_knot(knots, said or TrackConstraints()),
    )


def inflate_ray_noise(knots: TrackKnots, most: float) -> TrackKnots:
    """The knots with the noise of views whose rays pass each other by more than it says.

    Cameras that are not exact make all rays of a view miss those of others alike: they are of the
    ball all the same. Beyond ``most`` times the noise they are not, and are left as they are.
    """
    pairs = np.flatnonzero((knots.at[1:] == knots.at[:-1]) & (knots.view[1:] != knots.view[:-1]))
    if not len(pairs):
        return knots
    a, b = pairs, pairs + 1
    across = np.cross(knots.along[a], knots.along[b])
    sine = np.maximum(np.linalg.norm(across, axis=1), 1e-9)
    apart = knots.centres[b] - knots.centres[a]
    gap = np.abs((apart * across).sum(axis=1)) / sine
    reach_a = (np.cross(apart, knots.along[b]) * across).sum(axis=1) / sine**2
    reach_b = (np.cross(apart, knots.along[a]) * across).sum(axis=1) / sine**2
    spread = np.hypot(reach_a * knots.noise[a], reach_b * knots.noise[b])
    ratio = gap / np.maximum(spread, 1e-9)
    factor = np.ones(len(knots.at))
    for view in np.unique(knots.view):
        own = ratio[(knots.view[a] == view) | (knots.view[b] == view)]
        # The median of a normal number is 0.6745 sigma.
        times = float(np.median(own)) / 0.6745 if len(own) >= _FEWEST_PAIRS else 1.0
        if 1.0 < times <= most:
            factor[knots.view == view] = times
    return replace(knots, noise=knots.noise * factor)


def find_likeliest_history(
    knots: TrackKnots, pitch: Pitch, width: int = _WIDTH, shortest_s: float = 0.0
) -> BallHistory:
    """The likeliest history of a stretch.

    Where nothing is known of the ball yet, every history takes the first ray. So the start is searched without its
    first rays, too, and they are left out where that is likelier.

    Args:
        knots: Of the stretch.
        pitch: Where the ball is played.
        width: Histories that are kept.
        shortest_s: Between two knots, below which the ball is not taken to be touched.
    """
    history = _search(knots, pitch, width, shortest_s)
    seen = np.unique(knots.at)[:_MOST_WRONG]
    if not len(seen):
        return history
    end = int(np.searchsorted(knots.times, knots.times[seen[-1]] + _START_S))
    if history.used[: knots.starts[end]].all():
        return history
    first = np.flatnonzero(knots.at == seen[0])
    tried = [*first[:, None], *(np.flatnonzero(knots.at <= last) for last in seen)]
    best, score = knots, _search(knots, pitch, width, shortest_s, end).score
    for rays in tried:
        noise = knots.noise.copy()
        noise[rays] = np.inf
        without = replace(knots, noise=noise)
        found = _search(without, pitch, width, shortest_s, end).score
        if found > score:
            best, score = without, found
    return history if best is knots else _search(best, pitch, width, shortest_s)


def _search(
    knots: TrackKnots, pitch: Pitch, width: int, shortest_s: float, end: int | None = None
) -> BallHistory:
    """The likeliest history up to a knot; rays of infinite noise are of something else."""
    x, y = pitch.length / 2 + _ASIDE_M, pitch.width / 2 + _ASIDE_M
    room = np.array([[-x, x], [-y, y], [-_ABOVE_M, _BELOW_M]])
    asked, times = knots.asked, knots.times[:end]
    mode, event, left, state, score = find_likeliest_modes(
        times, knots.starts, knots.centres, knots.across, knots.along,
        knots.noise, knots.scale, knots.far, knots.far_sigma, room, width, shortest_s,
        find_view_changes(knots), asked.wanted, asked.begin, asked.due, asked.may_not,
        np.searchsorted(asked.at, np.arange(len(knots.times) + 1)),
        asked.normal, asked.value, asked.sigma,
    )  # fmt: skip
    at = knots.at[: knots.starts[len(times)]]
    bit = np.arange(len(at)) - knots.starts[at]
    return BallHistory(mode, event, state, (left[at] >> bit) & 1 == 0, float(score))


def find_view_changes(knots: TrackKnots) -> BoolArray:
    """Whether a view comes to see the ball at a knot, or went at the last one before it that any sees, (K,).

    Views whose frames lie between those of others see it all the while.
    """
    result = np.zeros(len(knots.times), dtype=bool)
    seen = np.unique(knots.at)
    first, last = knots.times[seen[[0, -1]]] if len(seen) else (0.0, 0.0)
    for view in np.unique(knots.view):
        own = np.searchsorted(seen, np.unique(knots.at[knots.view == view]))
        times = knots.times[seen[own]]
        step = float(np.median(np.diff(times))) if len(own) > 1 else 0.0
        gone = np.flatnonzero(np.diff(times) > 1.5 * step)
        went, came = own[gone] + 1, own[gone + 1]
        away = went != came
        went, came = went[away], came[away]
        if times[0] - first > 0.99 * step:
            came = np.append(came, own[0])
        if last - times[-1] > 0.99 * step:
            went = np.append(went, own[-1] + 1)
        result[seen[np.concatenate([went, came])]] = True
    return result


def _perpendicular_axes(along: FloatArray) -> FloatArray:
    """Two unit vectors at right angles to each direction and to each other, shape (N, 2, 3)."""
    helper = np.where(np.abs(along[:, 2:]) < 0.9, [[0.0, 0.0, 1.0]], [[1.0, 0.0, 0.0]])
    first = np.cross(along, helper)
    first /= np.linalg.norm(first, axis=1, keepdims=True)
    return np.stack([first, np.cross(along, first)], axis=1)
