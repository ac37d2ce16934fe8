"""Resection: the camera that puts known curves of space through points of its image.

The unknowns of one camera are a row of ``PARAMETERS`` numbers: pan, tilt, roll (radians), the
position (metres), the logarithm of the focal length (pixels) and kappa, the radial
displacement at half the diagonal as a share of it: an ideal pixel at radius rho from the
principal point appears at ``rho (1 + u + u^2 / 2)`` with ``u = kappa (rho / half_diagonal)^2``.
That is OpenCV's k1 = kappa (f / half_diagonal)^2 in a form that does not depend on the focal
length, with k2 = k1^2 / 2 tied to it: below a tenth of a pixel inside real pictures, and the
radius then grows everywhere, so that no far point folds back into the picture.

The residual of a point is its signed distance to the projected curve. The place on the curve
is eliminated: at the nearest place the derivative of the distance by that place is zero, so the
derivative by the camera is taken with the place held (variable projection). Beyond the end of
a segment or arc both components of the offset to the end count.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from app.geometry.arrays import FloatArray
from app.geometry.camera import Camera, pan_tilt_roll_from_rotation, rotation_from_pan_tilt_roll
from app.geometry.curve_residuals import (
    accumulate_equations,
    derivative_rows_of_points,
    residual_rows,
)
from app.geometry.least_squares import CONVERGED, OUT_OF_STEPS, STUCK, LeastSquaresResult
from app.geometry.resection_kernels import minimize_curve_costs

PARAMETERS = 8
PAN, TILT, ROLL, X, Y, Z, LOG_FOCAL, KAPPA = range(PARAMETERS)

SEGMENT, ARC = 0, 1
NAMES = (CONVERGED, OUT_OF_STEPS, STUCK)
"""Why a start stopped, by the number that ``resection_kernels`` has for it."""

IntArray = npt.NDArray[np.int64]


@dataclass(frozen=True)
class Curves:
    """Known curves of space.

    Attributes:
        kinds: ``SEGMENT`` or ``ARC``, shape (M,).
        shapes: Segments: start xyz and end xyz. Arcs in the plane z = 0: centre x and y,
            radius, first and last angle, 0. Metres and radians, shape (M, 6).
    """

    kinds: IntArray
    shapes: FloatArray


@dataclass(frozen=True)
class CurvePoints:
    """Image points that lie on the curves.

    Attributes:
        pixels: Relative to the principal point, shape (N, 2).
        curve: Index of each point's curve, shape (N,), grouped and increasing.
        weight: Weight of each point, shape (N,).
    """

    pixels: FloatArray
    curve: IntArray
    weight: FloatArray


@dataclass(frozen=True)
class GaussianPrior:
    """Gaussian prior: ``(parameters - mean) / sigma``; an infinite sigma is no prior.

    Attributes:
        mean: Shape (8,).
        sigma: Shape (8,).
    """

    mean: FloatArray
    sigma: FloatArray


def camera_from_parameters(
    parameters: FloatArray, principal_point: tuple[float, float], half_diagonal: float
) -> Camera:
    """Camera of one row of parameters.

    Args:
        parameters: Shape (8,).
        principal_point: Pixels.
        half_diagonal: Half the image diagonal, pixels, to which kappa refers.
    """
    pan, tilt, roll = (float(angle) for angle in parameters[PAN : ROLL + 1])
    focal = float(np.exp(parameters[LOG_FOCAL]))
    distortion = np.zeros(12)
    distortion[0] = parameters[KAPPA] * (focal / half_diagonal) ** 2
    distortion[1] = distortion[0] ** 2 / 2
    return Camera(
        rotation=rotation_from_pan_tilt_roll(pan, tilt, roll),
        position=parameters[X : Z + 1],
        focal_length=(focal, focal),
        principal_point=principal_point,
        distortion=distortion,
    )


def parameters_from_camera(camera: Camera, half_diagonal: float) -> FloatArray:
    """Row of parameters nearest to a camera; terms other than k1 are left out, shape (8,)."""
    focal = float(np.sqrt(camera.focal_length[0] * camera.focal_length[1]))
    kappa = camera.distortion[0] * (half_diagonal / focal) ** 2
    angles = pan_tilt_roll_from_rotation(camera.rotation)
    return np.array([*angles, *camera.position, np.log(focal), kappa])


def normal_equations(
    parameters: FloatArray,
    curves: Curves,
    curve_points: CurvePoints,
    prior: GaussianPrior,
    scale_px: float,
    half_diagonal: float,
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Cost, gradient and J^T W J of the soft-L1 loss for each row of parameters.

    The loss of a distance d is ``2 c^2 (sqrt(1 + (d / c)^2) - 1) / 2`` with c = ``scale_px``,
    and J^T W J uses its weight ``1 / sqrt(1 + (d / c)^2)``.

    Args:
        parameters: Shape (B, 8).

    Returns:
        Shapes (B,), (B, 8) and (B, 8, 8); pixels squared.
    """
    count = len(parameters)
    cost = np.empty(count)
    gradient = np.empty((count, PARAMETERS))
    information = np.empty((count, PARAMETERS, PARAMETERS))
    accumulate_equations(
        np.ascontiguousarray(parameters),
        curves.kinds,
        curves.shapes,
        curve_points.pixels,
        curve_points.curve,
        curve_points.weight,
        prior.mean,
        prior.sigma,
        scale_px,
        half_diagonal,
        cost,
        gradient,
        information,
    )
    return cost, gradient, information


