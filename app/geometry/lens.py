"""Lens: OpenCV's distortion on normalised image coordinates, and the models of distortion by name, each with its own
projection, inverse and derivative.

Coefficients stand in the order k1 k2 p1 p2 k3 k4 k5 k6 s1 s2 s3 s4 (OpenCV documentation,
"Camera Calibration and 3D Reconstruction").

A camera names its lens; nothing else asks which one it is but what needs a certain model.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from functools import lru_cache, partial
from typing import Any

import numpy as np
from numba import njit

from app.geometry import fisheye
from app.geometry.arrays import FloatArray, require_shape

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
    return np.column_stack(distort_coordinates(points[:, 0], points[:, 1], coefficients))


def distort_point(x: float, y: float, coefficients: Sequence[float]) -> tuple[float, float]:
    """``distort`` of one point, the same bits without the cost of arrays."""
    try:
        return distort_coordinates(x, y, coefficients)
    except ZeroDivisionError:
        u, v = distort_coordinates(np.float64(x), np.float64(y), coefficients)
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
    undistort_points(points, coefficients, fold_radius(coefficients), ideal)
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


_STEPS = 25
_AGAIN_AT = 0.6
"""Share of the fold from which a point is sought again that was not found from where it is seen: from
beyond the fold Newton's method may run away."""
_CLOSE, _THERE = 1e-9, 1e-15
"""How far, in normalised coordinates, a point may miss what it should be distorted to, and from where
on no step is of use."""

compiled = njit(cache=True, error_model="numpy", nogil=True)


def distort_coordinates(x: Any, y: Any, coefficients: Iterable[float]) -> tuple[Any, Any]:
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
    """``distort_jacobian``, of u by x and y, then of v; of numbers or of arrays, as ``distort_coordinates``."""
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


distorted_fast = compiled(distort_coordinates)
slopes_fast = compiled(distortion_derivatives)


# Types are checked by hand from here on: numba compiles these functions from their arguments.


@compiled
def read_lens_coefficients(numbers):
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
def undistort_points(points, coefficients, fold, ideal):
    """Writes what is distorted to each point, by Newton's method; NaN where nothing within the fold is."""
    lens = read_lens_coefficients(coefficients)
    for row in range(len(points)):
        share = 1.0
        for _ in range(2):
            x, y = share * points[row, 0], share * points[row, 1]
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
            if found and math.hypot(x, y) <= fold:
                break
            x, y = math.nan, math.nan
            share = _AGAIN_AT * fold / math.hypot(points[row, 0], points[row, 1])
            if not share < 1:
                break
        ideal[row, 0], ideal[row, 1] = x, y


BROWN_CONRADY, FISHEYE, ARCTAN_POLYNOMIAL = "brown_conrady", "fisheye", "arctan_polynomial"
"""OpenCV's full model, which every format of the field holds; and two for strong wide angle."""


@dataclass(frozen=True)
class LensModel:
    """How a lens bends rays: functions of normalised coordinates and coefficients.

    Attributes:
        count: How many coefficients there are.
        distort: Distorted coordinates of ideal ones, both shape (N, 2).
        distort_point: The same of one point, the same bits.
        jacobian: Derivative of ``distort`` by the ideal coordinates, shape (N, 2, 2).
        undistort: Ideal coordinates of distorted ones, NaN where there are none, shape (N, 2).
        fold_radius: Ideal radius of the edge of what the lens shows.
        check: Raises DegenerateGeometryError for coefficients of no lens.
        profile: Image radius by angle, of a lens of ``geometry.fisheye``.
    """

    count: int
    distort: Callable[[FloatArray, FloatArray], FloatArray]
    distort_point: Callable[[float, float, Sequence[float]], tuple[float, float]]
    jacobian: Callable[[FloatArray, FloatArray], FloatArray]
    undistort: Callable[[FloatArray, FloatArray], FloatArray]
    fold_radius: Callable[[FloatArray], float]
    check: Callable[[Sequence[float]], object]
    profile: fisheye.ProfileOf | None = None


def _make_fisheye_model(count: int, profile: fisheye.ProfileOf) -> LensModel:
    """A lens of ``geometry.fisheye``."""
    return LensModel(
        count=count,
        distort=partial(_distort_by_profile, profile),
        distort_point=partial(_distort_point_by_profile, profile),
        jacobian=partial(_distort_jacobian_by_profile, profile),
        undistort=partial(_undistort_by_profile, profile),
        fold_radius=partial(_fold_radius_of_profile, profile),
        check=profile,
        profile=profile,
    )


def _distort_by_profile(
    profile: fisheye.ProfileOf, points: FloatArray, numbers: FloatArray
) -> FloatArray:
    return fisheye.distort(points, profile(numbers.tolist()))


def _distort_point_by_profile(
    profile: fisheye.ProfileOf, x: float, y: float, numbers: Sequence[float]
) -> tuple[float, float]:
    u, v = fisheye.distort(np.array([[x, y]]), profile(numbers))[0].tolist()
    return u, v


def _distort_jacobian_by_profile(
    profile: fisheye.ProfileOf, points: FloatArray, numbers: FloatArray
) -> FloatArray:
    return fisheye.distort_jacobian(points, profile(numbers.tolist()))


def _undistort_by_profile(
    profile: fisheye.ProfileOf, points: FloatArray, numbers: FloatArray
) -> FloatArray:
    return fisheye.undistort(points, profile(numbers.tolist()))


def _fold_radius_of_profile(profile: fisheye.ProfileOf, numbers: FloatArray) -> float:
    return float(np.tan(profile(numbers.tolist()).widest))


def _accept_any_coefficients(_numbers: Sequence[float]) -> None:
    """Every set of coefficients is a lens of OpenCV's."""


LENSES: dict[str, LensModel] = {
    BROWN_CONRADY: LensModel(
        count=COEFFICIENTS,
        distort=distort,
        distort_point=distort_point,
        jacobian=distort_jacobian,
        undistort=undistort,
        fold_radius=fold_radius,
        check=_accept_any_coefficients,
    ),
    FISHEYE: _make_fisheye_model(fisheye.KANNALA_BRANDT, fisheye.kannala_brandt),
    ARCTAN_POLYNOMIAL: _make_fisheye_model(fisheye.ARCTAN_POLYNOMIAL, fisheye.arctan_polynomial),
}
