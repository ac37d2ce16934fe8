"""Camera: from the pitch into a picture and back, with the numbers of the server.

Pitch frame: metres, origin at the centre mark, x to the right goal, z **down**. Pixels: (0, 0) is the
**centre** of the top-left pixel, so a picture of width w reaches from -0.5 to w - 0.5.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np
import numpy.typing as npt

from touchline.errors import CameraError
from touchline.lens import BROWN_CONRADY, FloatArray, Lens, lens_of

MIN_DEPTH = 1e-3
"""Metres in front of the camera below which nothing is seen."""
_ROUNDING = 1e-10
"""Below, a matrix and its angles are the same rotation but for rounding."""


@dataclass(frozen=True)
class Camera:
    """``X_cam = R (X - C)``: x right, y down, z forward.

    Attributes:
        rotation: R, pitch to camera, three rows.
        position: C in the pitch frame, metres.
        focal_length: alpha_x and alpha_y, pixels.
        principal_point: x0 and y0, pixels.
        skew: Pixels.
        distortion: Coefficients of the lens, as ``touchline.lens.lens_of`` takes them.
        lens: Name of the lens.
    """

    rotation: tuple[tuple[float, ...], ...]
    position: tuple[float, ...]
    focal_length: tuple[float, ...]
    principal_point: tuple[float, ...]
    skew: float = 0.0
    distortion: tuple[float, ...] = (0.0,) * 12
    lens: str = BROWN_CONRADY

    def __post_init__(self) -> None:
        if np.shape(self.rotation) != (3, 3) or np.shape(self.position) != (3,):
            raise CameraError("a rotation has 3 x 3 numbers and a position 3")
        if min(self.focal_length) <= 0:
            raise CameraError("the focal length of a camera is above zero")
        lens_of(self.lens, self.distortion)

    @staticmethod
    def from_row(row: Mapping[str, Any]) -> Camera | None:
        """The camera of a row of ``views.parquet``; None where the view has none."""
        if row.get("x_focal_length") is None:
            return None
        R = row["rotation_matrix"]
        return Camera(
            rotation=(tuple(R[:3]), tuple(R[3:6]), tuple(R[6:9])),
            position=tuple(row["position_meters"]),
            focal_length=(row["x_focal_length"], row["y_focal_length"]),
            principal_point=tuple(row["principal_point"]),
            skew=row["skew"],
            distortion=tuple(row["distortion"]),
            lens=row.get("lens") or BROWN_CONRADY,
        )

    @staticmethod
    def from_json(document: Mapping[str, Any]) -> Camera:
        """The camera of SoccerNet's JSON, as ``camera_<frame>.json`` holds it.

        The angles count; a ``rotation_matrix`` that is theirs but for rounding has more digits.
        Distortion that is not there is none. Numbers may be written as text.

        Raises:
            CameraError: A number is missing, or none; it names the field.
        """
        return Camera(
            rotation=tuple(map(tuple, _rotation(document).tolist())),
            position=_numbers(document, "position_meters", 3),
            focal_length=(
                *_numbers(document, "x_focal_length"),
                *_numbers(document, "y_focal_length"),
            ),
            principal_point=_numbers(document, "principal_point", 2),
            skew=0.0 if document.get("skew") is None else _numbers(document, "skew")[0],
            distortion=_coefficients(document),
            lens=document.get("lens") or BROWN_CONRADY,
        )

    @cached_property
    def K(self) -> FloatArray:
        """Calibration matrix, shape (3, 3)."""
        (ax, ay), (x0, y0) = self.focal_length, self.principal_point
        return np.array([[ax, self.skew, x0], [0.0, ay, y0], [0.0, 0.0, 1.0]])

    @cached_property
    def R(self) -> FloatArray:
        """Rotation from pitch to camera, shape (3, 3)."""
        return np.array(self.rotation)

    @property
    def P(self) -> FloatArray:
        """Projection matrix ``K R [I | -C]`` to *undistorted* pixels, shape (3, 4)."""
        KR = self.K @ self.R
        return np.column_stack([KR, -KR @ np.array(self.position)])

    def project(self, points: npt.ArrayLike) -> FloatArray:
        """Pixels of points of the pitch, as the picture shows them.

        Args:
            points: Pitch frame, metres, shape (N, 3), or (3,) for one.

        Returns:
            Shape (N, 2), or (2,); NaN behind the camera and beyond the edge of the lens.
        """
        wanted, one = _rows(points, 3)
        in_camera = (wanted - np.array(self.position)) @ self.R.T
        depth = in_camera[:, 2]
        seen = depth > MIN_DEPTH
        ideal = in_camera[:, :2] / np.where(seen, depth, 1.0)[:, None]
        if self._bends:
            seen &= np.hypot(*ideal.T) <= self._lens.fold
            ideal = self._lens.distort(np.where(seen[:, None], ideal, 0.0))
        pixels = self._to_pixels(ideal)
        pixels[~seen] = np.nan
        return pixels[0] if one else pixels

    def undistort(self, pixels: npt.ArrayLike) -> FloatArray:
        """Pixels of the ideal pinhole (that of ``P``) for pixels of the picture.

        Args:
            pixels: Shape (N, 2), or (2,) for one.

        Returns:
            The same shape; NaN where no ray belongs to a pixel.
        """
        wanted, one = _rows(pixels, 2)
        ideal = self._to_pixels(self._to_ideal(wanted)) if self._bends else wanted.copy()
        return ideal[0] if one else ideal

    def unproject(self, pixels: npt.ArrayLike, height: float = 0.0) -> FloatArray:
        """Where the rays of pixels meet the plane at a height above the grass.

        Args:
            pixels: Of the picture, shape (N, 2), or (2,) for one.
            height: Metres above the grass; 0.11 is the centre of a ball that lies.

        Returns:
            Pitch frame, metres, z = -height, shape (N, 3), or (3,); NaN where a ray does not meet
            the plane in front of the camera.
        """
        wanted, one = _rows(pixels, 2)
        ideal = self._to_ideal(wanted)
        rays = np.column_stack([ideal, np.ones(len(ideal))]) @ self.R
        with np.errstate(all="ignore"):
            depth = (-height - self.position[2]) / rays[:, 2]
        depth = np.where(np.isfinite(depth) & (depth > MIN_DEPTH), depth, np.nan)
        points: FloatArray = np.array(self.position) + depth[:, None] * rays
        points[np.isfinite(depth), 2] = -height
        return points[0] if one else points

    def scaled(self, factor_x: float, factor_y: float | None = None) -> Camera:
        """The camera for the picture resized by these factors.

        The origin is the centre of a pixel, so what scales is the distance from the corner of
        the picture, half a pixel before it: ``(x + 0.5) factor - 0.5``.
        """
        fy = factor_x if factor_y is None else factor_y
        (ax, ay), (x0, y0) = self.focal_length, self.principal_point
        return replace(
            self,
            focal_length=(ax * factor_x, ay * fy),
            principal_point=((x0 + 0.5) * factor_x - 0.5, (y0 + 0.5) * fy - 0.5),
            skew=self.skew * factor_x,
        )

    @cached_property
    def _lens(self) -> Lens:
        return lens_of(self.lens, self.distortion)

    @property
    def _bends(self) -> bool:
        return self.lens != BROWN_CONRADY or any(self.distortion)

    def _to_pixels(self, ideal: FloatArray) -> FloatArray:
        (ax, ay), (x0, y0) = self.focal_length, self.principal_point
        x, y = ideal.T
        return np.column_stack([ax * x + self.skew * y + x0, ay * y + y0])

    def _to_ideal(self, pixels: FloatArray) -> FloatArray:
        (ax, ay), (x0, y0) = self.focal_length, self.principal_point
        y = (pixels[:, 1] - y0) / ay
        x = (pixels[:, 0] - x0 - self.skew * y) / ax
        return self._lens.undistort(np.column_stack([x, y]))


def _numbers(document: Mapping[str, Any], name: str, count: int | None = None) -> tuple[float, ...]:
    """The numbers of a field; without a count it is one number alone.

    Raises:
        CameraError: They are missing, of another count, or no finite numbers.
    """
    value = document.get(name) if isinstance(document, Mapping) else None
    try:
        if value is None:
            raise ValueError("is missing")
        found = np.array(value, dtype=np.float64)
        if found.shape != (() if count is None else (count,)):
            raise ValueError("is not one number" if count is None else f"is not {count} numbers")
        if not np.isfinite(found).all():
            raise ValueError("is not finite")
    except (TypeError, ValueError) as error:
        raise CameraError(f"this is not a camera in SoccerNet's JSON: {name} {error}") from None
    return tuple(np.atleast_1d(found).tolist())


def _rotation(document: Mapping[str, Any]) -> FloatArray:
    """``(Rz(pan) Rx(tilt) Rz(roll))^T``, shape (3, 3)."""
    names = ("pan_degrees", "tilt_degrees", "roll_degrees")
    pan, tilt, roll = np.radians([_numbers(document, name)[0] for name in names])
    cosine, sine = np.cos(tilt), np.sin(tilt)
    about_x = np.array([[1.0, 0.0, 0.0], [0.0, cosine, -sine], [0.0, sine, cosine]])
    rotation: FloatArray = (_about_z(pan) @ about_x @ _about_z(roll)).T
    rows = document.get("rotation_matrix")
    if rows is None:
        return rotation
    names = ("first row", "second row", "third row")
    if not isinstance(rows, (list, tuple)) or len(rows) != 3:
        raise CameraError("this is not a camera in SoccerNet's JSON: rotation_matrix is not 3 rows")
    of_matrix = {f"rotation_matrix, {name}": row for name, row in zip(names, rows, strict=True)}
    given = np.array([_numbers(of_matrix, name, 3) for name in of_matrix])
    return given if np.abs(given - rotation).max() < _ROUNDING else rotation


def _about_z(angle: float) -> FloatArray:
    cosine, sine = np.cos(angle), np.sin(angle)
    return np.array([[cosine, -sine, 0.0], [sine, cosine, 0.0], [0.0, 0.0, 1.0]])


def _coefficients(document: Mapping[str, Any]) -> tuple[float, ...]:
    """Of the lens, in OpenCV's order; SoccerNet has all k before p."""
    if document.get("lens") not in (None, BROWN_CONRADY):
        count = np.size(document.get("lens_coefficients") or ())
        return _numbers(document, "lens_coefficients", count)
    k1, k2, k3, k4, k5, k6 = _numbers_or_zeros(document, "radial_distortion", 6)
    p1, p2 = _numbers_or_zeros(document, "tangential_distortion", 2)
    s1, s2, s3, s4 = _numbers_or_zeros(document, "thin_prism_distortion", 4)
    return (k1, k2, p1, p2, k3, k4, k5, k6, s1, s2, s3, s4)


def _numbers_or_zeros(document: Mapping[str, Any], name: str, count: int) -> tuple[float, ...]:
    # An empty list says that there is none, too.
    return _numbers(document, name, count) if document.get(name) else (0.0,) * count


def _rows(values: npt.ArrayLike, width: int) -> tuple[FloatArray, bool]:
    """The values as rows of that width, and whether there was one without a row around it."""
    array = np.asarray(values, dtype=np.float64)
    if array.shape == (width,):
        return array[None], True
    if array.ndim != 2 or array.shape[1] != width:
        raise ValueError(f"needs shape (N, {width}) or ({width},), not {array.shape}")
    return array, False
