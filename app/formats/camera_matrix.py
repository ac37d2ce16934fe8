"""Cameras that other tools write as matrices, read: K, R and t, OpenCV's vectors, a projection matrix.

Such files do not say their world frame. They are read as SoccerNet's pitch frame (metres, origin at
the centre mark, z down, docs/coordinates.md); a pose that contradicts it is refused.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from app.errors import DatasetFormatError, GeometryError
from app.formats import fields
from app.geometry.arrays import FloatArray
from app.geometry.camera import Camera
from app.geometry.rotation import rotation_from_vector
from app.soccer.pitch import Pitch

_INTRINSICS = (
    "K",
    "mtx",
    "camera_matrix",
    "cameraMatrix",
    "intrinsic_matrix",
    "intrinsics",
    "intrinsic",
)
_ROTATIONS = ("R", "rotation_matrix", "rotation", "rvec", "rvecs", "rotation_vector")
_TRANSLATIONS = ("t", "T", "tvec", "tvecs", "translation", "translation_vector")
_POSITIONS = ("C", "position_meters", "position", "camera_center", "camera_position", "center")
_DISTORTIONS = (
    "dist", "k", "D", "distCoeffs", "dist_coeffs", "distortion_coefficients", "distortion",
)  # fmt: skip
_PROJECTIONS = ("P", "projection_matrix", "projection")
_FOCAL = (("fx", "fy", "cx", "cy"), ("x_focal_length", "y_focal_length"))
_HOMOGRAPHIES = ("homography", "homographies", "homography_matrix", "H")
_COUNTS = (4, 5, 8, 12, 14)
"""Lengths of OpenCV's distortion: k1 k2 p1 p2, k3, k4 k5 k6, s1 .. s4, two tilts."""
MAX_SKEWNESS = 1e-2
"""How far the rows of R may be from a rotation's; files round."""
MAX_NUMBERS = 1000
"""Of one field; a matrix has a dozen."""
MAX_NUMBER = 1e12
"""No number is beyond; a projection matrix has any scale."""
MAX_DISTANCE_M = 1000.0
"""No camera of a pitch stands farther away: beyond it the file is in other units."""


def holds_matrices(value: Mapping[str, Any]) -> bool:
    """Whether an object describes a camera by matrices."""
    intrinsic = _first_given_name(value, _INTRINSICS) or all(name in value for name in _FOCAL[0])
    intrinsic = intrinsic or all(name in value for name in _FOCAL[1])
    placed = _first_given_name(value, _TRANSLATIONS) or _first_given_name(value, _POSITIONS)
    return bool(
        (intrinsic and _first_given_name(value, _ROTATIONS) and placed)
        or _first_given_name(value, _PROJECTIONS)
    )


def holds_homography(value: Any) -> bool:
    """Whether a value is a homography, or an object with one and without a camera."""
    if isinstance(value, dict):
        return _first_given_name(value, _HOMOGRAPHIES) is not None
    rows = value if isinstance(value, list) else []
    return len(rows) == 3 and all(isinstance(row, list) and len(row) == 3 for row in rows)


def camera_from_matrices(value: Mapping[str, Any], path: str, record: str | None) -> Camera:
    """The camera of an object for which ``holds_matrices`` is true.

    Args:
        value: The object; matrices are nested lists, flat lists or OpenCV's ``rows, cols, data``.
        path: File as the user knows it, for the error.
        record: Name of the camera inside the file, for the error.

    Raises:
        DatasetFormatError: A field is no number, R no rotation, or the pose impossible.
    """
    name = ""
    try:
        name = _first_given_name(value, _ROTATIONS) or ""
        placed = _first_given_name(value, _TRANSLATIONS) or _first_given_name(value, _POSITIONS)
        if name and placed:
            rotation = _parse_rotation(value[name])
            name = placed
            place = _flat_array(value[name], 3)
            position = place if name in _POSITIONS else -rotation.T @ place
            name = _first_given_name(value, _INTRINSICS) or ""
            intrinsic = (
                _normalize_camera_matrix(_flat_array(value[name], 9).reshape(3, 3))
                if name
                else _camera_matrix_from_focal_length(value)
            )
        else:
            name = _first_given_name(value, _PROJECTIONS) or ""
            intrinsic, rotation, position = _decompose_projection_matrix(
                _flat_array(value[name], 12).reshape(3, 4)
            )
        pose = _pose_problem(rotation, position)
        name = _first_given_name(value, _DISTORTIONS) or ""
        distortion = _parse_distortion(value.get(name))
        name = ""
        if pose:
            raise ValueError(pose)
        return Camera(
            rotation=rotation,
            position=position,
            focal_length=(float(intrinsic[0, 0]), float(intrinsic[1, 1])),
            principal_point=(float(intrinsic[0, 2]), float(intrinsic[1, 2])),
            skew=float(intrinsic[0, 1]),
            distortion=distortion,
        )
    except ValueError as error:
        raise DatasetFormatError(path, record, name or None, str(error)) from error
    except GeometryError as error:
        raise DatasetFormatError(path, record, None, error.message) from error


def _first_given_name(value: Mapping[str, Any], names: Sequence[str]) -> str | None:
    return next((name for name in names if value.get(name) is not None), None)


