"""Lens: the distortion models by name, each with its own projection, inverse and derivative.

A camera names its lens; nothing else asks which one it is but what needs a certain model.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial

import numpy as np

from app.geometry import distortion, fisheye
from app.geometry.arrays import FloatArray

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


def _fisheye_model(count: int, profile: fisheye.ProfileOf) -> LensModel:
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
        count=distortion.COEFFICIENTS,
        distort=distortion.distort,
        distort_point=distortion.distort_point,
        jacobian=distortion.distort_jacobian,
        undistort=distortion.undistort,
        fold_radius=distortion.fold_radius,
        check=_accept_any_coefficients,
    ),
    FISHEYE: _fisheye_model(fisheye.KANNALA_BRANDT, fisheye.kannala_brandt),
    ARCTAN_POLYNOMIAL: _fisheye_model(fisheye.ARCTAN_POLYNOMIAL, fisheye.arctan_polynomial),
}
