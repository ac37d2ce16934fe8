"""Lens distortion: OpenCV's full model on normalised image coordinates.

Coefficients stand in the order k1 k2 p1 p2 k3 k4 k5 k6 s1 s2 s3 s4 (OpenCV documentation,
"Camera Calibration and 3D Reconstruction").
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from functools import lru_cache
from typing import Any

import numpy as np

from app.geometry.arrays import FloatArray, require_shape
from app.geometry.lens_kernels import distorted, distortion_derivatives, undistort_all

COEFFICIENTS = 12


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
    return np.column_stack(distorted(points[:, 0], points[:, 1], coefficients))


def distort_point(x: float, y: float, coefficients: Sequence[float]) -> tuple[float, float]:
    """``distort`` of one point, the same bits without the cost of arrays."""
    try:
        return distorted(x, y, coefficients)
    except ZeroDivisionError:
        u, v = distorted(np.float64(x), np.float64(y), coefficients)
        return float(u), float(v)


def distort_jacobian(points: FloatArray, coefficients: FloatArray) -> FloatArray:
    """Derivative of ``distort`` by the ideal coordinates, shape (N, 2, 2); same arguments."""
    points = require_shape(points, (None, 2), "points")
    if len(points) == 1 and coefficients.ndim == 1:
        x, y = points[0].tolist()
        try:
            return np.array(distortion_derivatives(x, y, coefficients.tolist())).reshape(1, 2, 2)
        except ZeroDivisionError:
            pass
    jacobian = np.empty((len(points), 2, 2))
    found = distortion_derivatives(points[:, 0], points[:, 1], coefficients)
    for place, slope in enumerate(found):
        jacobian[:, place // 2, place % 2] = slope
    return jacobian


def undistort(points: FloatArray, coefficients: FloatArray) -> FloatArray:
    """Ideal normalised coordinates of distorted ones, both shape (N, 2).

    Newton's method on ``distort``; a point that no ideal point maps to (beyond the radius where
    distortion folds) comes back as NaN, so that nobody takes it for a measurement.
    """
    points = require_shape(points, (None, 2), "points")
    if not np.any(coefficients):
        return points.copy()
    ideal = np.empty_like(points)
    undistort_all(points, coefficients, fold_radius(coefficients), ideal)
    return ideal


def fold_radius(coefficients: FloatArray) -> float:
    """Ideal radius up to which the distorted radius grows; infinite where it always does.

    Beyond it far points fold back into the picture, so they count as not visible.
    Tangential and prism terms are small and left out.
    """
    return _fold_radius_of_terms(*coefficients[:8].tolist())


# A group is solved again on every edit, with the same few lenses.
@lru_cache(maxsize=1024)
def _fold_radius_of_terms(
    k1: float, k2: float, _p1: float, _p2: float, k3: float, k4: float, k5: float, k6: float
) -> float:
    if k3 == k4 == k5 == k6 == 0.0:
        return _fold_radius_of_two_terms(k1, k2)
    # d/dr of r N(r^2) / D(r^2) is zero where N D + 2 s (N' D - N D') is, with s = r^2.
    numerator = np.polynomial.Polynomial([1.0, k1, k2, k3])
    denominator = np.polynomial.Polynomial([1.0, k4, k5, k6])
    s = np.polynomial.Polynomial([0.0, 1.0])
    slope = numerator * denominator + 2 * s * (
        numerator.deriv() * denominator - numerator * denominator.deriv()
    )
    roots = np.concatenate([_polynomial_roots(slope), _polynomial_roots(denominator)])
    real = roots.real[(np.abs(roots.imag) < 1e-9) & (roots.real > 0)]
    return float(np.sqrt(real.min())) if len(real) else np.inf


def _fold_radius_of_two_terms(k1: float, k2: float) -> float:
    """Where 1 + 3 k1 s + 5 k2 s^2 is zero first, s = r^2: that is what a resected camera has."""
    half = 1.5 * k1
    under = half * half - 5 * k2
    if not under >= 0:
        return math.inf
    root = math.sqrt(under)
    # The larger 1 / s, written so that nothing cancels.
    inverse = root - half if half < 0 else -5 * k2 / ((root + half) or 1.0)
    return math.sqrt(1 / inverse) if inverse > 0 else math.inf


def _polynomial_roots(polynomial: np.polynomial.Polynomial) -> np.ndarray[Any, Any]:
    """Roots; a highest term that is too small to divide by counts as none."""
    terms = polynomial.coef
    with np.errstate(all="ignore"):
        while len(terms) > 1 and not np.isfinite(terms[:-1] / terms[-1]).all():
            terms = terms[:-1]
    return np.polynomial.Polynomial(terms).roots()
