"""Yield geometry: what the table keeps of each pair of views, computed for all of them at once."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from app.geometry.arrays import BoolArray, FloatArray
from app.geometry.camera import MIN_DEPTH
from app.geometry.distortion import distort, distort_jacobian
from app.geometry.smallest_singular import smallest_singular_vectors
from app.review.yields.spread import pair_spread
from app.review.yields.table import YieldTable

STEP_PX = 0.5
"""Of the central differences; the same as one group's covariance takes."""
_NEWTON_STEPS = 25


@dataclass(frozen=True)
class Cameras:
    """Cameras of many views; one that is not there is all NaN.

    Attributes:
        rotation: Pitch to camera, shape (V, 3, 3).
        position: Pitch frame, metres, shape (V, 3).
        focal: Pixels, shape (V, 2), like ``center``.
        skew: Pixels, shape (V,).
        distortion: OpenCV's coefficients, shape (V, 12).
    """

    rotation: FloatArray
    position: FloatArray
    focal: FloatArray
    center: FloatArray
    skew: FloatArray
    distortion: FloatArray

    @staticmethod
    def of(values: Sequence[Mapping[str, Any] | None]) -> Cameras:
        """From the JSON of each camera, or None."""
        rows = np.full((len(values), 29), np.nan)
        for row, value in zip(rows, values, strict=True):
            if value is not None:
                row[:9], row[9:12] = value["rotation"], value["position"]
                row[12:14], row[14:16] = value["focal_length"], value["principal_point"]
                row[16], row[17:] = value["skew"], value["distortion"]
        return Cameras(
            rotation=rows[:, :9].reshape(-1, 3, 3),
            position=rows[:, 9:12],
            focal=rows[:, 12:14],
            center=rows[:, 14:16],
            skew=rows[:, 16],
            distortion=rows[:, 17:],
        )

    @property
    def P(self) -> FloatArray:
        """Projection matrices without distortion, shape (V, 3, 4)."""
        K = np.zeros_like(self.rotation)
        K[:, 0, 0], K[:, 1, 1], K[:, 2, 2] = self.focal[:, 0], self.focal[:, 1], 1.0
        K[:, 0, 1], K[:, :2, 2] = self.skew, self.center
        KR = K @ self.rotation
        return np.concatenate([KR, -KR @ self.position[:, :, None]], axis=2)

    def undistorted(self, pixels: FloatArray) -> FloatArray:
        """Pixels of the ideal pinhole, one in each camera, both shape (V, 2)."""
        seen = (pixels - self.center) / self.focal
        seen[:, 0] -= self.skew * seen[:, 1] / self.focal[:, 0]
        ideal = _undistort(seen, self.distortion)
        x = self.focal[:, 0] * ideal[:, 0] + self.skew * ideal[:, 1] + self.center[:, 0]
        return np.column_stack([x, self.focal[:, 1] * ideal[:, 1] + self.center[:, 1]])


def measure_pairs(table: YieldTable, cameras: Cameras, pixels: FloatArray) -> YieldTable:
    """The table with depth, slope and spread of its pairs.

    Args:
        table: With everything else.
        cameras: Of each view.
        pixels: Annotated centre of the ball in each view, shape (V, 2).
    """
    if not len(table.pair_group):
        return table
    front = _in_front(table, cameras)
    slope = _slopes(table, cameras.P, cameras.undistorted(pixels))
    bare = replace(table, pair_front=front, pair_slope=slope)
    with np.errstate(all="ignore"):
        return replace(bare, pair_spread=pair_spread(bare))


def _in_front(table: YieldTable, cameras: Cameras) -> BoolArray:
    """Whether the point of each pair lies in front of both its cameras."""
    offset = table.pair_point[:, None] - cameras.position[table.pair_view]
    depth = (cameras.rotation[table.pair_view, 2] * offset).sum(axis=2)
    front: BoolArray = (depth > MIN_DEPTH).all(axis=1)
    return front


def _slopes(table: YieldTable, P: FloatArray, pixels: FloatArray) -> FloatArray:
    """How far the point of each pair moves with the pixel of either view, (P, 2, 2, 3)."""
    a, b = table.pair_view.T
    slopes = np.empty((len(a), 2, 2, 3))
    for side in (0, 1):
        for axis in (0, 1):
            moved = []
            for step in (STEP_PX, -STEP_PX):
                seen = [pixels[a].copy(), pixels[b].copy()]
                seen[side][:, axis] += step
                moved.append(_triangulated(P[a], P[b], *seen))
            slopes[:, side, axis] = (moved[0] - moved[1]) / (2 * STEP_PX)
    return slopes


def _triangulated(
    P_a: FloatArray, P_b: FloatArray, pixels_a: FloatArray, pixels_b: FloatArray
) -> FloatArray:
    """``geometry.triangulation.triangulate_pairs``, but parallel rays meet at infinity.

    Pairs that no policy accepts are in the table, too, and must not stop the others.
    """
    rows = np.empty((len(P_a), 4, 4))
    for place, (P, pixels) in enumerate(((P_a, pixels_a), (P_b, pixels_b))):
        rows[:, 2 * place] = pixels[:, :1] * P[:, 2] - P[:, 0]
        rows[:, 2 * place + 1] = pixels[:, 1:] * P[:, 2] - P[:, 1]
    homogeneous = np.empty((len(rows), 4))
    smallest_singular_vectors(rows, homogeneous)
    with np.errstate(all="ignore"):
        points: FloatArray = homogeneous[:, :3] / homogeneous[:, 3:]
    return points


def _undistort(seen: FloatArray, distortion: FloatArray) -> FloatArray:
    """Ideal coordinates of distorted ones by Newton's method, both shape (V, 2)."""
    ideal, coefficients = seen.copy(), distortion.T
    with np.errstate(all="ignore"):
        for _ in range(_NEWTON_STEPS):
            error = distort(ideal, coefficients) - seen
            if not np.nanmax(np.abs(error), initial=0.0) > 1e-15:
                break
            (xx, xy), (yx, yy) = distort_jacobian(ideal, coefficients).transpose(1, 2, 0)
            x, y = error.T
            step = np.stack([yy * x - xy * y, xx * y - yx * x]) / (xx * yy - xy * yx)
            ideal = ideal - step.T
    return ideal
