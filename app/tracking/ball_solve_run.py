"""Run: measurements without long gaps, from rays to a smooth way, or to the reason why there is none."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np

from app.geometry.arrays import BoolArray, FloatArray, IntArray
from app.soccer.pitch import Pitch
from app.tracking.ball_constraints import TrackConstraints
from app.tracking.ball_fit import SETTLED_M, FittedPath, fit_ball_path
from app.tracking.ball_models import NOTHING
from app.tracking.ball_search import (
    BallHistory,
    TrackKnots,
    build_knots,
    find_likeliest_history,
    inflate_ray_noise,
)
from app.tracking.ball_track import BallMeasurements, ViewErrors

FEWEST = 6
"""Instants that a track is made of."""
_GROSS = 25.0
"""Square of a miss by its noise beyond which a ray is of something else."""
_CONTRADICT = 0.3
"""Share of rays that is of something else beyond which there is no track."""
_INEXACT = 12.0
"""Times its noise that a view may be off for its camera's sake."""
_LOUD = 6.0
"""Times that misses may be what the noise says."""
_ALONE, _ACROSS, _LONG_S = 40.0, 2.0, 0.3
"""Noise of the acceleration by touches that nobody saw: before and after all measurements, and across
gaps that are longer than so many seconds, (m/s2)2 s."""
_OWN = 20.0
"""Rays that are believed to have been seen, as noisy as they are said to be."""
_SCALES = (0.6, 1.1 * _LOUD)
_WIDTH_OF_PART = 32
"""Histories that are kept of a part of a track: as near the whole as with three times as many, in 0.7 times the time."""
_SHORTEST_OF_PART_S = 0.01
"""In which a ball of a part is not touched: views that are a few milliseconds apart are no two chances of a kick."""


@dataclass(frozen=True)
class TrackOptions:
    """What can be asked of a track.

    Attributes:
        longest_gap_s: Without a measurement, beyond which nothing is carried across.
        beyond_s: How far before the first and after the last measurement a ball is said.
        most_sigma_m: Uncertainty beyond which a frame is a gap.
        leave_out: Whether to say how measurements are predicted without them.
        settled_m: A fit is done where no place moves by more, metres.
    """

    longest_gap_s: float = 1.2
    beyond_s: float = 0.5
    most_sigma_m: float = 1.5
    leave_out: bool = True
    settled_m: float = SETTLED_M


@dataclass(frozen=True)
class TrackRun:
    """Measurements without long gaps; without a fit where there is a reason.

    Attributes:
        rows: Of the measurements, by time.
        reason: Why there is none, a sentence.
        names: Of its views, by the numbers of ``knots.view``.
        knots: Its instants and rays, whose ``rows`` are those of all measurements.
        history: What the ball does when.
        fitted: Its smooth way.
        used: Rays that are of the ball, shape (R,).
        noise: Of each ray, radians, shape (R,).
    """

    rows: IntArray
    reason: str | None
    names: tuple[str, ...] = ()
    knots: TrackKnots | None = None
    history: BallHistory | None = None
    fitted: FittedPath | None = None
    used: BoolArray | None = None
    noise: FloatArray | None = None


def explain_too_few_measurements(measurements: BallMeasurements) -> str | None:
    """Why measurements are too few for a track, a sentence; None where they are not."""
    instants = np.unique(np.round(measurements.times, 4))
    if len(instants) < FEWEST:
        return f"The ball is measured at {len(instants)} instants; a track needs {FEWEST}."
    step = float(np.median(np.diff(instants)))
    if step > 0.25:
        return f"The measurements are {step:.2f} s apart: a track needs at least four a second."
    return None


def split_into_runs(times: FloatArray, longest: float) -> Iterator[IntArray]:
    """Rows of measurements without long gaps between them."""
    order = np.argsort(times, kind="stable")
    breaks = np.flatnonzero(np.diff(times[order]) > longest) + 1
    yield from np.split(order, breaks)


