"""Lens kernels: OpenCV's distortion model in plain numbers, for arrays of them, and compiled.

``geometry.distortion`` says what the numbers are.
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from typing import Any

from numba import njit

_STEPS = 25
_CLOSE, _THERE = 1e-9, 1e-15
"""How far, in normalised coordinates, a point may miss what it should be distorted to, and from where
on no step is of use."""

compiled = njit(cache=True, error_model="numpy", nogil=True)


def distorted(x: Any, y: Any, coefficients: Iterable[float]) -> tuple[Any, Any]:
    """``distort`` of numbers or of arrays; kernels compile it, too."""
    k1, k2, p1, p2, k3, k4, k5, k6, s1, s2, s3, s4 = coefficients
    r2 = x * x + y * y
    r4 = r2 * r2
    radial = (1 + k1 * r2 + k2 * r4 + k3 * r4 * r2) / (1 + k4 * r2 + k5 * r4 + k6 * r4 * r2)
    return (
        x * radial + 2 * p1 * x * y + p2 * (r2 + 2 * x * x) + s1 * r2 + s2 * r4,
        y * radial + p1 * (r2 + 2 * y * y) + 2 * p2 * x * y + s3 * r2 + s4 * r4,
    )


def distortion_derivatives(
    x: Any, y: Any, coefficients: Iterable[float]
) -> tuple[Any, Any, Any, Any]:
    """``distort_jacobian``, of u by x and y, then of v; of numbers or of arrays, as ``distorted``."""
    k1, k2, p1, p2, k3, k4, k5, k6, s1, s2, s3, s4 = coefficients
    r2 = x * x + y * y
    r4 = r2 * r2
    numerator = 1 + k1 * r2 + k2 * r4 + k3 * r4 * r2
    denominator = 1 + k4 * r2 + k5 * r4 + k6 * r4 * r2
    radial = numerator / denominator
    # Derivative of the radial factor by r^2.
    slope = (k1 + 2 * k2 * r2 + 3 * k3 * r4) / denominator - radial * (
        k4 + 2 * k5 * r2 + 3 * k6 * r4
    ) / denominator
    return (
        radial + 2 * x * x * slope + 2 * p1 * y + 6 * p2 * x + 2 * x * (s1 + 2 * s2 * r2),
        2 * x * y * slope + 2 * p1 * x + 2 * p2 * y + 2 * y * (s1 + 2 * s2 * r2),
        2 * x * y * slope + 2 * p1 * x + 2 * p2 * y + 2 * x * (s3 + 2 * s4 * r2),
        radial + 2 * y * y * slope + 6 * p1 * y + 2 * p2 * x + 2 * y * (s3 + 2 * s4 * r2),
    )


distorted_fast = compiled(distorted)
slopes_fast = compiled(distortion_derivatives)


# Types are checked by hand from here on: numba compiles these functions from their arguments.


@compiled
def lens_coefficients(numbers):
    """The twelve coefficients at the beginning of an array, as the functions above take them."""
    k1, k2, p1, p2, k3, k4 = numbers[0], numbers[1], numbers[2], numbers[3], numbers[4], numbers[5]
    k5, k6, s1, s2, s3, s4 = (
        numbers[6],
        numbers[7],
        numbers[8],
        numbers[9],
        numbers[10],
        numbers[11],
    )
    return k1, k2, p1, p2, k3, k4, k5, k6, s1, s2, s3, s4


@compiled
def undistort_all(points, coefficients, fold, ideal):
    """Writes what is distorted to each point, by Newton's method; NaN where nothing within the fold is."""
    lens = lens_coefficients(coefficients)
    for row in range(len(points)):
        x, y = points[row, 0], points[row, 1]
        for _ in range(_STEPS):
            u, v = distorted_fast(x, y, lens)
            off_x, off_y = u - points[row, 0], v - points[row, 1]
            ux, uy, vx, vy = slopes_fast(x, y, lens)
            determinant = ux * vy - uy * vx
            x -= (vy * off_x - uy * off_y) / determinant
            y -= (ux * off_y - vx * off_x) / determinant
            # A comparison with NaN is false: what is lost goes on to the end, and is none.
            if abs(off_x) < _THERE and abs(off_y) < _THERE:
                break
        u, v = distorted_fast(x, y, lens)
        found = abs(u - points[row, 0]) < _CLOSE and abs(v - points[row, 1]) < _CLOSE
        if not (found and math.hypot(x, y) <= fold):
            x, y = math.nan, math.nan
        ideal[row, 0], ideal[row, 1] = x, y
