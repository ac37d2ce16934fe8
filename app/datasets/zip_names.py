"""The first names of a zip: read from its list of members, and no more of it than they take.

``zipfile`` reads the whole list before it says one name, and a zip of 2 GiB may have a list of 40
million members.
"""

from __future__ import annotations

import os
import struct
from pathlib import Path
from typing import IO

MAX_LIST = 1024**2
"""Bytes of the list that are read."""
_MAX_COMMENT = 0xFFFF
"""Bytes that may follow the record at the end of a zip."""
_END, _END_MARK = struct.Struct("<12xL6x"), b"PK\x05\x06"
"""Its size of the list."""
_LOCATOR_BYTES, _LOCATOR_MARK = 20, b"PK\x06\x07"
_WIDE_END, _WIDE_END_MARK = struct.Struct("<40xQ8x"), b"PK\x06\x06"
"""The same of a ZIP64 file, in which it counts before the other."""
_ENTRY, _ENTRY_MARK = struct.Struct("<28x3H12x"), b"PK\x01\x02"
"""Of a member in the list: how long its name, extra field and comment are, which follow."""


def first_names(path: Path, most: int) -> list[str]:
    """Names of the first members that a zip lists; none where no list is where it has to be.

    Args:
        path: A plain file.
        most: How many names.

    Raises:
        OSError: It cannot be read.
    """
    with path.open("rb") as file:
        records = _start_of_list(file)
    names: list[str] = []
    at = 0
    while len(names) < most and at + _ENTRY.size <= len(records):
        if not records.startswith(_ENTRY_MARK, at):
            break
        name, extra, comment = _ENTRY.unpack_from(records, at)
        start = at + _ENTRY.size
        text = records[start : start + name].decode("utf-8", errors="replace")
        names.append(text.replace("\\", "/"))
        at = start + name + extra + comment
    return names


def _start_of_list(file: IO[bytes]) -> bytes:
    """The list lies right before the record at the end, which says how long it is."""
    most = _WIDE_END.size + _LOCATOR_BYTES + _END.size + _MAX_COMMENT
    begin = max(file.seek(0, os.SEEK_END) - most, 0)
    file.seek(begin)
    tail = file.read(most)
    end = tail.rfind(_END_MARK)
    if end < 0 or len(tail) < end + _END.size:
        return b""
    size: int = _END.unpack_from(tail, end)[0]
    wide_end = end - _LOCATOR_BYTES - _WIDE_END.size
    if wide_end >= 0 and tail.startswith(_LOCATOR_MARK, end - _LOCATOR_BYTES):
        if not tail.startswith(_WIDE_END_MARK, wide_end):
            return b""
        size, end = _WIDE_END.unpack_from(tail, wide_end)[0], wide_end
    if size > begin + end:
        return b""
    file.seek(begin + end - size)
    return file.read(min(size, MAX_LIST))
