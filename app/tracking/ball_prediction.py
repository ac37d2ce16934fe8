"""What a track says of measurements that it was made without: each instant left out in turn.

In a fit that is straight near its solution, leaving an instant out changes its misses by a known
factor (the inverse of one less the leverage), so no fit has to be made again.
"""

from __future__ import annotations

import numpy as np

from app.geometry.arrays import BoolArray, FloatArray, IntArray
from app.tracking.ball_fit import Fitted
from app.tracking.ball_search import Knots
from app.tracking.ball_track import LeftOut

_MOST = 0.999
"""Leverage of an instant that nothing else holds: nothing predicts it."""


def left_out(knots: Knots, fitted: Fitted, noise: FloatArray, known: BoolArray) -> FloatArray:
    """How far each ray is from the track without its instant, pixels, NaN where none holds, (R,).

    Args:
        knots: Instants and rays.
        fitted: The fit with all.
        noise: Of each ray in the fit, radians, shape (R,).
        known: Whether the track holds there, by knot, shape (K,).
    """
    px = np.full(len(knots.rows), np.nan)
    for knot in np.unique(knots.at[known[knots.at]]):
        rays = np.arange(knots.starts[knot], knots.starts[knot + 1])
        root = np.sqrt(fitted.weight[rays])[:, None]
        miss = (root * fitted.miss[rays]).ravel()
        slope = (root[:, :, None] * fitted.slope[rays]).reshape(-1, 3)
        spread = fitted.covariance[knot, :3, :3]
        lever = slope @ spread @ slope.T
        if np.linalg.eigvalsh(lever)[-1] > _MOST:
            continue
        # The ball goes where the others put it.
        moved = spread @ slope.T @ np.linalg.solve(np.eye(len(miss)) - lever, miss)
        alone = fitted.miss[rays] + fitted.slope[rays] @ moved
        px[rays] = np.linalg.norm(alone, axis=1) * noise[rays] * knots.scale[rays]
    return px


def summed(px: FloatArray, of_frame: IntArray, frames: IntArray) -> LeftOut:
    """What is said of a stretch.

    Args:
        px: Of each measurement, NaN where none was predicted, shape (M,).
        of_frame: Their frames, shape (M,).
        frames: Of the track, shape (N,).
    """
    by_frame = np.full(len(frames), np.nan)
    told = np.isfinite(px)
    order = np.flatnonzero(told)[np.argsort(of_frame[told], kind="stable")]
    first, last = (np.searchsorted(of_frame[order], frames, side) for side in ("left", "right"))
    for row in np.flatnonzero(last > first):
        by_frame[row] = np.median(px[order[first[row] : last[row]]])
    if not told.any():
        return LeftOut(px, by_frame, None, None, 0)
    median, most = np.percentile(px[told], (50, 95))
    return LeftOut(px, by_frame, float(median), float(most), int(told.sum()))