def _flat_array(value: Any, count: int) -> FloatArray:
    """Numbers of a list, nested as it may be, or of OpenCV's ``{rows, cols, data}``."""
    flat = _flatten_numbers(value)
    if len(flat) != count:
        poses = len(flat) // count if len(flat) % count == 0 else 0
        more = f": {poses} poses, and a camera has one" if poses > 1 else ""
        raise ValueError(f"has {len(flat)} numbers, not {count}{more}")
    return np.array(flat)


def _flatten_numbers(value: Any) -> list[float]:
    if isinstance(value, dict) and "data" in value:
        value = value["data"]
    flat: list[float] = []
    pending = [value]
    while pending:
        item = pending.pop()
        if isinstance(item, (list, tuple)):
            if len(item) > MAX_NUMBERS:
                raise ValueError(f"has more than {MAX_NUMBERS} numbers")
            pending.extend(reversed(item))
        else:
            flat.append(fields.number(item))
            if abs(flat[-1]) > MAX_NUMBER:
                raise ValueError(f"is larger than any camera has (at most {MAX_NUMBER:.0e})")
        if len(flat) + len(pending) > MAX_NUMBERS:
            raise ValueError(f"has more than {MAX_NUMBERS} numbers")
    return flat


def _parse_rotation(value: Any) -> FloatArray:
    numbers = _flatten_numbers(value)
    if len(numbers) == 3:
        return rotation_from_vector(np.array(numbers))
    matrix = _flat_array(numbers, 9).reshape(3, 3)
    left, _, right = np.linalg.svd(matrix)
    nearest: FloatArray = left @ right
    if np.abs(nearest - matrix).max() > MAX_SKEWNESS:
        raise ValueError("is not a rotation: its rows are not perpendicular unit vectors")
    if np.linalg.det(nearest) < 0:
        raise ValueError("is a mirror image and no rotation: its determinant is -1")
    return nearest


def _normalize_camera_matrix(matrix: FloatArray) -> FloatArray:
    if matrix[2, 2] == 0 or np.abs([*matrix[2, :2], matrix[1, 0]]).max() > 1e-9:
        raise ValueError("is not a camera matrix [[fx, s, cx], [0, fy, cy], [0, 0, 1]]")
    scaled: FloatArray = matrix / matrix[2, 2]
    if min(scaled[0, 0], scaled[1, 1]) <= 0:
        raise ValueError("has a focal length that is not positive")
    return scaled


def _camera_matrix_from_focal_length(value: Mapping[str, Any]) -> FloatArray:
    if "fx" in value:
        fx, fy, cx, cy = (fields.number(value[name]) for name in _FOCAL[0])
    else:
        fx, fy = (fields.number(value[name]) for name in _FOCAL[1])
        cx, cy = fields.number_list(value.get("principal_point"), 2)
    return _normalize_camera_matrix(np.array([[fx, 0, cx], [0, fy, cy], [0, 0, 1.0]]))


def _decompose_projection_matrix(matrix: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
    """K, R and the position of a projection matrix. Source: Hartley & Zisserman, sec. 6.2.4."""
    determinant = np.linalg.det(matrix[:, :3])
    if determinant == 0:
        raise ValueError("determines no position of a camera")
    matrix = matrix * np.sign(determinant)
    # An RQ decomposition by the QR decomposition of the matrix turned upside down.
    q, r = np.linalg.qr(np.flipud(matrix[:, :3]).T)
    upper, rotation = np.fliplr(np.flipud(r.T)), np.flipud(q.T)
    signs = np.diag(np.sign(np.diag(upper)))
    turned: FloatArray = np.asarray(signs @ rotation, dtype=float)
    upper = upper @ signs
    position = -np.linalg.solve(matrix[:, :3], matrix[:, 3])
    upper[1, 0] = upper[2, 0] = upper[2, 1] = 0.0
    return _normalize_camera_matrix(upper), turned, np.asarray(position, dtype=float)


def _parse_distortion(value: Any) -> FloatArray:
    result = np.zeros(12)
    if value is None:
        return result
    numbers = _flatten_numbers(value)
    size = len(numbers)
    if size in (1, 2):
        result[:size] = numbers
    elif size in _COUNTS:
        result[: min(size, 12)] = numbers[:12]
        if size == 14 and any(numbers[12:]):
            raise ValueError("tilts the sensor (tau x, tau y), which is not supported")
    else:
        raise ValueError(f"has {size} numbers; OpenCV's distortion has 4, 5, 8, 12 or 14")
    return result


def _pose_problem(rotation: FloatArray, position: FloatArray) -> str | None:
    """Why a pose cannot be that of a camera of a pitch, in words; None where it can."""
    distance, z = float(np.linalg.norm(position)), float(position[2])
    if distance > MAX_DISTANCE_M:
        return (
            f"stands {distance:,.0f} m from the centre mark; metres are meant, with the origin at the "
            "centre mark"
        )
    if z > 0:
        return (
            f"stands {z:.1f} m below the grass: its world frame seems to have z up, and ours has z down. "
            "Multiply R from the right by diag(1, -1, -1) and keep t (docs/coordinates.md)"
        )
    half_length, half_width = Pitch().length / 2, Pitch().width / 2
    grid = np.array(
        [
            [x, y, 0.0]
            for x in np.linspace(-half_length, half_length, 9)
            for y in np.linspace(-half_width, half_width, 9)
        ]
    )
    if (rotation[2] @ (grid - position).T).max() <= 0:
        return (
            "looks away from the whole pitch: R takes a point of the pitch frame (x to the right goal, y "
            "to the main cameras, z down) to the camera (docs/coordinates.md)"
        )
    return None
