"""Lens distortion: OpenCV's full model on normalised image coordinates.

Coefficients stand in the order k1 k2 p1 p2 k3 k4 k5 k6 s1 s2 s3 s4 (OpenCV documentation,
"Camera Calibration and 3D Reconstruction").
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from functools import lru_cache
from typing import Any

import numpy as np

from app.geometry.arrays import FloatArray, require_shape

COEFFICIENTS = 12
_NEWTON_STEPS = 25
_FEW = 4
"""Points up to which plain numbers are quicker than arrays."""


def distort(points: FloatArray, coefficients: FloatArray) -> FloatArray:
    """Distorted normalised coordinates of ideal ones, both shape (N, 2).

    Args:
        points: The ideal ones.
        coefficients: Of the lens, shape (12,), or of a lens for each point, shape (12, N).

    Source: OpenCV, projectPoints without its tilt terms.
    """
    points = require_shape(points, (None, 2), "points")
    if len(points) == 1 and coefficients.ndim == 1:
        x, y = points[0].tolist()
        return np.array([distort_point(x, y, coefficients.tolist())])
    return np.column_stack(_distorted(points[:, 0], points[:, 1], coefficients))


def distort_point(x: float, y: float, coefficients: Sequence[float]) -> tuple[float, float]:
    """``distort`` of one point, the same bits without the cost of arrays."""
    try:
        return _distorted(x, y, coefficients)
    except ZeroDivisionError:
        u, v = _distorted(np.float64(x), np.float64(y), coefficients)
        return float(u), float(v)


def _distorted(x: Any, y: Any, coefficients: Iterable[float]) -> tuple[Any, Any]:
    """Of numbers or of arrays."""
    k1, k2, p1, p2, k3, k4, k5, k6, s1, s2, s3, s4 = coefficients
    r2 = x * x + y * y
    r4 = r2 * r2
    radial = (1 + k1 * r2 + k2 * r4 + k3 * r4 * r2) / (1 + k4 * r2 + k5 * r4 + k6 * r4 * r2)
    return (
        x * radial + 2 * p1 * x * y + p2 * (r2 + 2 * x * x) + s1 * r2 + s2 * r4,
        y * radial + p1 * (r2 + 2 * y * y) + 2 * p2 * x * y + s3 * r2 + s4 * r4,
    )


def distort_jacobian(points: FloatArray, coefficients: FloatArray) -> FloatArray:
    """Derivative of ``distort`` by the ideal coordinates, shape (N, 2, 2); same arguments."""
    points = require_shape(points, (None, 2), "points")
    if len(points) == 1 and coefficients.ndim == 1:
        x, y = points[0].tolist()
        try:
            return np.array(_slopes(x, y, coefficients.tolist())).reshape(1, 2, 2)
        except ZeroDivisionError:
            pass
    jacobian = np.empty((len(points), 2, 2))
    slopes = _slopes(points[:, 0], points[:, 1], coefficients)
    for place, slope in enumerate(slopes):
        jacobian[:, place // 2, place % 2] = slope
    return jacobian


def _slopes(x: Any, y: Any, coefficients: Iterable[float]) -> tuple[Any, Any, Any, Any]:
    """Of u by x and y, then of v; of numbers or of arrays."""
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


def undistort(points: FloatArray, coefficients: FloatArray) -> FloatArray:
    """Ideal normalised coordinates of distorted ones, both shape (N, 2).

    Newton's method on ``distort``; a point that no ideal point maps to (beyond the radius where
    distortion folds) comes back as NaN, so that nobody takes it for a measurement.
    """
    points = require_shape(points, (None, 2), "points")
    if not np.any(coefficients):
        return points.copy()
    if len(points) <= _FEW:
        try:
            return _undistort_few(points, coefficients)
        except ZeroDivisionError:
            pass
    ideal = points.copy()
    with np.errstate(all="ignore"):
        for _ in range(_NEWTON_STEPS):
            error = distort(ideal, coefficients) - points
            jacobian = distort_jacobian(ideal, coefficients)
            determinant = (
                jacobian[:, 0, 0] * jacobian[:, 1, 1] - jacobian[:, 0, 1] * jacobian[:, 1, 0]
            )
            step_x = (
                jacobian[:, 1, 1] * error[:, 0] - jacobian[:, 0, 1] * error[:, 1]
            ) / determinant
            step_y = (
                jacobian[:, 0, 0] * error[:, 1] - jacobian[:, 1, 0] * error[:, 0]
            ) / determinant
            ideal -= np.column_stack([step_x, step_y])
            if np.nanmax(np.abs(error), initial=0.0) < 1e-15:
                break
        residual = np.abs(distort(ideal, coefficients) - points).max(axis=1)
        reachable = np.hypot(ideal[:, 0], ideal[:, 1]) <= fold_radius(coefficients)
        ideal[~((residual < 1e-9) & reachable)] = np.nan
    return ideal


def _undistort_few(points: FloatArray, coefficients: FloatArray) -> FloatArray:
    """The same steps as for many, number by number: arrays of a few points are all overhead."""
    wanted, numbers = points.tolist(), coefficients.tolist()
    ideal = points.tolist()
    for _ in range(_NEWTON_STEPS):
        largest = 0.0
        for place, (x, y) in enumerate(ideal):
            u, v = _distorted(x, y, numbers)
            error_x, error_y = u - wanted[place][0], v - wanted[place][1]
            ux, uy, vx, vy = _slopes(x, y, numbers)
            determinant = ux * vy - uy * vx
            step_x = (vy * error_x - uy * error_y) / determinant
            step_y = (ux * error_y - vx * error_x) / determinant
            ideal[place] = [x - step_x, y - step_y]
            # A comparison with NaN is false, as nanmax leaves it out.
            for error in (abs(error_x), abs(error_y)):
                largest = error if error > largest else largest
        if largest < 1e-15:
            break
    fold = fold_radius(coefficients)
    for place, (x, y) in enumerate(ideal):
        u, v = _distorted(x, y, numbers)
        found = abs(u - wanted[place][0]) < 1e-9 and abs(v - wanted[place][1]) < 1e-9
        if not (found and np.hypot(x, y) <= fold):
            ideal[place] = [np.nan, np.nan]
    return np.array(ideal).reshape(-1, 2)


def fold_radius(coefficients: FloatArray) -> float:
    """Ideal radius up to which the distorted radius grows; infinite where it always does.

    Beyond it far points fold back into the picture, so they count as not visible.
    Tangential and prism terms are small and left out.
    """
    return _fold_radius(*coefficients[:8].tolist())


# A group is solved again on every edit, with the same few lenses.
@lru_cache(maxsize=1024)
def _fold_radius(
    k1: float, k2: float, _p1: float, _p2: float, k3: float, k4: float, k5: float, k6: float
) -> float:
    if k2 == k3 == k4 == k5 == k6 == 0.0:
        return float(np.sqrt(-1 / (3 * k1))) if k1 < 0 else np.inf
    # d/dr of r N(r^2) / D(r^2) is zero where N D + 2 s (N' D - N D') is, with s = r^2.
    numerator = np.polynomial.Polynomial([1.0, k1, k2, k3])
    denominator = np.polynomial.Polynomial([1.0, k4, k5, k6])
    s = np.polynomial.Polynomial([0.0, 1.0])
    slope = numerator * denominator + 2 * s * (
        numerator.deriv() * denominator - numerator * denominator.deriv()
    )
    roots = np.concatenate([_roots(slope), _roots(denominator)])
    real = roots.real[(np.abs(roots.imag) < 1e-9) & (roots.real > 0)]
    return float(np.sqrt(real.min())) if len(real) else np.inf


def _roots(polynomial: np.polynomial.Polynomial) -> np.ndarray[Any, Any]:
    """Roots; a highest term that is too small to divide by counts as none."""
    terms = polynomial.coef
    with np.errstate(all="ignore"):
        while len(terms) > 1 and not np.isfinite(terms[:-1] / terms[-1]).all():
            terms = terms[:-1]
    return np.polynomial.Polynomial(terms).roots()
