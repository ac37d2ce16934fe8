"""Fisheye: lenses whose image radius is a polynomial of the angle between a ray and the axis.

Two spellings of one model, on normalised image coordinates like ``geometry.lens``:

- Kannala-Brandt, k1 k2 k3 k4: ``r = t + k1 t^3 + k2 t^5 + k3 t^7 + k4 t^9`` (``cv2.fisheye``).
- Arctangent polynomial, a0 .. a8: ``r = a0 + a1 t + ... + a8 t^8`` with ``t = arctan(R)``, R the
  ideal radius (Spiideo SoccerNet SynLoc; its files give the highest term first, and divide by the
  image width, which is the focal length then).

Sources: J. Kannala, S. Brandt, "A generic camera model", PAMI 28 (2006), eq. 6; H. Ardo et al.,
"Spiideo SoccerNet SynLoc", VISAPP 2025.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import lru_cache
from typing import Any

import numpy as np

from app.errors import DegenerateGeometryError
from app.geometry.arrays import FloatArray, require_shape

KANNALA_BRANDT, ARCTAN_POLYNOMIAL = 4, 9
"""How many coefficients each spelling has."""
WIDEST = np.pi / 2 - 1e-3
"""Radians off the axis up to which a ray has ideal coordinates: a camera looks forwards."""
NARROWEST = 0.05
"""Radians off the axis that a lens shows at least; one that folds sooner is none."""
MAX_CONSTANT = 0.005
"""The constant term of a polynomial is at most this share of its linear one."""
_INNER = 10.0
"""Within as many times the constant term the radius is taken to the axis in a straight line."""
_GRID = 1e-3
_STEPS = 60


@dataclass(frozen=True)
class RadiusProfile:
    """Image radius by angle, increasing from 0 at the axis to the edge of the picture.

    Attributes:
        terms: Of the polynomial, the constant one first.
        inner: Angle within which the radius is ``slope`` times the angle instead. A polynomial that
            was fitted to a lens leaves a constant behind, which would tear the picture
            open at the axis.
        slope: Of the radius there.
        widest: Largest angle that the lens shows, radians.
        edge: Radius there.
    """

    terms: tuple[float, ...]
    inner: float
    slope: float
    widest: float
    edge: float

    def radius(self, angle: FloatArray) -> FloatArray:
        """Image radius of angles, shape (N,)."""
        return np.where(
            angle < self.inner, self.slope * angle, _polynomial_value(self.terms, angle)
        )

    def radius_derivative(self, angle: FloatArray) -> FloatArray:
        """Derivative of the radius by the angle, shape (N,)."""
        return np.where(
            angle < self.inner,
            self.slope,
            _polynomial_value(_polynomial_derivative(self.terms), angle),
        )

    def angle(self, radius: FloatArray) -> FloatArray:
        """The angle of each image radius, NaN beyond the edge, shape (N,).

        Newton's method, halving the interval wherever a step would leave it.
        """
        low, high = np.zeros_like(radius), np.full_like(radius, self.widest)
        angle = np.clip(radius / self.slope, low, high)
        settled = np.zeros(radius.shape, bool)
        for _ in range(_STEPS):
            error = self.radius(angle) - radius
            low, high = np.where(error < 0, angle, low), np.where(error > 0, angle, high)
            with np.errstate(all="ignore"):
                moved = angle - error / self.radius_derivative(angle)
            inside = (moved >= low) & (moved <= high)
            moved = np.where(error == 0, angle, np.where(inside, moved, (low + high) / 2))
            # What has settled stays: a point is the same among others as it is alone.
            moved = np.where(settled, angle, moved)
            settled |= np.abs(moved - angle) <= 4e-16 * np.abs(angle)
            angle = moved
            if settled.all():
                break
        found: FloatArray = np.where(radius <= self.edge, angle, np.nan)
        return found


def kannala_brandt(coefficients: Sequence[float]) -> RadiusProfile:
    """Profile of k1 k2 k3 k4.

    Raises:
        DegenerateGeometryError: The picture folds next to the axis.
    """
    k1, k2, k3, k4 = coefficients
    return _make_profile((0.0, 1.0, 0.0, k1, 0.0, k2, 0.0, k3, 0.0, k4))


def arctan_polynomial(coefficients: Sequence[float]) -> RadiusProfile:
    """Profile of a0 .. a8.

    Raises:
        DegenerateGeometryError: The radius does not grow from (nearly) zero at the axis.
    """
    return _make_profile(tuple(coefficients))


# A group is solved again on every edit, with the same few lenses.
@lru_cache(maxsize=1024)
def _make_profile(terms: tuple[float, ...]) -> RadiusProfile:
    constant, linear = terms[0], terms[1]
    if not (linear > 0 and abs(constant) <= MAX_CONSTANT * linear):
        raise DegenerateGeometryError(
            "the polynomial of the lens does not grow from zero at the axis",
            hint="Give the constant term first, and the radius in units of the focal length.",
        )
    inner = _INNER * abs(constant) / linear
    widest = _find_widest_angle(terms, inner)
    if widest < NARROWEST:
        raise DegenerateGeometryError(
            "the picture of the lens folds next to the axis",
            hint="Check the order and the signs of its coefficients.",
        )
    slope = float(_polynomial_value(terms, np.float64(inner))) / inner if inner > 0 else linear
    edge = float(_polynomial_value(terms, np.float64(widest)))
    return RadiusProfile(terms, inner, slope, widest, edge)


def _find_widest_angle(terms: tuple[float, ...], inner: float) -> float:
    """Where the radius stops growing, found in small steps and halved; at most ``WIDEST``."""
    growth = _polynomial_derivative(terms)
    angles = np.append(np.arange(inner, WIDEST, _GRID), WIDEST)
    stopped = np.flatnonzero(~(_polynomial_value(growth, angles) > 0))
    if len(stopped) == 0:
        return WIDEST
    low, high = float(angles[max(stopped[0] - 1, 0)]), float(angles[stopped[0]])
    for _ in range(_STEPS):
        middle = (low + high) / 2
        if _polynomial_value(growth, np.float64(middle)) > 0:
            low = middle
        else:
            high = middle
    return low


def distort(points: FloatArray, profile: RadiusProfile) -> FloatArray:
    """Distorted normalised coordinates of ideal ones, NaN beyond the edge, both shape (N, 2)."""
    points = require_shape(points, (None, 2), "points")
    ideal, angle = _radius_and_angle(points)
    distorted: FloatArray = points * _radius_ratio(profile, ideal, angle)[:, None]
    distorted[~(angle <= profile.widest)] = np.nan
    return distorted


def distort_jacobian(points: FloatArray, profile: RadiusProfile) -> FloatArray:
    """Derivative of ``distort`` by the ideal coordinates, NaN beyond the edge, shape (N, 2, 2).

    Along the radius the angle grows by ``1 / (1 + R^2)``; across it the picture is only scaled.
    """
    points = require_shape(points, (None, 2), "points")
    ideal, angle = _radius_and_angle(points)
    across = _radius_ratio(profile, ideal, angle)
    along = profile.radius_derivative(angle) / (1 + ideal * ideal)
    outwards = points / np.where(ideal > 0, ideal, 1.0)[:, None]
    radial = outwards[:, :, None] * outwards[:, None, :]
    jacobian: FloatArray = (
        across[:, None, None] * np.eye(2) + (along - across)[:, None, None] * radial
    )
    jacobian[~(angle <= profile.widest)] = np.nan
    return jacobian


def undistort(points: FloatArray, profile: RadiusProfile) -> FloatArray:
    """Ideal normalised coordinates of distorted ones, both shape (N, 2).

    NaN beyond the edge: there the lens folds, or looks sideways and back, and no ray in front of
    the camera belongs to the pixel.
    """
    points = require_shape(points, (None, 2), "points")
    radius = np.hypot(points[:, 0], points[:, 1])
    angle = profile.angle(radius)
    ratio = np.where(radius > 0, np.tan(angle) / np.where(radius > 0, radius, 1.0), 1.0)
    ideal: FloatArray = points * ratio[:, None]
    return ideal


def _radius_and_angle(points: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Ideal radius and angle off the axis, shapes (N,)."""
    ideal = np.hypot(points[:, 0], points[:, 1])
    return ideal, np.arctan(ideal)


def _radius_ratio(profile: RadiusProfile, ideal: FloatArray, angle: FloatArray) -> FloatArray:
    """Image radius over ideal radius, at the axis its limit, shape (N,)."""
    near = ideal == 0
    ratio: FloatArray = np.where(
        near, profile.slope, profile.radius(angle) / np.where(near, 1.0, ideal)
    )
    return ratio


def _polynomial_value(terms: Sequence[float], at: Any) -> Any:
    """Horner's scheme, of a number or of an array."""
    total = at * 0.0
    for term in reversed(terms):
        total = total * at + term
    return total


@lru_cache(maxsize=1024)
def _polynomial_derivative(terms: tuple[float, ...]) -> tuple[float, ...]:
    return tuple(power * term for power, term in enumerate(terms))[1:]


ProfileOf = Callable[[Sequence[float]], RadiusProfile]
