"""Arrays file: named arrays in one file, read where they are needed and not before.

What is asked of a million groups reads a tenth of their columns: the file is mapped into memory,
and the system reads of it what is touched. Files are a cache: what cannot be read is made again.
"""

from __future__ import annotations

import json
import zlib
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from app.durable import replace_file
from app.finite import json_text

_HEAD = 16
"""Bytes before the description: its length, and its checksum."""
_LINE = 64
"""Every array begins at a multiple of it."""


@dataclass(frozen=True)
class ArraysFile:
    """What a file holds: ``about`` it, and its arrays by name."""

    about: Mapping[str, Any]
    arrays: Mapping[str, Any]


def write_arrays(path: Path, about: Mapping[str, Any], arrays: Mapping[str, Any]) -> None:
    """Write a file, whole or not at all; what a power cut leaves cannot be read.

    Raises:
        OSError: The disk refuses.
    """
    places, size = dict[str, Any](), 0
    for name, array in arrays.items():
        places[name] = [array.dtype.str, array.shape, size]
        size += -(-array.nbytes // _LINE) * _LINE
    head = {"about": about, "arrays": places, "bytes": size, "checksum": _checksum(arrays)}
    described = json_text(head).encode()
    start = -(-(_HEAD + len(described)) // _LINE) * _LINE
    content = bytearray(start + size)
    content[:_HEAD] = np.array([len(described), zlib.crc32(described)], "<u8").tobytes()
    content[_HEAD : _HEAD + len(described)] = described
    for name, array in arrays.items():
        at = start + places[name][2]
        content[at : at + array.nbytes] = np.ascontiguousarray(array).tobytes()
    path.parent.mkdir(mode=0o700, parents=True, exist_ok=True)
    replace_file(path, memoryview(content), durable=False)


def map_arrays(path: Path, *, whole: bool = False) -> ArraysFile:
    """The arrays of a file.

    Args:
        path: The file.
        whole: Whether what the arrays hold is compared with their checksum, which reads all of it.

    Raises:
        OSError: It cannot be read.
        ValueError: It is not what was written.
    """
    found, checksum = _mapped(path)
    # A file from before there was a checksum has none to compare.
    if whole and checksum is not None and _checksum(found.arrays) != checksum:
        raise ValueError(f"{path.name} is not what was written")
    return found


def _checksum(arrays: Mapping[str, Any]) -> int:
    now = 0
    for array in arrays.values():
        now = zlib.crc32(np.ascontiguousarray(array).tobytes(), now)
    return now


def _mapped(path: Path) -> tuple[ArraysFile, int | None]:
    """The arrays of a file, and their checksum."""
    raw = np.asarray(np.memmap(path, np.uint8, "r"))
    length, checksum = np.frombuffer(raw[:_HEAD].tobytes(), "<u8").tolist()
    described = raw[_HEAD : _HEAD + length].tobytes()
    if zlib.crc32(described) != checksum:
        raise ValueError(f"{path.name} is not what was written")
    head = json.loads(described)
    start = -(-(_HEAD + length) // _LINE) * _LINE
    if len(raw) != start + head["bytes"]:
        raise ValueError(f"{path.name} is not whole")
    arrays = {}
    for name, (kind, shape, at) in head["arrays"].items():
        dtype = np.dtype(kind)
        end = start + at + dtype.itemsize * int(np.prod(shape, dtype=int))
        arrays[name] = raw[start + at : end].view(dtype).reshape(shape)
    return ArraysFile(head["about"], arrays), head.get("checksum")
