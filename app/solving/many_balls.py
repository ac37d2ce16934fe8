"""Many balls: the paper's estimator and boxes over a whole dataset at once, in arrays.

The same numbers as ``solve`` gives group by group, for calibrated views that all show their
ball; what-if questions over thousands of groups ask here.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from app.geometry.arrays import FloatArray
from app.geometry.triangulation import triangulate_pairs

IntArray = npt.NDArray[np.int64]
BoolArray = npt.NDArray[np.bool_]


@dataclass(frozen=True)
class ManyViews:
    """Views of many groups; those of one group follow each other.

    Attributes:
        group: Number of each view's group, increasing, shape (V,).
        rotation: Pitch to camera, shape (V, 3, 3).
        position: Pitch frame, metres, shape (V, 3).
        K: Calibration matrices, shape (V, 3, 3).
        pixels: Ball centres, undistorted pixels, shape (V, 2).
        tau_px: Largest reprojection error of a valid pair, shape (V,).
    """

    group: IntArray
    rotation: FloatArray
    position: FloatArray
    K: FloatArray
    pixels: FloatArray
    tau_px: FloatArray

    @property
    def P(self) -> FloatArray:
        """Projection matrices, shape (V, 3, 4)."""
        KR = self.K @ self.rotation
        return np.concatenate([KR, -KR @ self.position[:, :, None]], axis=2)


@dataclass(frozen=True)
class ManyBalls:
    """Balls of many groups.

    Attributes:
        a: First view of each pair, shape (N,); ``b`` the second.
        points: Of each pair, pitch frame, metres, shape (N, 3).
        errors_px: Reprojection errors in a and b, shape (N, 2).
        valid: Whether the pair counts, shape (N,).
        balls: Mean of the valid pairs of each group, NaN without one, shape (G, 3).
        diameters_px: Optimised diameter in each view, NaN without a ball or behind the camera,
            shape (V,).
    """

    a: IntArray
    b: IntArray
    points: FloatArray
    errors_px: FloatArray
    valid: BoolArray
    balls: FloatArray
    diameters_px: FloatArray


def solve_many(views: ManyViews, diameter_m: float, min_baseline_m: float) -> ManyBalls:
    """Triangulate every pair within its group, average the valid ones, and box the result."""
    a, b = _pairs(views.group)
    P = views.P
    points = triangulate_pairs(P[a], P[b], views.pixels[a], views.pixels[b])
    errors = np.column_stack([_errors(P[view], points, views.pixels[view]) for view in (a, b)])
    apart = np.linalg.norm(views.position[a] - views.position[b], axis=1)
    in_front = np.logical_and(*(_depth(P[view], points) > 0 for view in (a, b)))
    tau = np.column_stack([views.tau_px[a], views.tau_px[b]])
    valid = (errors < tau).all(axis=1) & in_front & (apart >= min_baseline_m)
    balls = _means(views.group[a[valid]], points[valid], int(views.group[-1]) + 1)
    diameters = _diameters(views, balls[views.group], diameter_m)
    return ManyBalls(a, b, points, errors, valid, balls, diameters)


def _pairs(group: IntArray) -> tuple[IntArray, IntArray]:
    """Every pair of places with the same group, the earlier first."""
    _, begins, counts = np.unique(group, return_index=True, return_counts=True)
    first, second = [], []
    for count in np.unique(counts):
        i, j = np.triu_indices(count, 1)
        start = begins[counts == count][:, None]
        first.append((start + i).ravel())
        second.append((start + j).ravel())
    a, b = np.concatenate(first), np.concatenate(second)
    order = np.lexsort((b, a))
    return a[order], b[order]


def _errors(P: FloatArray, points: FloatArray, pixels: FloatArray) -> FloatArray:
    image = np.einsum("nij,nj->ni", P[:, :, :3], points) + P[:, :, 3]
    with np.errstate(divide="ignore", invalid="ignore"):
        offset = image[:, :2] / image[:, 2:] - pixels
    distance: FloatArray = np.hypot(offset[:, 0], offset[:, 1])
    return distance


def _depth(P: FloatArray, points: FloatArray) -> FloatArray:
    """Depth along the optical axis, metres: the third row of K R [I | -C] is that of R."""
    depth: FloatArray = np.einsum("nj,nj->n", P[:, 2, :3], points) + P[:, 2, 3]
    return depth


def _means(group: IntArray, points: FloatArray, count: int) -> FloatArray:
    sums = np.column_stack([np.bincount(group, column, count) for column in points.T])
    number = np.bincount(group, minlength=count)[:, None]
    return np.where(number > 0, sums / np.maximum(number, 1), np.nan)


def _diameters(views: ManyViews, points: FloatArray, diameter_m: float) -> FloatArray:
    """Closed-form diameter of the square box of each view, pixels (see ``geometry.sphere``)."""
    ax, skew, x0 = views.K[:, 0, 0], views.K[:, 0, 1], views.K[:, 0, 2]
    ay, y0 = views.K[:, 1, 1], views.K[:, 1, 2]
    y = (views.pixels[:, 1] - y0) / ay
    x = (views.pixels[:, 0] - x0 - skew * y) / ax
    in_camera = np.einsum("nij,nj->ni", views.rotation, points - views.position)
    depth = (x * in_camera[:, 0] + y * in_camera[:, 1] + in_camera[:, 2]) / (x * x + y * y + 1)
    with np.errstate(divide="ignore", invalid="ignore"):
        diameter = diameter_m / depth * ay / np.sqrt(1 + (skew / ax) ** 2)
    return np.where(depth > 0, diameter, np.nan)
