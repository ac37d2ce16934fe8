"""Lenses: how each bends rays, on normalised image coordinates (docs/coordinates.md).

A lens has three functions: ``distort`` (ideal to picture), ``undistort`` (picture to ideal), both
arrays of shape (N, 2), and ``fold``, the ideal radius of the edge of what it shows.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any, Protocol

import numpy as np
import numpy.typing as npt

from touchline.errors import CameraError

FloatArray = npt.NDArray[np.float64]
BROWN_CONRADY, FISHEYE, ARCTAN_POLYNOMIAL = "brown_conrady", "fisheye", "arctan_polynomial"
COEFFICIENTS = {BROWN_CONRADY: 12, FISHEYE: 4, ARCTAN_POLYNOMIAL: 9}
"""How many coefficients each lens has."""
WIDEST = np.pi / 2 - 1e-3
"""Radians off the axis up to which a lens looks: forwards."""
_NEWTON_STEPS, _ANGLE_STEPS, _GRID = 25, 60, 1e-3
_INNER = 10.0
"""Within as many times the constant term the radius goes to the axis in a straight line."""


class Lens(Protocol):
    """How a lens bends rays."""

    @property
    def fold(self) -> float:
        """Ideal radius of the edge of what the lens shows."""

    def distort(self, ideal: FloatArray) -> FloatArray:
        """Picture coordinates of ideal ones, shape (N, 2)."""

    def undistort(self, bent: FloatArray) -> FloatArray:
        """Ideal coordinates of picture ones, NaN where no ray is, shape (N, 2)."""


def lens_of(name: str, coefficients: Sequence[float]) -> Lens:
    """The lens of a name.

    Args:
        name: ``brown_conrady``, ``fisheye`` or ``arctan_polynomial``.
        coefficients: k1 k2 p1 p2 k3 k4 k5 k6 s1 s2 s3 s4; k1 k2 k3 k4; a0 .. a8.

    Raises:
        CameraError: There is no such lens, or it has another number of coefficients.
    """
    numbers = tuple(map(float, coefficients))
    if COEFFICIENTS.get(name) != len(numbers):
        known = ", ".join(f"{lens} ({count})" for lens, count in COEFFICIENTS.items())
        raise CameraError(
            f'"{name}" with {len(numbers)} coefficients is not a known lens',
            f"There are {known}.",
        )
    if name == BROWN_CONRADY:
        return BrownConrady(numbers)
    if name == FISHEYE:
        k1, k2, k3, k4 = numbers
        return ByAngle((0.0, 1.0, 0.0, k1, 0.0, k2, 0.0, k3, 0.0, k4))
    return ByAngle(numbers)


@dataclass(frozen=True)
class BrownConrady:
    """OpenCV's full model without its tilt terms.

    Source: OpenCV documentation, "Camera Calibration and 3D Reconstruction".
    """

    coefficients: tuple[float, ...]

    def distort(self, ideal: FloatArray) -> FloatArray:
        """Picture coordinates of ideal ones, shape (N, 2)."""
        x, y = ideal.T
        _, _, p1, p2, *_, s1, s2, s3, s4 = self.coefficients
        radial, _, r2 = self._radial(x, y)
        u = x * radial + 2 * p1 * x * y + p2 * (r2 + 2 * x * x) + s1 * r2 + s2 * r2 * r2
        v = y * radial + p1 * (r2 + 2 * y * y) + 2 * p2 * x * y + s3 * r2 + s4 * r2 * r2
        return np.column_stack([u, v])

    def undistort(self, bent: FloatArray) -> FloatArray:
        """Ideal coordinates of picture ones by Newton's method, NaN where no ray is."""
        if not any(self.coefficients):
            return bent.copy()
        ideal = bent.copy()
        with np.errstate(all="ignore"):
            for _ in range(_NEWTON_STEPS):
                error = self.distort(ideal) - bent
                ux, uy, vx, vy = self._slopes(*ideal.T)
                step = [vy * error[:, 0] - uy * error[:, 1], ux * error[:, 1] - vx * error[:, 0]]
                ideal -= np.column_stack(step) / (ux * vy - uy * vx)[:, None]
                if np.nanmax(np.abs(error), initial=0.0) < 1e-15:
                    break
            found = np.abs(self.distort(ideal) - bent).max(axis=1) < 1e-9
            ideal[~(found & (np.hypot(*ideal.T) <= self.fold))] = np.nan
        return ideal

    @cached_property
    def fold(self) -> float:
        """Ideal radius up to which the radius in the picture grows; infinite where it always does.

        Tangential and prism terms are small and left out.
        """
        k1, k2, _, _, k3, k4, k5, k6, *_ = self.coefficients
        if k2 == k3 == k4 == k5 == k6 == 0.0:
            return float(np.sqrt(-1 / (3 * k1))) if k1 < 0 else float("inf")
        # d/dr of r N(r^2) / D(r^2) is zero where N D + 2 s (N' D - N D') is, with s = r^2.
        polynomial = np.polynomial.Polynomial
        over, under = polynomial([1.0, k1, k2, k3]), polynomial([1.0, k4, k5, k6])
        slope = over * under + 2 * polynomial([0.0, 1.0]) * (
            over.deriv() * under - over * under.deriv()
        )
        roots = np.concatenate([_roots(slope), _roots(under)])
        real = roots.real[(np.abs(roots.imag) < 1e-9) & (roots.real > 0)]
        return float(np.sqrt(real.min())) if len(real) else float("inf")

    def _radial(self, x: Any, y: Any) -> tuple[Any, Any, Any]:
        """The radial factor, its derivative by r^2, and r^2."""
        k1, k2, _, _, k3, k4, k5, k6, *_ = self.coefficients
        r2 = x * x + y * y
        r4 = r2 * r2
        under = 1 + k4 * r2 + k5 * r4 + k6 * r4 * r2
        radial = (1 + k1 * r2 + k2 * r4 + k3 * r4 * r2) / under
        slope = (k1 + 2 * k2 * r2 + 3 * k3 * r4) - radial * (k4 + 2 * k5 * r2 + 3 * k6 * r4)
        return radial, slope / under, r2

    def _slopes(self, x: Any, y: Any) -> tuple[Any, Any, Any, Any]:
        """Derivatives of ``distort``: of u by x and y, of v by x and y."""
        _, _, p1, p2, *_, s1, s2, s3, s4 = self.coefficients
        radial, slope, r2 = self._radial(x, y)
        across, down = 2 * (s1 + 2 * s2 * r2), 2 * (s3 + 2 * s4 * r2)
        return (
            radial + 2 * x * x * slope + 2 * p1 * y + 6 * p2 * x + x * across,
            2 * x * y * slope + 2 * p1 * x + 2 * p2 * y + y * across,
            2 * x * y * slope + 2 * p1 * x + 2 * p2 * y + x * down,
            radial + 2 * y * y * slope + 6 * p1 * y + 2 * p2 * x + y * down,
        )


