"""Solve: from what views measured of a ball to its track, or to the reason why there is none."""

from __future__ import annotations

import numpy as np

from app.geometry.arrays import FloatArray, IntArray
from app.soccer.pitch import Pitch
from app.tracking.ball_constraints import TrackConstraints
from app.tracking.ball_join import OPEN, join_runs
from app.tracking.ball_solve_run import FEWEST as FEWEST
from app.tracking.ball_solve_run import TrackOptions as TrackOptions
from app.tracking.ball_solve_run import (
    TrackRun,
    explain_too_few_measurements,
    format_contradiction,
    solve_run,
    split_into_runs,
)
from app.tracking.ball_track import BallMeasurements, BallTrack, ViewErrors

_ODD = 0.4
"""Share of one view's rays beyond which it is of something else."""
_SHIFTS = 6
"""Times that a track is made at most while views are found to be off in time."""
_LATE_S, _LATE_SIGMA_S, _LATE_SURE, _LATE_LEAST_S = 0.1, 0.01, 5.0, 0.003
"""How late views may be; how well that has to be known; in how many sigmas, and from where on it counts."""
_DOUBT = 10.0
"""Times its noise that a ray may be off while views that contradict each other are looked at for their times."""
_LATE_SETTLED_S = 0.0005
"""Of a change of a view's offset, that needs no other look."""


def track_ball(
    measurements: BallMeasurements,
    frames: IntArray,
    times: FloatArray,
    *,
    pitch: Pitch,
    options: TrackOptions | None = None,
    said: TrackConstraints | None = None,
    known: ViewErrors | None = None,
) -> BallTrack:
    """The ball in every frame of a stretch, from one ball in one or more calibrated views.

    Args:
        measurements: Of the stretch; their times count as ``times`` do.
        frames: Numbers, increasing, shape (N,).
        times: Of the frames, seconds, increasing, shape (N,).
        pitch: Where the ball is played.
        options: The defaults without them.
        said: What people say of its way beside that.
        known: Of a part of a track: what the whole says of the views. It was judged as a whole.

    Returns:
        The track; with a reason instead of positions where the measurements say none.
    """
    options = options or TrackOptions()
    frames, times = np.asarray(frames), np.asarray(times, dtype=float)

    def solve_runs(shift: FloatArray, doubt: float = 1.0) -> list[TrackRun]:
        return [
            solve_run(measurements, rows, times, shift, pitch, options, said, known, doubt)
            for rows in split_into_runs(measurements.times, options.longest_gap_s)
        ]

    reason = (
        explain_too_few_measurements(measurements) if len(frames) else "The stretch has no frames."
    )
    if reason is None:
        unshifted = shift = (known or ViewErrors()).time_shifts(measurements.view_names)
        before: list[TrackRun] = []
        for turn in range(_SHIFTS):
            runs = solve_runs(shift)
            odd = None if known is not None else _explain_inconsistent_view(measurements, runs)
            if turn == 0 and odd is None:
                before = runs
            if known is not None or turn == _SHIFTS - 1:
                break
            if odd is not None or all(run.fitted is None for run in runs):
                # Rays of a late view look like those of something else.
                runs_in_doubt = solve_runs(shift, _DOUBT)
                found = _estimate_time_offsets(measurements, runs_in_doubt, shift)
            else:
                found = _estimate_time_offsets(measurements, runs, shift)
            if np.abs(found - shift).max() < _LATE_SETTLED_S:
                break
            shift = found
        if _count_used_rays(runs) < _count_used_rays(before):
            # Cameras that are inexact look late; what contradicts more is no better.
            runs, shift, odd = before, unshifted, None
        reason = next((run.reason for run in runs if run.reason), None)
        if odd is not None:
            reason = odd
        elif any(run.fitted is not None for run in runs):
            track = join_runs(measurements, frames, times, runs, shift, pitch, options)
            if any(state != "gap" for state in track.state):
                return track
            reason = OPEN
    return BallTrack.make_empty_track(
        frames, times, reason or "No series of measurements is long enough."
    )


def _count_used_rays(runs: list[TrackRun]) -> int:
    return sum(
        int(run.used.sum()) for run in runs if run.fitted is not None and run.used is not None
    )


def _explain_inconsistent_view(measurements: BallMeasurements, runs: list[TrackRun]) -> str | None:
    """Why a view cannot be of this ball: most of it fits no track of the others."""
    names = measurements.view_names
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
    return format_contradiction(
        f"{share[worst]:.0%} of those of {names[worst]} do not fit the ball of the others"
    )


def _estimate_time_offsets(
    measurements: BallMeasurements, runs: list[TrackRun], shift: FloatArray
) -> FloatArray:
    """Seconds to add to each view's times, nought but where the ball says it surely, shape (V,).

    The times on which views with the most measurements agree are those that count.

    Args:
        measurements: Of the stretch.
        runs: As they were solved with a shift.
        shift: That one, by ``measurements.view_names``.
    """
    names = measurements.view_names
    count = len(names)
    known, pull, rays = np.zeros((count, count)), np.zeros(count), np.zeros(count)
    for run in runs:
        if run.fitted is None or run.knots is None:
            continue
        own = [names.index(name) for name in run.names]
        known[np.ix_(own, own)] += run.fitted.late
        pull[own] += run.fitted.late_pull
        rays[own] += np.bincount(run.knots.view, minlength=len(own))
    free = np.delete(np.arange(count), rays.argmax())
    spread, found = np.zeros((count, count)), shift.copy()
    if len(free):
        told = known[np.ix_(free, free)] + np.eye(len(free)) / _LATE_S**2
        spread[np.ix_(free, free)] = np.linalg.inv(told)
        found -= spread @ pull
    agree = np.abs(found[:, None] - found) < _LATE_LEAST_S
    right = (agree @ rays).argmax()
    variance = spread.diagonal() + spread[right, right] - 2 * spread[right]
    sigma, found = np.sqrt(np.maximum(variance, 0.0)), found - found[right]
    sure = (sigma < _LATE_SIGMA_S) & (np.abs(found) > np.maximum(_LATE_SURE * sigma, _LATE_LEAST_S))
    result: FloatArray = np.where(sure, np.clip(found, -_LATE_S, _LATE_S), 0.0)
    return result
