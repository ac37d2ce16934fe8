"""Solve: from what views measured of a ball to its track, or to the reason why there is none."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np
from scipy.stats import norm

from app.geometry.arrays import BoolArray, FloatArray, IntArray
from app.soccer.pitch import Pitch
from app.tracking.ball_fit import Fitted, fit
from app.tracking.ball_models import BOUNCE, FLIGHT, HELD, LEAST_CHANGE, NOTHING, REST, ROLL
from app.tracking.ball_prediction import left_out, summed
from app.tracking.ball_search import History, Knots, knots_of, louder, search
from app.tracking.ball_track import (
    BallEvent,
    BallMeasurements,
    BallMode,
    BallState,
    BallTrack,
    Contradiction,
    EventKind,
)

FEWEST = 6
"""Instants that a track is made of."""
_MODES: dict[int, BallMode] = {FLIGHT: "flight", ROLL: "roll", HELD: "held"}
_GROSS = 25.0
"""Square of a miss by its noise beyond which a ray is of something else."""
_CONTRADICT = 0.3
"""Share of rays that is of something else beyond which there is no track."""
_ODD = 0.4
"""Share of one view's rays beyond which it is of something else."""
_INEXACT = 12.0
"""Times its noise that a view may be off for its camera's sake."""
_LOUD = 6.0
"""Times that misses may be what the noise says."""
_ALONE, _ACROSS, _LONG_S = 40.0, 2.0, 0.3
"""Noise of the acceleration by touches that nobody saw: before and after all measurements, and across
gaps that are longer than so many seconds, (m/s2)2 s."""
_SHIFTS = 4
"""Times that views are looked at for times that are off."""
_LATE_S, _LATE_SIGMA_S, _LATE_SURE, _LATE_LEAST_S = 0.1, 0.01, 5.0, 0.003
"""How late views may be; how well that has to be known; in how many sigmas, and from where on it counts."""
_OWN = 20.0
"""Rays that are believed to have been seen, as noisy as they are said to be."""
_SCALES = (0.6, 1.1 * _LOUD)


@dataclass(frozen=True)
class TrackOptions:
    """What can be asked of a track.

    Attributes:
        longest_gap_s: Without a measurement, beyond which nothing is carried across.
        beyond_s: How far before the first and after the last measurement a ball is said.
        most_sigma_m: Uncertainty beyond which a frame is a gap.
        leave_out: Whether to say how measurements are predicted without them.
    """

    longest_gap_s: float = 1.2
    beyond_s: float = 0.5
    most_sigma_m: float = 1.5
    leave_out: bool = True


def track_ball(
    measurements: BallMeasurements,
    frames: IntArray,
    times: FloatArray,
    *,
    pitch: Pitch,
    options: TrackOptions | None = None,
) -> BallTrack:
    """The ball in every frame of a stretch, from one ball in one or more calibrated views.

    Args:
        measurements: Of the stretch; their times count as ``times`` do.
        frames: Numbers, increasing, shape (N,).
        times: Of the frames, seconds, increasing, shape (N,).
        pitch: Where the ball is played.
        options: The defaults without them.

    Returns:
        The track; with a reason instead of positions where the measurements say none.
    """
    options = options or TrackOptions()
    frames, times = np.asarray(frames), np.asarray(times, dtype=float)
    reason = _too_few(measurements) if len(frames) else "The stretch has no frames."
    if reason is None:
        shift = np.zeros(len(measurements.names))
        for _ in range(_SHIFTS):
            runs = [
                _solve_run(measurements, rows, times, shift, pitch, options)
                for rows in _runs(measurements.times, options.longest_gap_s)
            ]
            moved = _late(measurements, runs)
            if not moved.any():
                break
            shift += moved
        odd = _odd_view(measurements, runs)
        reason = next((run.reason for run in runs if run.reason), None)
        made = [run for run in runs if run.fitted is not None]
        if odd is not None:
            reason = odd
        elif made:
            track = _joined(measurements, frames, times, made, shift, pitch, options)
            if any(state != "gap" for state in track.state):
                return track
            reason = (
                "The ball's distance is not known: no bounce, kick or known height in reach of "
                "a view that sees it alone."
            )
    return BallTrack.none(frames, times, reason or "No run of measurements is long enough.")


@dataclass(frozen=True)
class _Run:
    """A stretch without long gaps; without a fit where there is a reason."""

    reason: str | None
    names: tuple[str, ...] = ()
    knots: Knots | None = None
    history: History | None = None
    fitted: Fitted | None = None
    used: BoolArray | None = None
    noise: FloatArray | None = None


