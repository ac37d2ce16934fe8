"""Lost members: how many a zip file says that it has, in the record at its end, and its list has not.

``zipfile`` believes the list of members alone. A damaged byte there, such as a length, makes it
read over members, which would be missing without a word.

Source: .ZIP File Format Specification (APPNOTE 6.3), sections 4.3.14 to 4.3.16.
"""

from __future__ import annotations

import os
import struct
import zipfile

_END = struct.Struct("<4s4H2IH")
"""Signature, two disks, members on this one and in all, bytes and place of the list, comment."""
_LOCATOR = struct.Struct("<4sIQI")
_END_64 = struct.Struct("<4sQ2H2I4Q")
_MANY = 0xFFFF
"""As many, or more: a second record says how many."""


def lost_members(archive: zipfile.ZipFile) -> int:
    """How many members more the end of a zip file says than its list has; below 0: fewer.

    Old programs count no further than 65,535 and begin again; 0 where no end can be found.
    """
    promised, listed = _promised(archive), len(archive.infolist())
    if promised is None:
        return 0
    count, whole = promised
    return count - (listed if whole else listed & _MANY)


def _promised(archive: zipfile.ZipFile) -> tuple[int, bool] | None:
    """The number of members, and whether it is known beyond 65,535."""
    file = archive.fp
    if file is None:
        return None
    wanted = _END_64.size + _LOCATOR.size + _END.size + len(archive.comment)
    size = file.seek(0, os.SEEK_END)
    file.seek(max(size - wanted, 0))
    tail = file.read(wanted)
    end = len(tail) - _END.size - len(archive.comment)
    if end < 0:
        return None
    signature, *_, count, _bytes, _place, _comment = _END.unpack_from(tail, end)
    if signature != b"PK\5\6":
        return None
    start = end - _LOCATOR.size - _END_64.size
    if count == _MANY and start >= 0 and tail[start : start + 4] == b"PK\6\6":
        return int(_END_64.unpack_from(tail, start)[7]), True
    return int(count), False
