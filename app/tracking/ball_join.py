"""Join: runs and their gaps as one track, with its events and with what contradicts it."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace

import numpy as np
from scipy.special import ndtr

from app.geometry.arrays import BoolArray, FloatArray, IntArray
from app.soccer.pitch import Pitch
from app.tracking.ball_fit import FittedPath
from app.tracking.ball_models import BOUNCE, FLIGHT, HELD, JUMP, KICK, LEAST_CHANGE, REST, ROLL
from app.tracking.ball_prediction import leave_one_out_errors, summarize_prediction_errors
from app.tracking.ball_search import BallHistory, TrackKnots
from app.tracking.ball_solve_run import TrackOptions, TrackRun
from app.tracking.ball_track import (
    BallEvent,
    BallMeasurements,
    BallMode,
    BallState,
    BallTrack,
    ContradictingMeasurement,
    EventKind,
    UntrackedRun,
    ViewJump,
)

_MODES: dict[int, BallMode] = {FLIGHT: "flight", ROLL: "roll", HELD: "held"}
OPEN = (
    "The distance of the ball is not known: only one view sees it, and no bounce, kick or known height "
    "is near."
)
"""Why a ball that is seen has no place."""
_JUMP_S = 1.0
"""How long a jump says how wrong the cameras are that see the ball: of that much, by this time less."""
_LONE, _LONE_S = 1.3, 2.0
"""Times its sigma that one view alone leaves a ball uncertain, because its history may be another one: so much
was measured. It counts farther than this from instants that two views see, seconds."""
LEAST_TOLD_S = 0.0015
"""Of an offset in time that is told."""


def join_runs(
    measurements: BallMeasurements,
    frames: IntArray,
    times: FloatArray,
    runs: Sequence[TrackRun],
    shift: FloatArray,
    pitch: Pitch,
    options: TrackOptions,
) -> BallTrack:
    """The track of all runs, all of whose frames may be gaps.

    Args:
        measurements: Of the stretch.
        frames: Numbers, increasing, shape (N,).
        times: Of the frames, seconds, shape (N,).
        runs: With a fit or without.
        shift: Seconds that were added to each view's times, by ``measurements.names``.
        pitch: Where the ball is played.
        options: As of the track.
    """
    blank = BallTrack.make_empty_track(frames, times, "")
    position, velocity = blank.position.copy(), blank.velocity.copy()
    covariance = blank.covariance.copy()
    state: list[BallState] = list(blank.state)
    mode: list[BallMode] = list(blank.mode)
    views: list[tuple[str, ...]] = list(blank.views)
    events: list[BallEvent] = []
    against: list[ContradictingMeasurement] = []
    untracked: list[UntrackedRun] = []
    jumps: list[ViewJump] = []
    px = np.full(len(measurements), np.nan)
    step = float(np.median(np.diff(times))) if len(times) > 1 else 0.04
    half = np.array([-step / 2 - 1e-9, step / 2 + 1e-9])
    for run in runs:
        knots, fitted, history = run.knots, run.fitted, run.history
        if knots is None or fitted is None or history is None:
            untracked.append(_make_untracked_run(measurements, run, run.reason or ""))
            continue
        assert run.used is not None and run.noise is not None
        spread = _add_event_time_covariance(knots, fitted)
        spread[_find_lone_knots(knots, run.used, step)] *= _LONE**2
        seen = np.flatnonzero(np.bincount(knots.at[run.used], minlength=len(knots.times)) > 0)
        sigma = np.sqrt(np.maximum(np.linalg.eigvalsh(spread[:, :3, :3])[:, -1], 0.0))
        known = sigma <= options.most_sigma_m
        if not known.any():
            untracked.append(_make_untracked_run(measurements, run, OPEN))
        at_times = knots.times[knots.at]
        for row, knot in _match_rows_to_knots(knots, times):
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
        events += _find_events(knots, history, fitted, known, frames, times)
        jumps += _find_view_jumps(run, knots, history, fitted, known, frames, times)
        off = np.linalg.norm(fitted.miss, axis=1)
        for ray in np.flatnonzero(~run.used & known[knots.at]):
            reason = f"It lies {off[ray]:.0f} times its noise from the track: another ball, or a wrong click."
            miss = float(off[ray] * run.noise[ray] * knots.scale[ray])
            against.append(ContradictingMeasurement(int(knots.rows[ray]), miss, reason))
        if options.leave_out:
            px[knots.rows] = leave_one_out_errors(knots, fitted, run.noise, known)
    jumps.sort(key=lambda one: one.time_s)
    contradicting = _jump_position_variance(times, jumps)
    covariance[:, :3, :3] += contradicting[:, None, None] * np.eye(3)
    mode, out = _mark_out_of_play(position, mode, pitch, frames, times)
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
        left_out=summarize_prediction_errors(px, measurements.frames, frames)
        if options.leave_out
        else None,
        offsets=tuple(
            (name, float(late))
            for name, late in zip(measurements.view_names, shift, strict=True)
            if abs(late) > LEAST_TOLD_S
        ),
        noise=_mean_noise_by_view(measurements, runs),
        untracked=tuple(sorted(untracked, key=lambda one: one.first)),
        jumps=tuple(jumps),
    )


def _mean_noise_by_view(
    measurements: BallMeasurements, runs: Sequence[TrackRun]
) -> tuple[tuple[str, float], ...]:
    """Times that views are noisier than is said of them, the mean over their rays, where it is more than once."""
    times, rays = dict[str, float](), dict[str, int]()
    for run in runs:
        if run.knots is None or run.fitted is None:
            continue
        said = measurements.sigma[run.knots.rows] / run.knots.scale
        for view, name in enumerate(run.names):
            own = run.knots.view == view
            times[name] = times.get(name, 0.0) + float((run.knots.noise[own] / said[own]).sum())
            rays[name] = rays.get(name, 0) + int(own.sum())
    mean = {name: times[name] / rays[name] for name in sorted(times) if rays[name]}
    return tuple((name, value) for name, value in mean.items() if value > 1 + 1e-9)


def _make_untracked_run(measurements: BallMeasurements, run: TrackRun, reason: str) -> UntrackedRun:
    of_run = measurements.frames[run.rows]
    return UntrackedRun(int(of_run.min()), int(of_run.max()), len(run.rows), reason)


def _match_rows_to_knots(knots: TrackKnots, times: FloatArray) -> Iterator[tuple[int, int]]:
    """Rows of the track and their knots."""
    at = np.clip(np.searchsorted(knots.times, times - 1e-3), 0, len(knots.times) - 1)
    for row in np.flatnonzero(np.abs(knots.times[at] - times) < 1e-3):
        yield int(row), int(at[row])


def _add_event_time_covariance(knots: TrackKnots, fitted: FittedPath) -> FloatArray:
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
        density = np.exp(-(off**2) / 2) / np.sqrt(2 * np.pi)
        tail = (1 + off**2) * ndtr(-off) - off * density
        covariance[inside, :3, :3] += (sigma**2 * tail)[:, None, None] * np.outer(change, change)
    return covariance


def _find_lone_knots(knots: TrackKnots, used: BoolArray, step: float) -> BoolArray:
    """Whether each knot is far from all instants that two views see within a frame, shape (K,)."""
    times, view = knots.times[knots.at[used]], knots.view[used]
    two = times[1:][(view[1:] != view[:-1]) & (np.diff(times) <= step)]
    if not len(two):
        return np.ones(len(knots.times), dtype=bool)
    after = np.searchsorted(two, knots.times)
    near = two[np.clip([after - 1, after], 0, len(two) - 1)]
    lone: BoolArray = np.abs(near - knots.times).min(axis=0) > _LONE_S
    return lone


def _find_events(
    knots: TrackKnots,
    history: BallHistory,
    fitted: FittedPath,
    known: BoolArray,
    frames: IntArray,
    times: FloatArray,
) -> Iterator[BallEvent]:
    """Kicks and bounces that change the velocity clearly, or that somebody saw, where the track is known."""
    places = np.flatnonzero(np.isin(history.event, (KICK, BOUNCE)) & known)
    change = np.linalg.norm(
        fitted.state[places, 3:6] - fitted.state[np.maximum(places - 1, 0), 3:6], axis=1
    )
    shown = change >= LEAST_CHANGE
    when = fitted.event_time.copy()
    for begin, end, wanted in knots.asked.required_event_windows:
        own = np.flatnonzero(
            (places >= begin) & (places <= end) & (history.event[places] == wanted)
        )
        if len(own):
            told = own[change[own].argmax()]
            shown[told] = True
            # The fit may see it a little earlier or later; people were there.
            at = places[told]
            when[at] = np.clip(when[at], knots.times[begin - 1], knots.times[end])
    for at in places[shown]:
        kind: EventKind = "bounce" if history.event[at] == BOUNCE else "kick"
        before = fitted.state[at - 1]
        place = before[:3] + before[3:6] * (when[at] - knots.times[at - 1])
        frame = int(frames[np.abs(times - when[at]).argmin()])
        yield BallEvent(frame, float(when[at]), kind, place, float(fitted.event_sigma[at]))


def _find_view_jumps(
    run: TrackRun,
    knots: TrackKnots,
    history: BallHistory,
    fitted: FittedPath,
    known: BoolArray,
    frames: IntArray,
    times: FloatArray,
) -> Iterator[ViewJump]:
    """Jumps where other views take over, beyond what both sides leave uncertain."""
    for at in np.flatnonzero((history.event == JUMP) & known & np.roll(known, 1)).tolist():
        before, after = fitted.state[at - 1], fitted.state[at]
        span = knots.times[at] - knots.times[at - 1]
        moved = after[:3] - before[:3] - span * (before[3:6] + after[3:6]) / 2
        unsure = np.trace(fitted.covariance[at - 1, :3, :3] + fitted.covariance[at, :3, :3])
        beyond = float(moved @ moved - unsure)
        if beyond > 0:
            rays = range(int(knots.starts[at]), int(knots.starts[at + 1]))
            views = sorted({run.names[knots.view[ray]] for ray in rays})
            time = float(knots.times[at])
            frame = int(frames[np.abs(times - time).argmin()])
            yield ViewJump(frame, time, float(np.sqrt(beyond)), tuple(views))


def _jump_position_variance(times: FloatArray, jumps: Sequence[ViewJump]) -> FloatArray:
    """What jumps add to the variance of each coordinate, square metres, shape (N,).

    Either side may be the one that is wrong, and in any direction: a jump is one sample of it. Of the last one
    before a frame and the next one the one that adds more counts.

    Args:
        times: Of the frames, seconds, shape (N,).
        jumps: By time.
    """
    most = np.zeros(len(times))
    if not jumps:
        return most
    at, metres = np.array([(jump.time_s, jump.metres) for jump in jumps]).T
    after = np.searchsorted(at, times, "right")
    for near in (after - 1, after):
        there = np.clip(near, 0, len(at) - 1)
        added = metres[there] ** 2 * np.exp(-np.abs(times - at[there]) / _JUMP_S)
        most = np.maximum(most, added)
    return most


def _mark_out_of_play(
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
