"""Camera: the pinhole with lens distortion that maps the pitch into an image, and its rotation by pan, tilt and roll."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np

from app.errors import DegenerateGeometryError
from app.geometry.arrays import FloatArray, require_shape
from app.geometry.lens import BROWN_CONRADY, COEFFICIENTS, LENSES, LensModel


def rotation_from_pan_tilt_roll(pan: float, tilt: float, roll: float) -> FloatArray:
    """World-to-camera rotation R = (Rz(pan) Rx(tilt) Rz(roll))^T, shape (3, 3).

    Pan 0 looks towards -y, tilt 90 degrees is horizontal, less looks down.

    Args:
        pan: Radians, as tilt and roll.
        tilt: Radians.
        roll: Radians.

    Example:
        >>> rotation_from_pan_tilt_roll(0.0, np.pi / 2, 0.0)[2].round(12) + 0.0
        array([ 0., -1.,  0.])
    """
    return (_rotation_about_z(pan) @ _rotation_about_x(tilt) @ _rotation_about_z(roll)).T


def pan_tilt_roll_from_rotation(rotation: FloatArray) -> tuple[float, float, float]:
    """Pan, tilt and roll in radians; of the two triples with this rotation the smaller roll.

    Args:
        rotation: World to camera, shape (3, 3).

    Returns:
        Pan and roll in (-pi, pi]. Where the camera looks straight up or down (tilt 0 or 180
        degrees) pan and roll turn about one axis, and roll is 0.
    """
    orientation = require_shape(rotation, (3, 3), "rotation").T
    sine = float(np.hypot(orientation[2, 0], orientation[2, 1]))
    tilt = float(np.arctan2(sine, orientation[2, 2]))
    if sine < 1e-12:
        return float(np.arctan2(orientation[1, 0], orientation[0, 0])), tilt, 0.0
    pan = float(np.arctan2(orientation[0, 2], -orientation[1, 2]))
    roll = float(np.arctan2(orientation[2, 0], orientation[2, 1]))
    if abs(roll) > np.pi / 2:
        pan = float(np.arctan2(-orientation[0, 2], orientation[1, 2]))
        roll = float(np.arctan2(-orientation[2, 0], -orientation[2, 1]))
        return pan, -tilt, roll
    return pan, tilt, roll


def _rotation_about_z(angle: float) -> FloatArray:
    cosine, sine = np.cos(angle), np.sin(angle)
    return np.array([[cosine, -sine, 0.0], [sine, cosine, 0.0], [0.0, 0.0, 1.0]])


def _rotation_about_x(angle: float) -> FloatArray:
    cosine, sine = np.cos(angle), np.sin(angle)
    return np.array([[1.0, 0.0, 0.0], [0.0, cosine, -sine], [0.0, sine, cosine]])


def rotation_from_vector(vector: FloatArray) -> FloatArray:
    """The rotation about a vector by its length in radians (Rodrigues' formula).

    Args:
        vector: Axis times angle, radians, shape (3,).

    Returns:
        Rotation matrix, shape (3, 3).

    Raises:
        ShapeError: The vector has another shape.

    Source: Hartley & Zisserman, appendix A4.3.2.

    Example:
        >>> rotation_from_vector(np.array([0.0, 0.0, np.pi / 2])).round(12) + 0.0
        array([[ 0., -1.,  0.],
               [ 1.,  0.,  0.],
               [ 0.,  0.,  1.]])
    """
    require_shape(vector, (3,), "vector")
    x, y, z = vector
    cross = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    angle = float(np.linalg.norm(vector))
    # sin(a)/a and (1 - cos a)/a^2 without a division by zero.
    first = np.sinc(angle / np.pi)
    second = 0.5 * np.sinc(angle / (2 * np.pi)) ** 2
    return np.asarray(np.eye(3) + first * cross + second * cross @ cross, dtype=float)


MIN_DEPTH = 1e-3
"""Metres in front of the camera below which nothing is visible."""


def _make_zero_distortion() -> FloatArray:
    return np.zeros(COEFFICIENTS)


@dataclass(frozen=True, eq=False)
class Camera:
    """``X_cam = R (X - C)``: x right, y down, z forward; image in pixels.

    Attributes:
        rotation: R, pitch to camera, shape (3, 3).
        position: C in the pitch frame, metres, shape (3,).
        focal_length: alpha_x and alpha_y, pixels.
        principal_point: x0 and y0, pixels.
        skew: s, pixels.
        distortion: Coefficients of the lens; OpenCV's k1 k2 p1 p2 k3 k4 k5 k6 s1 s2 s3 s4, shape
            (12,), unless ``lens`` says otherwise.
        lens: Name of the distortion model (``geometry.lens``).
    """

    rotation: FloatArray
    position: FloatArray
    focal_length: tuple[float, float]
    principal_point: tuple[float, float]
    skew: float = 0.0
    distortion: FloatArray = field(default_factory=_make_zero_distortion)
    lens: str = BROWN_CONRADY

    def __post_init__(self) -> None:
        if self.lens not in LENSES:
            raise DegenerateGeometryError(
                f'"{self.lens}" is not a known lens model',
                hint=f"Lens models are {', '.join(LENSES)}.",
            )
        shapes = (("rotation", (3, 3)), ("position", (3,)), ("distortion", (self.model.count,)))
        for name, shape in shapes:
            array = require_shape(getattr(self, name), shape, name).copy()
            array.setflags(write=False)
            object.__setattr__(self, name, array)
        lens = self.distortion.tolist()
        numbers = [*self.rotation.ravel().tolist(), *self.position.tolist(), *lens]
        numbers += [*self.focal_length, *self.principal_point, self.skew]
        # Cameras are made by the thousand: of so few numbers this takes a fifth of numpy's time.
        if not all(map(math.isfinite, numbers)):
            raise DegenerateGeometryError("a camera parameter is not a finite number")
        if min(self.focal_length) <= 0:
            raise DegenerateGeometryError("the focal length of a camera must be positive")
        self.model.check(lens)

    def __eq__(self, other: object) -> bool:
        return (
            isinstance(other, Camera)
            and self.lens == other.lens
            and np.array_equal(self.parameters, other.parameters)
        )

    def __hash__(self) -> int:
        return hash(self.parameters.tobytes())

    @cached_property
    def parameters(self) -> FloatArray:
        """Every number of the camera, in a fixed order, shape (29,) but for another lens."""
        numbers = [*self.focal_length, *self.principal_point, self.skew]
        return np.concatenate([self.rotation.ravel(), self.position, numbers, self.distortion])

    @property
    def model(self) -> LensModel:
        """How the lens bends rays."""
        return LENSES[self.lens]

    @cached_property
    def is_wide(self) -> bool:
        """Whether the lens is one for strong wide angle, which is no pinhole even at its best."""
        return self.lens != BROWN_CONRADY

    @cached_property
    def has_distortion(self) -> bool:
        """Whether the lens distorts at all."""
        return self.is_wide or bool(self.distortion.any())

    @cached_property
    def K(self) -> FloatArray:
        """Calibration matrix, shape (3, 3)."""
        (ax, ay), (x0, y0) = self.focal_length, self.principal_point
        matrix = np.array([[ax, self.skew, x0], [0.0, ay, y0], [0.0, 0.0, 1.0]])
        matrix.setflags(write=False)
        return matrix

    @cached_property
    def _distortion_coefficients(self) -> list[float]:
        """Of the distortion, as plain numbers: the way of one point costs less so."""
        return [*map(float, self.distortion)]

    @cached_property
    def _fold_radius(self) -> float:
        """``fold_radius`` of the lens."""
        return self.model.fold_radius(self.distortion)

    @property
    def P(self) -> FloatArray:
        """Projection matrix K R [I | -C] without distortion, shape (3, 4)."""
        KR = self.K @ self.rotation
        return np.column_stack([KR, -KR @ self.position])

    @property
    def pan_tilt_roll_degrees(self) -> tuple[float, float, float]:
        """SoccerNet's angles."""
        pan, tilt, roll = np.degrees(pan_tilt_roll_from_rotation(self.rotation))
        return float(pan), float(tilt), float(roll)

    def pitch_to_camera(self, points: FloatArray) -> FloatArray:
        """Points of the pitch frame in the camera frame, metres, both shape (N, 3)."""
        return (require_shape(points, (None, 3), "points") - self.position) @ self.rotation.T

    def project(self, points: FloatArray, *, folded: bool = False) -> FloatArray:
        """Pixels of points, as the distorted image shows them.

        Args:
            points: Pitch frame, metres, shape (N, 3).
            folded: Also give pixels to points beyond the radius where distortion folds the
                picture. No lens shows them; the public evaluator counts them. Lenses that it
                does not know have none.

        Returns:
            Shape (N, 2); NaN where the point lies less than a millimetre in front of the camera
            or beyond the fold.
        """
        in_camera = self.pitch_to_camera(points)
        if len(in_camera) == 1:
            return np.array([self._project_point(in_camera[0].tolist(), folded)])
        depth = in_camera[:, 2]
        visible = depth > MIN_DEPTH
        safe = np.where(visible, depth, 1.0)
        ideal = in_camera[:, :2] / safe[:, None]
        if self.has_distortion:
            if not folded:
                visible &= np.hypot(ideal[:, 0], ideal[:, 1]) <= self._fold_radius
            ideal = self.model.distort(np.where(visible[:, None], ideal, 0.0), self.distortion)
        pixels = self._normalised_to_pixel(ideal)
        pixels[~visible] = np.nan
        return pixels

    def _project_point(self, in_camera: Sequence[float], folded: bool) -> tuple[float, float]:
        """``project`` for one point of the camera frame, the same bits in plain numbers."""
        x, y, depth = in_camera
        if not depth > MIN_DEPTH:
            return np.nan, np.nan
        x, y = x / depth, y / depth
        if self.has_distortion:
            if not (folded or np.hypot(x, y) <= self._fold_radius):
                return np.nan, np.nan
            x, y = self.model.distort_point(x, y, self._distortion_coefficients)
        (ax, ay), (x0, y0) = self.focal_length, self.principal_point
        return ax * x + self.skew * y + x0, ay * y + y0

    def jacobian(self, point: FloatArray) -> FloatArray:
        """Derivative of a point's pixel by the point, pixels per metre, shape (2, 3).

        Args:
            point: Pitch frame, metres, in front of the camera, shape (3,).
        """
        x, y, z = self.rotation @ (require_shape(point, (3,), "point") - self.position)
        ideal = np.array([[1.0, 0.0, -x / z], [0.0, 1.0, -y / z]]) / z @ self.rotation
        if self.has_distortion:
            place = np.array([[x / z, y / z]])
            ideal = self.model.jacobian(place, self.distortion)[0] @ ideal
        slope: FloatArray = self.K[:2, :2] @ ideal
        return slope

    def undistort(self, pixels: FloatArray) -> FloatArray:
        """Pixels of the ideal pinhole for pixels of the image, both shape (N, 2)."""
        pixels = require_shape(pixels, (None, 2), "pixels")
        if not self.has_distortion:
            return pixels.copy()
        return self._normalised_to_pixel(self.pixel_to_ideal(pixels))

    def undistort_jacobian(self, pixel: FloatArray) -> FloatArray:
        """Derivative of ``undistort`` by the pixel: what noise there becomes here, shape (2, 2).

        Args:
            pixel: As the image shows it, shape (2,); NaN comes back where it has no ray.
        """
        if not self.has_distortion:
            return np.eye(2)
        ideal = self.pixel_to_ideal(require_shape(pixel, (2,), "pixel")[None])
        if np.isnan(ideal).any():
            return np.full((2, 2), np.nan)
        K = self.K[:2, :2]
        bent = self.model.jacobian(ideal, self.distortion)[0]
        slope: FloatArray = K @ np.linalg.inv(bent) @ np.linalg.inv(K)
        return slope

    def pixel_to_ideal(self, pixels: FloatArray) -> FloatArray:
        """Ideal normalised coordinates (K^-1 and undistortion), both shape (N, 2)."""
        pixels = require_shape(pixels, (None, 2), "pixels")
        y = (pixels[:, 1] - self.principal_point[1]) / self.focal_length[1]
        x = (pixels[:, 0] - self.principal_point[0] - self.skew * y) / self.focal_length[0]
        return self.model.undistort(np.column_stack([x, y]), self.distortion)

    def rays(self, pixels: FloatArray) -> FloatArray:
        """Directions (not of unit length: camera z is 1) in the pitch frame, shape (N, 3)."""
        ideal = self.pixel_to_ideal(pixels)
        return np.column_stack([ideal, np.ones(len(ideal))]) @ self.rotation

    def project_to_ground(self, pixels: FloatArray) -> FloatArray:
        """Where on the grass (z = 0) pixels look, pitch frame, metres, shape (N, 2).

        Args:
            pixels: As the image shows them, shape (N, 2).

        Returns:
            x and y; NaN for pixels that look at or above the horizon, or have no ray.
        """
        rays = self.rays(pixels)
        with np.errstate(divide="ignore", invalid="ignore"):
            reach = -self.position[2] / rays[:, 2]
            places: FloatArray = self.position[:2] + reach[:, None] * rays[:, :2]
        places[~(np.isfinite(reach) & (reach > 0))] = np.nan
        return places

    def scaled(self, factor_x: float, factor_y: float) -> Camera:
        """The same camera for the image resized by these factors.

        The origin is the centre of the top-left pixel, so the principal point scales about
        (-0.5, -0.5).
        """
        (ax, ay), (x0, y0) = self.focal_length, self.principal_point
        return replace(
            self,
            focal_length=(ax * factor_x, ay * factor_y),
            principal_point=((x0 + 0.5) * factor_x - 0.5, (y0 + 0.5) * factor_y - 0.5),
            skew=self.skew * factor_x,
        )

    def _normalised_to_pixel(self, ideal: FloatArray) -> FloatArray:
        x = self.focal_length[0] * ideal[:, 0] + self.skew * ideal[:, 1] + self.principal_point[0]
        y = self.focal_length[1] * ideal[:, 1] + self.principal_point[1]
        return np.column_stack([x, y])


_CORRELATION_ROUNDING = 1e-6
"""How far correlations of a covariance may be from what they have to be."""


def validate_camera_covariance(values: Iterable[float]) -> tuple[float, ...]:
    """The covariance of a camera's parameters (``geometry.resection``), row by row, shape (64,).

    Raises:
        ValueError: It is not symmetric with a variance above zero in each parameter, and none
            below zero in any direction.
    """
    covariance = tuple(map(float, values))
    if len(covariance) != 8 * 8 or not all(map(math.isfinite, covariance)):
        raise ValueError("the covariance of a camera must have 64 numbers, all finite")
    matrix = np.array(covariance).reshape(8, 8)
    variances = matrix.diagonal()
    if not (variances > 0).all():
        raise ValueError("every variance in the covariance of a camera must be above zero")
    scale = np.sqrt(variances)
    shares = matrix / np.outer(scale, scale)
    if not (np.abs(shares - shares.T) < _CORRELATION_ROUNDING).all():
        raise ValueError("the covariance of a camera must be symmetric")
    if np.linalg.eigvalsh(shares)[0] < -_CORRELATION_ROUNDING:
        raise ValueError("the covariance of a camera must have no negative eigenvalue")
    return covariance