def _too_few(measurements: BallMeasurements) -> str | None:
    instants = np.unique(np.round(measurements.times, 4))
    if len(instants) < FEWEST:
        return f"The ball is measured at {len(instants)} instants; a track needs {FEWEST}."
    step = float(np.median(np.diff(instants)))
    if step > 0.25:
        return f"The measurements are {step:.2f} s apart: a track needs at least four a second."
    return None


def _runs(times: FloatArray, longest: float) -> Iterator[IntArray]:
    """Rows of measurements without long gaps between them."""
    order = np.argsort(times, kind="stable")
    breaks = np.flatnonzero(np.diff(times[order]) > longest) + 1
    yield from np.split(order, breaks)


def _solve_run(
    measurements: BallMeasurements,
    rows: IntArray,
    times: FloatArray,
    shift: FloatArray,
    pitch: Pitch,
    options: TrackOptions,
) -> _Run:
    part = measurements.part(rows)
    names = list(measurements.names)
    if (reason := _too_few(part)) is not None:
        return _Run(reason)
    first, last = part.times.min() - options.beyond_s, part.times.max() + options.beyond_s
    own = shift[[names.index(name) for name in part.names]]
    knots = knots_of(part, times[(times >= first) & (times <= last)], own)
    knots = louder(knots, _INEXACT)
    if len(np.unique(knots.at)) < FEWEST:
        return _Run("The ball lies where its cameras have no rays.")
    history = search(knots, pitch)
    wrong = 1 - float(history.used.mean())
    if wrong > _CONTRADICT:
        return _Run(_contradiction(f"{wrong:.0%} of the measurements fit no ball"))
    event = history.event.copy()
    used, noise = history.used.copy(), knots.noise
    unseen = _unseen(knots)
    state = history.state
    for turn in range(4):
        fitted = fit(knots, history.mode, event, used, state, noise, unseen)
        state = fitted.state[:, :6]
        scale = _scale(knots, fitted, used)
        if turn == 0 and np.median(scale) > _LOUD:
            times_said = float(np.median(scale))
            return _Run(
                _contradiction(f"the views miss each other by {times_said:.0f} times their noise")
            )
        heard = knots.noise * scale
        moved = _moved(knots, history.mode, event, fitted)
        gross = (fitted.miss**2).sum(axis=1) * (noise / heard) ** 2 > _GROSS
        changed = bool(moved is not None or (gross != ~used).any())
        noise, used = heard, ~gross
        if moved is not None:
            event, history = moved[1], replace(history, mode=moved[0])
        if not changed and turn > 0:
            break
    fitted = fit(knots, history.mode, event, used, state, noise, unseen)
    history = replace(history, event=event)
    rows_of = replace(knots, rows=rows[knots.rows])
    return _Run(None, part.names, rows_of, history, fitted, used, noise)


def _odd_view(measurements: BallMeasurements, runs: list[_Run]) -> str | None:
    """Why a view cannot be of this ball: most of it fits no track of the others."""
    names = measurements.names
    rays, wrong = np.zeros(len(names)), np.zeros(len(names))
    for run in runs:
        if run.knots is not None and run.used is not None:
            own = np.array([names.index(name) for name in run.names])[run.knots.view]
            np.add.at(rays, own, 1)
            np.add.at(wrong, own[~run.used], 1)
    share = wrong / np.maximum(rays, 1)
    worst = int(share.argmax())
    if share[worst] <= _ODD or rays[worst] < FEWEST:
        return None
    return _contradiction(
        f"{share[worst]:.0%} of those of {names[worst]} fit no ball of the others"
    )


def _late(measurements: BallMeasurements, runs: list[_Run]) -> FloatArray:
    """Seconds to add to each view's times, nought but where the ball says it surely, shape (V,).

    The times of most of them are those that count.
    """
    names = measurements.names
    count = len(names)
    known, pull, rays = np.zeros((count, count)), np.zeros(count), np.zeros(count)
    for run in runs:
        if run.fitted is None or run.knots is None:
            continue
        own = [names.index(name) for name in run.names]
        known[np.ix_(own, own)] += run.fitted.late
        pull[own] += run.fitted.late_pull
        rays[own] += np.bincount(run.knots.view, minlength=len(own))
    found = np.zeros(count)
    free = np.delete(np.arange(count), rays.argmax())
    if not len(free):
        return found
    told = known[np.ix_(free, free)] + np.eye(len(free)) / _LATE_S**2
    spread = np.linalg.inv(told)
    late = -spread @ pull[free]
    sigma = np.sqrt(spread.diagonal())
    sure = (sigma < _LATE_SIGMA_S) & (np.abs(late) > np.maximum(_LATE_SURE * sigma, _LATE_LEAST_S))
    found[free[sure]] = np.clip(late[sure], -_LATE_S, _LATE_S)
    if count < 3:
        return found
    # Where most views agree on an offset, it is the others that are off.
    order = found.argsort()
    middle = order[np.searchsorted(rays[order].cumsum(), rays.sum() / 2)]
    result: FloatArray = found - found[middle]
    return result