def solve_run(
    measurements: BallMeasurements,
    rows: IntArray,
    times: FloatArray,
    shift: FloatArray,
    pitch: Pitch,
    options: TrackOptions,
    said: TrackConstraints | None = None,
    known: ViewErrors | None = None,
    doubt: float = 1.0,
) -> TrackRun:
    """Search and fit a run.

    Args:
        measurements: Of a stretch.
        rows: Of those that are of the run.
        times: Of the frames, seconds, shape (N,).
        shift: Seconds to add to each view's times, by ``measurements.names``.
        pitch: Where the ball is played.
        options: As of the track.
        said: What is said beside the measurements.
        known: Of a part of a track: what the whole says of the views. It was judged as a whole.
        doubt: Times that the noise of all views is taken.
    """
    part = measurements.part(rows)
    names = list(measurements.view_names)
    if (reason := explain_too_few_measurements(part)) is not None:
        return TrackRun(rows, reason)
    first, last = part.times.min() - options.beyond_s, part.times.max() + options.beyond_s
    own = shift[[names.index(name) for name in part.view_names]]
    knots = build_knots(part, times[(times >= first) & (times <= last)], own, said)
    if known is None:
        knots = inflate_ray_noise(knots, _INEXACT)
        knots = replace(knots, noise=knots.noise * doubt)
    else:
        knots = replace(knots, noise=knots.noise * known.noise_factors(part.view_names)[knots.view])
    if len(np.unique(knots.at)) < FEWEST:
        return TrackRun(rows, "The ball lies where its cameras have no rays.")
    history = (
        find_likeliest_history(knots, pitch)
        if known is None
        else find_likeliest_history(knots, pitch, _WIDTH_OF_PART, _SHORTEST_OF_PART_S)
    )
    wrong = 1 - float(history.used.mean())
    if known is None and wrong > _CONTRADICT:
        return TrackRun(rows, format_contradiction(f"{wrong:.0%} of the measurements fit no ball"))
    event = history.event.copy()
    used, noise = history.used.copy(), knots.noise
    unseen, settled = _unseen_touch_noise(knots), options.settled_m
    state = np.pad(history.state, ((0, 0), (0, 3)))
    for turn in range(4):
        fitted = fit_ball_path(
            knots, history.mode, event, used, state, noise, unseen, brief=True, settled_m=settled
        )
        state = fitted.state
        scale = _estimate_noise_scale(knots, fitted, used)
        if known is None and turn == 0 and np.median(scale) > _LOUD:
            times_said = float(np.median(scale))
            what = f"the views miss each other by {times_said:.0f} times their noise"
            return TrackRun(rows, format_contradiction(what))
        heard = knots.noise * scale
        moved = _shift_misplaced_events(knots, history.mode, event, fitted)
        gross = (fitted.miss**2).sum(axis=1) * (noise / heard) ** 2 > _GROSS
        changed = bool(moved is not None or (gross != ~used).any())
        noise, used = heard, ~gross
        if moved is not None:
            event, history = moved[1], replace(history, mode=moved[0])
        if not changed and turn > 0:
            break
    fitted = fit_ball_path(
        knots, history.mode, event, used, state, noise, unseen, settled_m=settled
    )
    history = replace(history, event=event)
    rows_of = replace(knots, rows=rows[knots.rows])
    return TrackRun(rows, None, part.view_names, rows_of, history, fitted, used, noise)


def format_contradiction(what: str) -> str:
    """The sentence of measurements that fit no ball."""
    return (
        f"The measurements contradict each other: {what}. A camera is mirrored or exchanged, a view "
        "is of another time, or two balls are marked."
    )


def _unseen_touch_noise(knots: TrackKnots) -> FloatArray:
    """What touches that nobody saw add to the acceleration's noise before each knot, (m/s2)2 s."""
    seen = np.flatnonzero(np.diff(knots.starts) > 0)
    result = np.zeros(len(knots.times))
    result[: seen[0] + 1] = _ALONE
    result[seen[-1] + 1 :] = _ALONE
    for a, b in pairwise(seen):
        if knots.times[b] - knots.times[a] > _LONG_S:
            result[a + 1 : b + 1] = _ACROSS
    return result


def _estimate_noise_scale(knots: TrackKnots, fitted: FittedPath, used: BoolArray) -> FloatArray:
    """How many times its noise each view shows, for each ray, beside what it is said to be, (R,)."""
    held = np.einsum(
        "rki,rij,rkj->r", fitted.slope, fitted.covariance[knots.at, :3, :3], fitted.slope
    )
    free = np.maximum(1 - held / 2, 0.05)
    square = (fitted.miss**2).sum(axis=1)
    result = np.ones(len(square))
    for view in np.unique(knots.view):
        rays = np.flatnonzero((knots.view == view) & used)
        told = rays[free[rays] > 0.2]
        if not len(told):
            continue
        # The median square of two normal numbers is 1.386 of their variance.
        found = float(np.median(square[told] / free[told])) / 1.386
        share = len(told) / (len(told) + _OWN)
        result[knots.view == view] = np.clip(np.sqrt(found**share), *_SCALES)
    return result


def _shift_misplaced_events(
    knots: TrackKnots, mode: IntArray, event: IntArray, fitted: FittedPath
) -> tuple[IntArray, IntArray] | None:
    """Modes and events with those moved whose time lies in a neighbouring interval."""
    mode, event, any_moved = mode.copy(), event.copy(), False
    for at in np.flatnonzero(event != NOTHING):
        when = fitted.event_time[at]
        low, high = knots.times[at - 1], knots.times[at]
        slack = 0.1 * (high - low)
        to = at - 1 if when < low - slack else at + 1 if when > high + slack else at
        free = 1 <= to < len(event) and event[to] == NOTHING
        if not free or not knots.asked.allows_event(int(event[at]), int(at), int(to)):
            continue
        event[to], event[at] = event[at], NOTHING
        if to < at:
            mode[to] = mode[at]
        else:
            mode[at] = mode[at - 1]
        any_moved = True
    return (mode, event) if any_moved else None
