"""Cameras that other tools write, read: as matrices (K, R and t, OpenCV's vectors, a projection matrix), in
files of numpy (``.npz``: K, R, t and k, a row a frame; written as well) and of OpenCV's FileStorage (YAML).
"""

from __future__ import annotations

import io
import math
import re
import zipfile
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
import numpy.typing as npt
import yaml

from app.errors import DatasetFormatError, GeometryError
from app.formats import fields
from app.formats.file_tree import BROKEN, ImportLimits
from app.geometry.arrays import FloatArray
from app.geometry.camera import Camera, rotation_from_vector
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


def has_camera_matrices(value: Mapping[str, Any]) -> bool:
    """Whether an object describes a camera by matrices."""
    intrinsic = _find_first_present_name(value, _INTRINSICS) or all(
        name in value for name in _FOCAL[0]
    )
    intrinsic = intrinsic or all(name in value for name in _FOCAL[1])
    placed = _find_first_present_name(value, _TRANSLATIONS) or _find_first_present_name(
        value, _POSITIONS
    )
    return bool(
        (intrinsic and _find_first_present_name(value, _ROTATIONS) and placed)
        or _find_first_present_name(value, _PROJECTIONS)
    )


def contains_homography(value: Any) -> bool:
    """Whether a value is a homography, or an object with one and without a camera."""
    if isinstance(value, dict):
        return _find_first_present_name(value, _HOMOGRAPHIES) is not None
    rows = value if isinstance(value, list) else []
    return len(rows) == 3 and all(isinstance(row, list) and len(row) == 3 for row in rows)


def camera_from_matrices(value: Mapping[str, Any], path: str, record: str | None) -> Camera:
    """The camera of an object for which ``has_camera_matrices`` is true.

    Args:
        value: The object; matrices are nested lists, flat lists or OpenCV's ``rows, cols, data``.
        path: File as the user knows it, for the error.
        record: Name of the camera inside the file, for the error.

    Raises:
        DatasetFormatError: A field is no number, R no rotation, or the pose impossible.
    """
    name = ""
    try:
        name = _find_first_present_name(value, _ROTATIONS) or ""
        placed = _find_first_present_name(value, _TRANSLATIONS) or _find_first_present_name(
            value, _POSITIONS
        )
        if name and placed:
            rotation = _parse_rotation(value[name])
            name = placed
            place = _parse_flat_array(value[name], 3)
            position = place if name in _POSITIONS else -rotation.T @ place
            name = _find_first_present_name(value, _INTRINSICS) or ""
            intrinsic = (
                _normalize_camera_matrix(_parse_flat_array(value[name], 9).reshape(3, 3))
                if name
                else _camera_matrix_from_focal_length(value)
            )
        else:
            name = _find_first_present_name(value, _PROJECTIONS) or ""
            intrinsic, rotation, position = _decompose_projection_matrix(
                _parse_flat_array(value[name], 12).reshape(3, 4)
            )
        pose = _find_pose_problem(rotation, position)
        name = _find_first_present_name(value, _DISTORTIONS) or ""
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


def _find_first_present_name(value: Mapping[str, Any], names: Sequence[str]) -> str | None:
    return next((name for name in names if value.get(name) is not None), None)


def _parse_flat_array(value: Any, count: int) -> FloatArray:
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
            flat.append(fields.parse_number(item))
            if abs(flat[-1]) > MAX_NUMBER:
                raise ValueError(f"is larger than any camera has (at most {MAX_NUMBER:.0e})")
        if len(flat) + len(pending) > MAX_NUMBERS:
            raise ValueError(f"has more than {MAX_NUMBERS} numbers")
    return flat


