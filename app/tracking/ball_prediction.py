"""What a track says of measurements that it was made without: each instant left out in turn.

In a fit that is straight near its solution, leaving an instant out changes its misses by a known
factor (the inverse of one less the leverage), so no fit has to be made again.
"""

from __future__ import annotations

import numpy as np

from app.geometry.arrays import BoolArray, FloatArray, IntArray
from app.tracking.ball_fit import FittedPath
from app.tracking.ball_search import TrackKnots
from app.tracking.ball_track import LeaveOneOutSummary

_MOST = 0.999
"""Leverage of an instant that nothing else holds: nothing predicts it."""


def leave_one_out_errors(
    knots: TrackKnots, fitted: FittedPath, noise: FloatArray, known: BoolArray
) -> FloatArray:
    """How far each ray is from the track without its instant, pixels, NaN where none holds, (R,).

    Args:
        knots: Instants and rays.
        fitted: The fit with all.
        noise: Of each ray in the fit, radians, shape (R,).
        known: Whether the track holds there, by knot, shape (K,).
    """
    px = np.full(len(knots.rows), np.nan)
    count = np.diff(knots.starts)
    for rays_each in np.unique(count[known & (count > 0)]):
        # All instants with as many rays at once.
        at = np.flatnonzero(known & (count == rays_each))
        rays = knots.starts[at, None] + np.arange(rays_each)
        root = np.sqrt(fitted.weight[rays])[:, :, None]
        miss = (root * fitted.miss[rays]).reshape(len(at), -1)
        slope = (root[:, :, :, None] * fitted.slope[rays]).reshape(len(at), -1, 3)
        spread = fitted.covariance[at, :3, :3]
        back = spread @ slope.transpose(0, 2, 1)
        lever = slope @ back
        held = np.linalg.eigvalsh(lever)[:, -1] <= _MOST
        rays, miss, lever, back = rays[held], miss[held], lever[held], back[held]
        # The ball goes where the others put it.
        push = np.linalg.solve(np.eye(miss.shape[1]) - lever, miss[:, :, None])
        moved = (back @ push)[:, None, :, 0]
        alone = fitted.miss[rays] + (fitted.slope[rays] @ moved[..., None])[..., 0]
        px[rays] = np.linalg.norm(alone, axis=2) * noise[rays] * knots.scale[rays]
    return px


def summarize_prediction_errors(
    px: FloatArray, of_frame: IntArray, frames: IntArray
) -> LeaveOneOutSummary:
    """What is said of a stretch.

    Args:
        px: Of each measurement, NaN where none was predicted, shape (M,).
        of_frame: Their frames, shape (M,).
        frames: Of the track, shape (N,).
    """
    by_frame = np.full(len(frames), np.nan)
    told = np.isfinite(px)
    # By frame and error, so that the median of each frame is one or two of its own.
    order = np.flatnonzero(told)[np.lexsort((px[told], of_frame[told]))]
    first, last = (np.searchsorted(of_frame[order], frames, side) for side in ("left", "right"))
    rows = np.flatnonzero(last > first)
    middle = first[rows] + last[rows] - 1
    by_frame[rows] = (px[order[middle // 2]] + px[order[(middle + 1) // 2]]) / 2
    if not told.any():
        return LeaveOneOutSummary(px, by_frame, None, None, 0)
    median, most = np.percentile(px[told], (50, 95))
    return LeaveOneOutSummary(px, by_frame, float(median), float(most), int(told.sum()))
