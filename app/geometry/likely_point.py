"""Likely point: where the pixels of several cameras, each with its uncertainty, say a point is.

Compiled: a group has a handful of views, and calls on arrays of that size cost more than what they
compute. Nothing of a linear algebra library is asked, so that every machine finds the same bits.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from app.geometry.arrays import BoolArray, FloatArray, IntArray
from app.geometry.camera import MIN_DEPTH, Camera
from app.geometry.lens import (
    BROWN_CONRADY,
    compiled,
    distorted_fast,
    read_lens_coefficients,
    slopes_fast,
)

STEPS = 8
ARRIVED_M = 1e-6
"""A step that is shorter is the last one."""
_STRAIGHT, _BENT, _WIDE = 0, 1, 2
_INNER, _SLOPE, _WIDEST, _TERMS = 0, 1, 2, 3
"""Columns of a wide lens: of its profile (``geometry.fisheye``), then the terms."""
_ROUNDING = 1e-15
"""Of the information along an axis, as a share of the largest: less is none."""


@dataclass(frozen=True)
class CameraTable:
    """Cameras as rows of arrays.

    Attributes:
        rotation: Pitch to camera, shape (V, 3, 3).
        position: Pitch frame, metres, shape (V, 3).
        K: Calibration matrices, shape (V, 3, 3).
        kind: Straight, bent by Brown and Conrady's model, or wide, shape (V,).
        fold: Ideal radius of the edge of what the lens shows, shape (V,).
        lens: Numbers of the lens, by kind, shape (V, L).
    """

    rotation: FloatArray
    position: FloatArray
    K: FloatArray
    kind: IntArray
    fold: FloatArray
    lens: FloatArray

    @property
    def kernel_arrays(
        self,
    ) -> tuple[FloatArray, FloatArray, FloatArray, IntArray, FloatArray, FloatArray]:
        """All of them, as the kernels take them."""
        return self.rotation, self.position, self.K, self.kind, self.fold, self.lens

    @staticmethod
    def of(cameras: Sequence[Camera]) -> CameraTable:
        """The table of one camera or more."""
        lenses = [_lens_numbers(camera) for camera in cameras]
        lens = np.zeros((len(cameras), max(map(len, lenses))))
        for row, numbers in enumerate(lenses):
            lens[row, : len(numbers)] = numbers
        return CameraTable(
            rotation=np.array([camera.rotation for camera in cameras]),
            position=np.array([camera.position for camera in cameras]),
            K=np.array([camera.K for camera in cameras]),
            kind=np.array([_lens_kind(camera) for camera in cameras]),
            fold=np.array([camera.model.fold_radius(camera.distortion) for camera in cameras]),
            lens=lens,
        )


@dataclass(frozen=True)
class LikelyPoints:
    """A point of each subset of views.

    Attributes:
        found: Whether it settled in front of all, and they determine it, shape (E,).
        points: Pitch frame, metres, shape (E, 3).
        covariances: Square metres, shape (E, 3, 3).
        distances: Squared Mahalanobis distance of each view's pixel, shape (E, V).
    """

    found: BoolArray
    points: FloatArray
    covariances: FloatArray
    distances: FloatArray


def find_most_likely_points(
    cameras: CameraTable,
    pixels: FloatArray,
    chosen: IntArray,
    starts: FloatArray,
    noise: FloatArray,
) -> LikelyPoints:
    """Gauss-Newton for subsets of views, from a start each.

    Args:
        cameras: Of all views.
        pixels: What each of them saw, shape (N, 2).
        chosen: Numbers of the views of each subset, shape (E, V).
        starts: Pitch frame, metres, shape (E, 3).
        noise: Covariance of each pixel, square pixels, shape (E, V, 2, 2).

    Source: Hartley & Zisserman, sec. 12.5 and result 5.10.
    """
    count, views = chosen.shape
    made = LikelyPoints(
        np.zeros(count, bool),
        np.array(starts, float),
        np.empty((count, 3, 3)),
        np.empty((count, views)),
    )
    _refine_points(
        *cameras.kernel_arrays,
        *(pixels, chosen, noise),
        *(made.points, made.covariances, made.distances, made.found),
    )
    return made


def _lens_kind(camera: Camera) -> int:
    return _WIDE if camera.is_wide else _BENT if camera.has_distortion else _STRAIGHT


def _lens_numbers(camera: Camera) -> list[float]:
    numbers: list[float] = camera.distortion.tolist()
    profile = camera.model.profile
    if camera.lens == BROWN_CONRADY or profile is None:
        return numbers
    found = profile(numbers)
    return [found.inner, found.slope, found.widest, *found.terms]


# Types are checked by hand from here on: numba compiles these functions from their arguments.


@compiled
def _refine_points(
    R, C, K, kind, fold, lens, pixels, chosen, noise, points, spans, distances, found
):
    views = chosen.shape[1]
    information, pull, step = np.empty((3, 3)), np.empty(3), np.empty(3)
    pixel, slope, offset, weighed = np.empty(2), np.empty((2, 3)), np.empty(2), np.empty((2, 3))
    for row in range(len(chosen)):
        point, arrived = points[row], False
        for turn in range(STEPS + 1):
            information[:], pull[:] = 0.0, 0.0
            sound = True
            for place in range(views):
                view = chosen[row, place]
                if not _project(R, C, K, kind, fold, lens, view, point, pixel, slope):
                    sound = False
                    break
                offset[0] = pixels[view, 0] - pixel[0]
                offset[1] = pixels[view, 1] - pixel[1]
                distances[row, place] = _add_view_equations(
                    noise[row, place], offset, slope, weighed, information, pull
                )
            sound = sound and invert_symmetric(information, spans[row])
            if not sound or arrived or turn == STEPS:
                found[row] = sound
                break
            length = 0.0
            for i in range(3):
                step[i] = 0.0
                for j in range(3):
                    step[i] += spans[row, i, j] * pull[j]
                length += step[i] * step[i]
                point[i] += step[i]
            if not math.isfinite(length):
                break
            arrived = math.sqrt(length) < ARRIVED_M


@compiled
def _add_view_equations(noise, offset, slope, weighed, information, pull):
    """Adds what a view knows to information and pull; its squared distance."""
    a, b, c, d = noise[0, 0], noise[0, 1], noise[1, 0], noise[1, 1]
    determinant = a * d - b * c
    for j in range(3):
        weighed[0, j] = (d * slope[0, j] - b * slope[1, j]) / determinant
        weighed[1, j] = (a * slope[1, j] - c * slope[0, j]) / determinant
    first = (d * offset[0] - b * offset[1]) / determinant
    second = (a * offset[1] - c * offset[0]) / determinant
    for i in range(3):
        pull[i] += slope[0, i] * first + slope[1, i] * second
        for j in range(3):
            information[i, j] += slope[0, i] * weighed[0, j] + slope[1, i] * weighed[1, j]
    return offset[0] * first + offset[1] * second


@compiled
def invert_symmetric(matrix, inverse):
    """Writes the inverse of a symmetric matrix of 3 x 3, by Cholesky; False where it has none."""
    largest = max(matrix[0, 0], matrix[1, 1], matrix[2, 2])
    if not (math.isfinite(largest) and largest > 0):
        return False
    L = np.zeros((3, 3))
    for i in range(3):
        for j in range(i + 1):
            value = matrix[i, j]
            for k in range(j):
                value -= L[i, k] * L[j, k]
            if i == j:
                if not value > _ROUNDING * largest:
                    return False
                L[i, i] = math.sqrt(value)
            else:
                L[i, j] = value / L[j, j]
    for column in range(3):
        for i in range(3):
            value = 1.0 if i == column else 0.0
            for k in range(i):
                value -= L[i, k] * inverse[k, column]
            inverse[i, column] = value / L[i, i]
        for i in range(2, -1, -1):
            value = inverse[i, column]
            for k in range(i + 1, 3):
                value -= L[k, i] * inverse[k, column]
            inverse[i, column] = value / L[i, i]
    return True


@compiled
def _project(R, C, K, kind, fold, lens, view, point, pixel, slope):
    """Writes the pixel of a point and its derivative by the point; False where there is none."""
    turned = np.empty(3)
    for i in range(3):
        turned[i] = 0.0
        for j in range(3):
            turned[i] += R[view, i, j] * (point[j] - C[view, j])
    depth = turned[2]
    if not depth > MIN_DEPTH:
        return False
    x, y = turned[0] / depth, turned[1] / depth
    u, v, ux, uy, vx, vy = x, y, 1.0, 0.0, 0.0, 1.0
    if kind[view] != _STRAIGHT:
        if not math.hypot(x, y) <= fold[view]:
            return False
        if kind[view] == _BENT:
            numbers = read_lens_coefficients(lens[view])
            u, v = distorted_fast(x, y, numbers)
            ux, uy, vx, vy = slopes_fast(x, y, numbers)
        else:
            u, v, ux, uy, vx, vy = _fisheye_distort(x, y, lens[view])
    pixel[0] = K[view, 0, 0] * u + K[view, 0, 1] * v + K[view, 0, 2]
    pixel[1] = K[view, 1, 1] * v + K[view, 1, 2]
    for j in range(3):
        along = (R[view, 0, j] - x * R[view, 2, j]) / depth
        across = (R[view, 1, j] - y * R[view, 2, j]) / depth
        by_u, by_v = ux * along + uy * across, vx * along + vy * across
        slope[0, j] = K[view, 0, 0] * by_u + K[view, 0, 1] * by_v
        slope[1, j] = K[view, 1, 1] * by_v
    return math.isfinite(pixel[0]) and math.isfinite(pixel[1])


@compiled
def _fisheye_distort(x, y, lens):
    """``fisheye.distort`` of a point and its derivative, of u by x and y, then of v."""
    ideal = math.hypot(x, y)
    angle = math.atan(ideal)
    radius, growth = 0.0, 0.0
    for place in range(len(lens) - 1, _TERMS - 1, -1):
        growth = growth * angle + radius
        radius = radius * angle + lens[place]
    if angle < lens[_INNER]:
        radius, growth = lens[_SLOPE] * angle, lens[_SLOPE]
    if not angle <= lens[_WIDEST]:
        return np.nan, np.nan, np.nan, np.nan, np.nan, np.nan
    if ideal == 0.0:
        return 0.0, 0.0, lens[_SLOPE], 0.0, 0.0, lens[_SLOPE]
    across = radius / ideal
    along = growth / (1 + ideal * ideal)
    p, q, more = x / ideal, y / ideal, along - across
    mixed = more * p * q
    return x * across, y * across, across + more * p * p, mixed, mixed, across + more * q * q