def _contradiction(what: str) -> str:
    return (
        f"The measurements contradict each other: {what}. A camera is mirrored or exchanged, a view "
        "is of another time, or two balls are marked."
    )


def _unseen(knots: Knots) -> FloatArray:
    """What touches that nobody saw add to the acceleration's noise before each knot, (m/s2)2 s."""
    seen = np.flatnonzero(np.diff(knots.starts) > 0)
    result = np.zeros(len(knots.times))
    result[: seen[0] + 1] = _ALONE
    result[seen[-1] + 1 :] = _ALONE
    for a, b in pairwise(seen):
        if knots.times[b] - knots.times[a] > _LONG_S:
            result[a + 1 : b + 1] = _ACROSS
    return result


def _scale(knots: Knots, fitted: Fitted, used: BoolArray) -> FloatArray:
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


def _moved(
    knots: Knots, mode: IntArray, event: IntArray, fitted: Fitted
) -> tuple[IntArray, IntArray] | None:
    """Modes and events with those moved whose time lies in a neighbouring interval."""
    mode, event, any_moved = mode.copy(), event.copy(), False
    for at in np.flatnonzero(event != NOTHING):
        when = fitted.event_time[at]
        low, high = knots.times[at - 1], knots.times[at]
        slack = 0.1 * (high - low)
        if when < low - slack and at > 1 and event[at - 1] == NOTHING:
            event[at - 1], event[at] = event[at], NOTHING
            mode[at - 1] = mode[at]
            any_moved = True
        elif when > high + slack and at + 1 < len(event) and event[at + 1] == NOTHING:
            event[at + 1], event[at] = event[at], NOTHING
            mode[at] = mode[at - 1]
            any_moved = True
    return (mode, event) if any_moved else None


def _joined(
    measurements: BallMeasurements,
    frames: IntArray,
    times: FloatArray,
    runs: list[_Run],
    shift: FloatArray,
    pitch: Pitch,
    options: TrackOptions,
) -> BallTrack:
    """The track of all runs."""
    blank = BallTrack.none(frames, times, "")
    position, velocity = blank.position.copy(), blank.velocity.copy()
    covariance = blank.covariance.copy()
    state: list[BallState] = list(blank.state)
    mode: list[BallMode] = list(blank.mode)
    views: list[tuple[str, ...]] = list(blank.views)
    events: list[BallEvent] = []
    against: list[Contradiction] = []
    px = np.full(len(measurements), np.nan)
    step = float(np.median(np.diff(times))) if len(times) > 1 else 0.04
    half = np.array([-step / 2 - 1e-9, step / 2 + 1e-9])
    for run in runs:
        knots, fitted, history = run.knots, run.fitted, run.history
        assert knots is not None and fitted is not None and history is not None
        assert run.used is not None and run.noise is not None
        spread = _with_event_times(knots, fitted)
        seen = np.flatnonzero(np.bincount(knots.at[run.used], minlength=len(knots.times)) > 0)
        sigma = np.sqrt(np.maximum(np.linalg.eigvalsh(spread[:, :3, :3])[:, -1], 0.0))
        known = sigma <= options.most_sigma_m
        at_times = knots.times[knots.at]
        for row, knot in _rows_of(knots, times):
            if not known[knot]:
                continue
            rays = np.arange(*np.searchsorted(at_times, times[row] + half))
            names = {measurements.views[knots.rows[ray]] for ray in rays[run.used[rays]]}
            position[row] = fitted.state[knot, :3]
            velocity[row] = fitted.state[knot, 3:6]
            covariance[row] = spread[knot]
            views[row] = tuple(sorted(names))
            mode[row] = _MODES[int(history.mode[knot])]
            if names:
                state[row] = "measured" if len(names) > 1 else "one_view"
            else:
                state[row] = "bridged" if seen[0] < knot < seen[-1] else "predicted"
        events += _events(knots, history, fitted, known, frames, times)
        off = np.linalg.norm(fitted.miss, axis=1)
        for ray in np.flatnonzero(~run.used & known[knots.at]):
            reason = (
                f"It lies {off[ray]:.0f} times its noise beside the track: another ball, or a slip."
            )
            miss = float(off[ray] * run.noise[ray] * knots.scale[ray])
            against.append(Contradiction(int(knots.rows[ray]), miss, reason))
        if options.leave_out:
            px[knots.rows] = left_out(knots, fitted, run.noise, known)
    mode, out = _outside(position, mode, pitch, frames, times)
    return replace(
        blank,
        position=position,
        velocity=velocity,
        covariance=covariance,
        state=tuple(state),
        mode=tuple(mode),
        views=tuple(views),
        events=tuple(sorted([*events, *out], key=lambda one: one.time_s)),
        contradicted=tuple(sorted(against, key=lambda one: one.measurement)),
        reason=None,
        left_out=summed(px, measurements.frames, frames) if options.leave_out else None,
        offsets=tuple(
            (name, float(late))
            for name, late in zip(measurements.names, shift, strict=True)
            if abs(late) > _LATE_LEAST_S / 2
        ),
    )


