"""Cameras in files of numpy (``.npz``: K, R, t and k, a row a frame), both ways, and of OpenCV's FileStorage
(YAML), read."""

from __future__ import annotations

import io
import math
import re
import zipfile
from collections.abc import Mapping
from typing import Any

import numpy as np
import numpy.typing as npt
import yaml

from app.errors import DatasetFormatError
from app.formats.file_tree import BROKEN, Limits
from app.geometry.arrays import FloatArray
from app.geometry.camera import Camera

_SHAPES = {"K": (3, 3), "R": (3, 3), "t": (3,)}
"""Arrays that must be there, each with the shape of one camera's part."""
_DISTORTION = "k"
MOST_CAMERAS = 100_000
"""Of one file: half a match has 75,000 frames at 25 a second. Each camera takes 1.5 KiB and 0.06 ms
however well its numbers are compressed, so a file of a kilobyte could hold millions."""
_NUMBERS = {"K": 9, "R": 9, "t": 3, _DISTORTION: 14}
"""Most numbers that one camera has in each array; OpenCV's longest distortion has 14."""
_MAX_HEADER = 10_000
_MAX_YAML = 1024 * 1024
_TO_Z_UP = np.diag([1.0, -1.0, -1.0])
_TEXT = "tag:yaml.org,2002:str"
_MERGE = "tag:yaml.org,2002:merge"


def read_camera_arrays(
    content: bytes, key: str, path: str, limits: Limits
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
        name: _one_row_per_camera(arrays[name], shape, name, path)
        for name, shape in _SHAPES.items()
    }
    if _DISTORTION in arrays:
        found = arrays[_DISTORTION]
        if found.size == 0:
            raise DatasetFormatError(path, None, _DISTORTION, "is empty; leave it out instead")
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
        raise _too_many_cameras_error(path, longest, f"has {count:,} rows")
    objects = [
        {name: part[min(at, len(part) - 1)].tolist() for name, part in parts.items()}
        for at in range(count)
    ]
    return [(None if count == 1 else f"{key}/{at}", item) for at, item in enumerate(objects)]


def camera_arrays(cameras: Mapping[int, Camera], path: str) -> dict[str, FloatArray]:
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
        DatasetFormatError: A frame is beyond what a file may hold, or a lens is none of OpenCV's.
    """
    count = max(cameras, default=-1) + 1
    if count > MOST_CAMERAS:
        raise _too_many_cameras_error(path, "K", f"would have {count:,} rows")
    arrays = {name: np.full((count, *shape), np.nan) for name, shape in _SHAPES.items()}
    lens = np.full((count, 12), np.nan)
    for frame, camera in cameras.items():
        if camera.is_wide:
            problem = f"has the lens {camera.lens}; an npz holds OpenCV's distortion alone"
            raise DatasetFormatError(path, f"frame {frame}", "lens", problem)
        arrays["K"][frame] = camera.K
        arrays["R"][frame] = camera.rotation @ _TO_Z_UP
        arrays["t"][frame] = -camera.rotation @ camera.position
        lens[frame] = camera.distortion
    used = np.flatnonzero(np.nan_to_num(lens).any(axis=0)).max(initial=0)
    return {**arrays, _DISTORTION: lens[:, : next(size for size in (5, 8, 12) if used < size)]}


def _one_row_per_camera(
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


def _read_number_arrays(content: bytes, path: str, limits: Limits) -> dict[str, npt.NDArray[Any]]:
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
            raise ValueError("holds an array whose size differs from the size that it declares")
        if numbers > MOST_CAMERAS * _NUMBERS[name]:
            raise _too_many_cameras_error(path, name, f"holds {numbers:,} numbers")
        body = file.read()
    return np.frombuffer(body, kind).reshape(shape, order="F" if fortran else "C").astype(float)


def _too_many_cameras_error(path: str, name: str, problem: str) -> DatasetFormatError:
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