def fit_camera_to_curves(
    start: FloatArray,
    curves: Curves,
    curve_points: CurvePoints,
    prior: GaussianPrior,
    scale_px: float,
    half_diagonal: float,
    steps: int,
    *,
    tolerance: float,
    damping: float,
) -> LeastSquaresResult:
    """``levenberg_marquardt`` on ``normal_equations`` with its rounds compiled, bit for bit.

    Args:
        start: Shape (B, 8).
    """
    parameters = np.array(start, dtype=np.float64)
    count = len(parameters)
    cost, gradient = np.empty(count), np.empty((count, PARAMETERS))
    information = np.empty((count, PARAMETERS, PARAMETERS))
    accepted, rejected = np.zeros(count), np.zeros(count)
    reasons = np.full(count, NAMES.index(OUT_OF_STEPS))
    minimize_curve_costs(
        parameters,
        curves.kinds,
        curves.shapes,
        curve_points.pixels,
        curve_points.curve,
        curve_points.weight,
        prior.mean,
        prior.sigma,
        scale_px,
        half_diagonal,
        steps,
        tolerance,
        damping,
        cost,
        gradient,
        information,
        accepted,
        rejected,
        reasons,
    )
    names = tuple(NAMES[reason] for reason in reasons.tolist())
    return LeastSquaresResult(parameters, cost, information, accepted, rejected, names)


def curve_distances(
    parameters: FloatArray, curves: Curves, curve_points: CurvePoints, half_diagonal: float
) -> FloatArray:
    """Distance of each point to its projected curve, pixels, shape (N,).

    Args:
        parameters: One camera, shape (8,).
    """
    offsets, _ = curve_residuals(parameters, curves, curve_points, half_diagonal)
    distance: FloatArray = np.hypot(offsets[:, 0], offsets[:, 1])
    return distance


def curve_residuals(
    parameters: FloatArray, curves: Curves, curve_points: CurvePoints, half_diagonal: float
) -> tuple[FloatArray, FloatArray]:
    """Offset of each point from its projected curve and its derivatives by the camera.

    Args:
        parameters: One camera, shape (8,).

    Returns:
        Normal to the curve and along it (zero but beyond an end), pixels, shape (N, 2), and
        their derivatives, shape (N, 2, 8).
    """
    offsets = np.empty((len(curve_points.pixels), 2))
    jacobians = np.empty((len(curve_points.pixels), 2, PARAMETERS))
    residual_rows(
        parameters,
        curves.kinds,
        curves.shapes,
        curve_points.pixels,
        curve_points.curve,
        half_diagonal,
        offsets,
        jacobians,
    )
    return offsets, jacobians


def projection_jacobians(
    parameters: FloatArray, points: FloatArray, half_diagonals: FloatArray
) -> FloatArray:
    """Derivatives of points' pixels by the parameters of their cameras, shape (N, 2, 8).

    Args:
        parameters: A camera for each point, shape (N, 8).
        points: Pitch frame, metres, in front of the cameras, shape (N, 3).
        half_diagonals: Half the image diagonals, pixels, shape (N,).
    """
    derivatives = np.empty((len(points), 2, PARAMETERS))
    derivative_rows_of_points(parameters, points, half_diagonals, derivatives)
    return derivatives