def _rows_of(knots: Knots, times: FloatArray) -> Iterator[tuple[int, int]]:
    """Rows of the track and their knots."""
    at = np.clip(np.searchsorted(knots.times, times - 1e-3), 0, len(knots.times) - 1)
    for row in np.flatnonzero(np.abs(knots.times[at] - times) < 1e-3):
        yield int(row), int(at[row])


def _with_event_times(knots: Knots, fitted: Fitted) -> FloatArray:
    """Covariances with what unknown times of events in gaps add, (K, 6, 6).

    The fit places an event in one interval. Where neither end of it was seen the event may have been
    in a neighbouring one, and until it the ball goes on as before.
    """
    covariance = fitted.covariance[:, :6, :6].copy()
    seen = np.flatnonzero(np.diff(knots.starts) > 0)
    for at in np.flatnonzero(np.isfinite(fitted.event_time)):
        first = seen[seen <= at - 1].max(initial=-1)
        last = seen[seen >= at].min(initial=len(knots.times))
        if first < 0 or last == len(knots.times) or last - first < 2:
            continue
        change = fitted.state[at, 3:6] - fitted.state[at - 1, 3:6]
        slack = 2 * np.sqrt(np.trace(covariance[at, :3, :3]))
        length = knots.times[last] - knots.times[first]
        sigma = min(length / np.sqrt(12), slack / max(float(np.linalg.norm(change)), 1e-6))
        inside = np.arange(first + 1, last)
        off = np.abs(knots.times[inside] - fitted.event_time[at]) / max(sigma, 1e-6)
        # Mean square of how far a normal number lies beyond another: half at nought.
        tail = (1 + off**2) * norm.sf(off) - off * norm.pdf(off)
        covariance[inside, :3, :3] += (sigma**2 * tail)[:, None, None] * np.outer(change, change)
    return covariance


def _events(
    knots: Knots,
    history: History,
    fitted: Fitted,
    known: BoolArray,
    frames: IntArray,
    times: FloatArray,
) -> Iterator[BallEvent]:
    """Kicks and bounces that change the velocity clearly, where the track is known."""
    for at in np.flatnonzero((history.event != NOTHING) & known):
        change = fitted.state[at, 3:6] - fitted.state[at - 1, 3:6]
        if np.linalg.norm(change) < LEAST_CHANGE:
            continue
        kind: EventKind = "bounce" if history.event[at] == BOUNCE else "kick"
        when = float(fitted.event_time[at])
        before = fitted.state[at - 1]
        place = before[:3] + before[3:6] * (when - knots.times[at - 1])
        frame = int(frames[np.abs(times - when).argmin()])
        yield BallEvent(frame, when, kind, place, float(fitted.event_sigma[at]))


def _outside(
    position: FloatArray,
    mode: list[BallMode],
    pitch: Pitch,
    frames: IntArray,
    times: FloatArray,
) -> tuple[list[BallMode], list[BallEvent]]:
    """Modes with those over the lines as out, and the events of going there.

    The whole of the ball has to be over the line.
    """
    off = np.maximum(
        np.abs(position[:, 0]) - pitch.length / 2, np.abs(position[:, 1]) - pitch.width / 2
    )
    is_out = off > REST
    events: list[BallEvent] = []
    for row in np.flatnonzero(is_out):
        mode[row] = "out"
        if row and off[row - 1] <= REST:
            share = (REST - off[row - 1]) / (off[row] - off[row - 1])
            when = float(times[row - 1] + share * (times[row] - times[row - 1]))
            place = position[row - 1] + share * (position[row] - position[row - 1])
            step = float(times[row] - times[row - 1])
            frame = int(frames[row if share > 0.5 else row - 1])
            events.append(BallEvent(frame, when, "out", place, step / 2))
    return mode, events
