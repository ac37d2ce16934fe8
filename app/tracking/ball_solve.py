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
_SHIFTS = 4
"""Times that views are looked at for times that are off."""
_LATE_S, _LATE_SIGMA_S, _LATE_SURE, _LATE_LEAST_S = 0.1, 0.01, 5.0, 0.003
"""How late views may be; how well that has to be known; in how many sigmas, and from where on it counts."""


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
    reason = (
        explain_too_few_measurements(measurements) if len(frames) else "The stretch has no frames."
    )
    if reason is None:
        shift = (known or ViewErrors()).time_shifts(measurements.view_names)
        for _ in range(_SHIFTS):
            runs = [
                solve_run(measurements, rows, times, shift, pitch, options, said, known)
                for rows in split_into_runs(measurements.times, options.longest_gap_s)
            ]
            if known is not None or not (moved := _estimate_time_offsets(measurements, runs)).any():
                break
            shift += moved
        odd = None if known is not None else _explain_inconsistent_view(measurements, runs)
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


def _estimate_time_offsets(measurements: BallMeasurements, runs: list[TrackRun]) -> FloatArray:
    """Seconds to add to each view's times, nought but where the ball says it surely, shape (V,).

    The times of most of them are those that count.
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