@dataclass(frozen=True)
class ByAngle:
    """A lens whose radius in the picture is a polynomial of the angle off the axis.

    Sources: J. Kannala, S. Brandt, "A generic camera model", PAMI 28 (2006), eq. 6; H. Ardo et
    al., "Spiideo SoccerNet SynLoc", VISAPP 2025.

    Attributes:
        terms: Of the polynomial, the constant one first.
    """

    terms: tuple[float, ...]

    def __post_init__(self) -> None:
        constant, linear = self.terms[:2]
        if not (linear > 0 and abs(constant) <= 0.005 * linear):
            raise CameraError("the polynomial of the lens does not grow from zero at the axis")

    @property
    def fold(self) -> float:
        """Ideal radius of the edge of what the lens shows."""
        return float(np.tan(self._widest))

    def distort(self, ideal: FloatArray) -> FloatArray:
        """Picture coordinates of ideal ones, NaN beyond the edge, shape (N, 2)."""
        radius = np.hypot(*ideal.T)
        angle = np.arctan(radius)
        near = radius == 0
        ratio = np.where(near, self._slope, self._radius(angle) / np.where(near, 1.0, radius))
        bent: FloatArray = ideal * ratio[:, None]
        bent[~(angle <= self._widest)] = np.nan
        return bent

    def undistort(self, bent: FloatArray) -> FloatArray:
        """Ideal coordinates of picture ones, NaN beyond the edge, shape (N, 2)."""
        radius = np.hypot(*bent.T)
        near = radius == 0
        ratio = np.where(near, 1.0, np.tan(self._angle(radius)) / np.where(near, 1.0, radius))
        ideal: FloatArray = bent * ratio[:, None]
        return ideal

    def _angle(self, radius: FloatArray) -> FloatArray:
        """The angle of each radius: Newton's method, halving where a step would leave the rest."""
        low, high = np.zeros_like(radius), np.full_like(radius, self._widest)
        angle = np.clip(radius / self._slope, low, high)
        settled = np.zeros(radius.shape, bool)
        for _ in range(_ANGLE_STEPS):
            error = self._radius(angle) - radius
            low, high = np.where(error < 0, angle, low), np.where(error > 0, angle, high)
            with np.errstate(all="ignore"):
                moved = angle - error / self._growth(angle)
            inside = (moved >= low) & (moved <= high)
            moved = np.where(error == 0, angle, np.where(inside, moved, (low + high) / 2))
            # What has settled stays: a point is the same among others as it is alone.
            moved = np.where(settled, angle, moved)
            settled |= np.abs(moved - angle) <= 4e-16 * np.abs(angle)
            angle = moved
            if settled.all():
                break
        edge = float(_value(self.terms, self._widest))
        found: FloatArray = np.where(radius <= edge, angle, np.nan)
        return found

    def _radius(self, angle: FloatArray) -> FloatArray:
        inner: FloatArray = self._slope * angle
        return np.where(angle < self._inner, inner, _value(self.terms, angle))

    def _growth(self, angle: FloatArray) -> FloatArray:
        return np.where(angle < self._inner, self._slope, _value(_derivative(self.terms), angle))

    @cached_property
    def _inner(self) -> float:
        """Angle within which the radius is a straight line, or the constant would tear the axis."""
        return _INNER * abs(self.terms[0]) / self.terms[1]

    @cached_property
    def _slope(self) -> float:
        inner = self._inner
        return float(_value(self.terms, inner)) / inner if inner > 0 else self.terms[1]

    @cached_property
    def _widest(self) -> float:
        """Where the radius stops growing, at most ``WIDEST``."""
        growth = _derivative(self.terms)
        angles = np.append(np.arange(self._inner, WIDEST, _GRID), WIDEST)
        stopped = np.flatnonzero(~(_value(growth, angles) > 0))
        if len(stopped) == 0:
            return float(WIDEST)
        low, high = float(angles[max(stopped[0] - 1, 0)]), float(angles[stopped[0]])
        for _ in range(_ANGLE_STEPS):
            middle = (low + high) / 2
            low, high = (middle, high) if _value(growth, middle) > 0 else (low, middle)
        return low


def _value(terms: Sequence[float], at: Any) -> Any:
    """Horner's scheme, of a number or of an array."""
    total = at * 0.0
    for term in reversed(terms):
        total = total * at + term
    return total


def _derivative(terms: tuple[float, ...]) -> tuple[float, ...]:
    return tuple(power * term for power, term in enumerate(terms))[1:]


def _roots(polynomial: np.polynomial.Polynomial) -> npt.NDArray[Any]:
    """Roots; a highest term that is too small to divide by counts as none."""
    terms = polynomial.coef
    with np.errstate(all="ignore"):
        while len(terms) > 1 and not np.isfinite(terms[:-1] / terms[-1]).all():
            terms = terms[:-1]
    return np.polynomial.Polynomial(terms).roots()