def _parse_rotation(value: Any) -> FloatArray:
    numbers = _flatten_numbers(value)
    if len(numbers) == 3:
        return rotation_from_vector(np.array(numbers))
    matrix = _parse_flat_array(numbers, 9).reshape(3, 3)
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
        fx, fy, cx, cy = (fields.parse_number(value[name]) for name in _FOCAL[0])
    else:
        fx, fy = (fields.parse_number(value[name]) for name in _FOCAL[1])
        cx, cy = fields.parse_numbers(value.get("principal_point"), 2)
    return _normalize_camera_matrix(np.array([[fx, 0, cx], [0, fy, cy], [0, 0, 1.0]]))


def _decompose_projection_matrix(matrix: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
    """K, R and the position of a projection matrix. Source: Hartley & Zisserman, sec. 6.2.4."""
    determinant = np.linalg.det(matrix[:, :3])
    if determinant == 0:
        raise ValueError("is singular, so the camera has no position")
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


def _find_pose_problem(rotation: FloatArray, position: FloatArray) -> str | None:
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


_SHAPES = {"K": (3, 3), "R": (3, 3), "t": (3,)}
"""Arrays that must be there, each with the shape of one camera's part."""
_DISTORTION = "k"
MOST_CAMERAS = 100_000
"""Of one file: half a match has 75,000 frames at 25 a second. Each camera takes 1.5 KiB and 0.06 ms
however well its numbers are compressed, so a file of a kilobyte could hold millions."""
MOST_ROWS = 2_000_000
"""Of a file that is written, from frame 0 on: a recording has no more frames. Rows without a camera take
0.2 KiB each until they are compressed."""
_NUMBERS = {"K": 9, "R": 9, "t": 3, _DISTORTION: 14}
"""Most numbers that one camera has in each array; OpenCV's longest distortion has 14."""
_MAX_HEADER = 10_000
_MAX_YAML = 1024 * 1024
_TO_Z_UP = np.diag([1.0, -1.0, -1.0])
_TEXT = "tag:yaml.org,2002:str"
_MERGE = "tag:yaml.org,2002:merge"


def read_camera_arrays(
    content: bytes, key: str, path: str, limits: ImportLimits
) -> list[tuple[str | None, Any]]:
    """The cameras of an ``.npz`` file as objects of matrices, each with its name.

    Frame i of ``MATCH.npz`` is called ``MATCH/i``; a camera that never moves like the file alone.

    Raises:
        DatasetFormatError: It is damaged, too large or of too many cameras, or K, R and t do not
            fit together.
    """
    arrays = _read_number_arrays(content, path, limits)
    missing = [name for name in _SHAPES if name not in arrays]
    if missing:
        there = ", ".join(sorted(arrays)[:10]) or "nothing"
        raise DatasetFormatError(path, None, missing[0], f"is missing; the file holds {there}")
    parts = {
        name: _reshape_to_one_row_per_camera(arrays[name], shape, name, path)
        for name, shape in _SHAPES.items()
    }
    if _DISTORTION in arrays:
        found = arrays[_DISTORTION]
        if found.size == 0:
            raise DatasetFormatError(path, None, _DISTORTION, "is empty; leave it out instead")
        # OpenCV writes the numbers of one camera as a column.
        rows, most = max(map(len, parts.values())), _NUMBERS[_DISTORTION]
        is_alone = found.ndim == 2 and len(found) != rows and len(found) <= most
        if found.shape[-1:] == (1,) and (found.ndim > 2 or is_alone):
            found = found[..., 0]
        parts[_DISTORTION] = np.atleast_2d(found.reshape(-1, found.shape[-1] if found.ndim else 1))
    counts = {len(part) for part in parts.values()}
    count = max(counts)
    if counts - {1, count}:
        sizes = ", ".join(f"{name} {len(part)}" for name, part in parts.items())
        raise DatasetFormatError(path, None, None, f"has arrays of different lengths ({sizes})")
    if all((part == part[0]).all() for part in parts.values()):
        count = 1
    if count > MOST_CAMERAS:
        longest = max(parts, key=lambda name: len(parts[name]))
        raise _make_too_many_cameras_error(path, longest, f"has {count:,} rows")
    objects = [
        {name: part[min(at, len(part) - 1)].tolist() for name, part in parts.items()}
        for at in range(count)
    ]
    return [(None if count == 1 else f"{key}/{at}", item) for at, item in enumerate(objects)]


def cameras_to_arrays(cameras: Mapping[int, Camera], path: str) -> dict[str, FloatArray]:
    """Cameras over time as FIFA's skeletal kit has them: a row a frame, from frame 0 on.

    The world is x along the pitch, y across it away from the main stand, z up. Frames without a camera
    are NaN.

    Args:
        cameras: By frame.
        path: File as the user knows it, for the error.

    Returns:
        ``K`` (F, 3, 3), ``k`` (F, 5) (OpenCV's k1 k2 p1 p2 k3; 8 or 12 where a lens has more), ``R``
        (F, 3, 3) and ``t`` (F, 3): a point X of the world is R X + t in the camera.

    Raises:
        DatasetFormatError: There are too many cameras, a frame is beyond those of any recording, or a lens
            is none of OpenCV's.
    """
    if len(cameras) > MOST_CAMERAS:
        raise _make_too_many_cameras_error(path, "K", f"would have {len(cameras):,} cameras")
    count = max(cameras, default=-1) + 1
    if count > MOST_ROWS:
        problem = f"would have {count:,} rows, one a frame from frame 0 on; at most {MOST_ROWS:,} can be written"
        raise DatasetFormatError(path, f"frame {count - 1}", "K", problem)
    arrays = {name: np.full((count, *shape), np.nan) for name, shape in _SHAPES.items()}
    lens = max((_count_lens_numbers(camera) for camera in cameras.values()), default=5)
    arrays[_DISTORTION] = np.full((count, lens), np.nan)
    for frame, camera in cameras.items():
        if camera.is_wide:
            problem = f"has the lens {camera.lens}; an npz holds OpenCV's distortion alone"
            raise DatasetFormatError(path, f"frame {frame}", "lens", problem)
        arrays["K"][frame] = camera.K
        arrays["R"][frame] = camera.rotation @ _TO_Z_UP
        arrays["t"][frame] = -camera.rotation @ camera.position
        arrays[_DISTORTION][frame] = camera.distortion[:lens]
    return arrays


def _count_lens_numbers(camera: Camera) -> int:
    """How many numbers OpenCV's distortion needs for a camera: 5, 8 or 12."""
    used = np.flatnonzero(camera.distortion).max(initial=0)
    return next(size for size in (5, 8, 12) if used < size)


def _reshape_to_one_row_per_camera(
    array: npt.NDArray[Any], shape: tuple[int, ...], name: str, path: str
) -> npt.NDArray[Any]:
    """An array as a row a camera."""
    if shape == (3,) and array.ndim > 1 and array.shape[-1] == 1:
        array = array[..., 0]
    frames = array.shape[: array.ndim - len(shape)]
    if array.size == 0 or len(frames) > 1 or array.shape != (*frames, *shape):
        wanted = " x ".join(map(str, ("frames", *shape)))
        found = " x ".join(map(str, array.shape)) or "one number"
        raise DatasetFormatError(path, None, name, f"has the shape {found}, not {wanted}")
    return array.reshape(-1, *shape)


def _read_number_arrays(
    content: bytes, path: str, limits: ImportLimits
) -> dict[str, npt.NDArray[Any]]:
    """The arrays of numbers by name; nothing is unpickled, and no header is believed about its size.

    Arrays that say nothing of cameras are named, and not read: they stay empty.
    """
    found = {}
    try:
        with zipfile.ZipFile(io.BytesIO(content)) as archive:
            if sum(item.file_size for item in archive.infolist()) > limits.file_bytes:
                raise DatasetFormatError(
                    path, None, None, f"is longer than {limits.file_bytes:,} bytes"
                )
            for item in archive.infolist():
                name = item.filename.removesuffix(".npy")
                if name == item.filename:
                    continue
                if name not in _NUMBERS:
                    found[name] = np.empty(0)
                    continue
                found[name] = _read_array(archive, item, name, path)
    except (ValueError, OverflowError) as error:
        raise DatasetFormatError(path, None, None, f"is not a NumPy .npz file ({error})") from error
    except BROKEN as error:
        raise DatasetFormatError(
            path, None, None, "is not a NumPy .npz file, or damaged"
        ) from error
    return found


def _read_array(
    archive: zipfile.ZipFile, item: zipfile.ZipInfo, name: str, path: str
) -> npt.NDArray[Any]:
    """An array, whose header and length are looked at before its numbers are unpacked."""
    with archive.open(item) as file:
        read = np.lib.format.read_array_header_1_0
        if np.lib.format.read_magic(file) != (1, 0):
            read = np.lib.format.read_array_header_2_0
        shape, fortran, kind = read(file, max_header_size=_MAX_HEADER)
        if kind.hasobject or kind.kind not in "fiu":
            raise ValueError("holds values that are not numbers")
        numbers = math.prod(shape)
        if numbers * kind.itemsize != item.file_size - file.tell():
            raise ValueError(
                "holds an array whose size differs from the size that it declares: the file is damaged"
            )
        if numbers > MOST_CAMERAS * _NUMBERS[name]:
            raise _make_too_many_cameras_error(path, name, f"holds {numbers:,} numbers")
        body = file.read()
    return np.frombuffer(body, kind).reshape(shape, order="F" if fortran else "C").astype(float)


def _make_too_many_cameras_error(path: str, name: str, problem: str) -> DatasetFormatError:
    return DatasetFormatError(
        path,
        None,
        name,
        f"{problem}; a file may hold {MOST_CAMERAS:,} cameras: split it into several files",
    )


class _OpenCVStorageLoader(yaml.SafeLoader):
    """Plain YAML with OpenCV's matrices, without anchors: they could make a small file huge.

    Keys are text, as JSON's are, whatever YAML takes them for: ``1``, ``2026-11-28``, ``on``.
    """

    def construct_mapping(self, node: yaml.MappingNode, deep: bool = False) -> dict[Any, Any]:
        """An object whose keys are as the file spells them."""
        for key, _ in node.value:
            if isinstance(key, yaml.ScalarNode) and key.tag != _MERGE:
                key.tag = _TEXT
        return super().construct_mapping(node, deep)

    def compose_node(self, parent: Any, index: Any) -> Any:
        if self.check_event(yaml.AliasEvent):
            raise yaml.YAMLError("aliases (*name) are not allowed")
        return super().compose_node(parent, index)


def _construct_opencv_matrix(
    loader: _OpenCVStorageLoader, node: yaml.MappingNode
) -> dict[Any, Any]:
    return dict(loader.construct_mapping(node, deep=True))


for _kind in ("matrix", "nd-matrix"):
    _OpenCVStorageLoader.add_constructor(
        f"tag:yaml.org,2002:opencv-{_kind}", _construct_opencv_matrix
    )


# A tag with a value that it does not fit (!!int x, !!timestamp x) ends in one of Python's own errors.
_NO_YAML = (
    yaml.YAMLError, ValueError, RecursionError, LookupError, AttributeError, TypeError,
    ArithmeticError,
)  # fmt: skip


def read_opencv_storage(content: bytes, path: str) -> Any:
    """The value of a YAML file that OpenCV's FileStorage wrote.

    Raises:
        DatasetFormatError: It is no such YAML, or too long.
    """
    if len(content) > _MAX_YAML:
        raise DatasetFormatError(path, None, None, f"is longer than {_MAX_YAML:,} bytes")
    try:
        # OpenCV writes "%YAML:1.0", which is no directive of YAML.
        text = re.sub(r"\A%YAML:[^\n]*\n", "", content.decode("utf-8-sig"))
        return yaml.load(text, _OpenCVStorageLoader)
    except _NO_YAML as error:
        raise DatasetFormatError(
            path, None, None, "is not a YAML file of OpenCV's FileStorage"
        ) from error
