"""Zip files beyond what ``zipfile`` does: in object stores, inside another zip, damaged, or very long.

``<match>/Frames-v3.zip/7.png`` names the member ``7.png`` of a zip that is itself a member. A zip that
is stored uncompressed, as is usual, is read where it lies: ``zipfile`` on such a member reads all bytes
up to the one that is sought (Python 3.11: 80 ms instead of 0.1 ms in a zip of 120 MB). One level is
opened, never deeper.

Source: .ZIP File Format Specification (APPNOTE 6.3), sections 4.3.7 and 4.3.12 to 4.3.16.
"""

from __future__ import annotations

import errno
import io
import os
import stat
import struct
import tempfile
import zipfile
from collections.abc import Callable, Iterator
from functools import partial
from pathlib import Path
from typing import IO, NamedTuple

from app.object_store.path import StoredPath

MAX_UNPACKED = 4 * 1024**3
"""Bytes of a compressed zip that are unpacked to reach its members."""
MAX_LIST = 1024**2
"""Bytes of a list of members that ``list_first_member_names`` reads: a zip of 2 GiB may list 40 million members."""
UNREADABLE = 0x20
"""Flag of members that ``zipfile`` refuses to open (it means patched data, which nobody writes)."""

_CHUNK = 1024 * 1024
_MAX_COMMENT = 0xFFFF
_ENCRYPTED, _UTF_8 = 0x1, 0x800
_HEADER, _HEADER_MARK = struct.Struct("<26x2H"), b"PK\3\4"
"""Of a member, before its data: how long its name and extra field are, which follow."""
_ENTRY, _ENTRY_MARK = struct.Struct("<8xH18x3H12x"), b"PK\1\2"
"""Of a member in the list: its flags, and how long its name, extra field and comment are."""
_END, _END_MARK = struct.Struct("<10xHL6x"), b"PK\5\6"
"""At the end of a zip: how many members the list has, and its bytes; it lies right before the record."""
_END_64, _END_64_MARK = struct.Struct("<32xQQ8x"), b"PK\6\6"
"""The same of a ZIP64 file, in which it counts before the other."""
_LOCATOR_BYTES, _LOCATOR_MARK = 20, b"PK\6\7"


def open_zip(path: Path | StoredPath) -> zipfile.ZipFile:
    """Open a zip file; a member whose name is not the text that it is said to be is ``UNREADABLE``.

    Raises:
        zipfile.BadZipFile: It is no zip file, or no plain file.
        OSError, ValueError: It cannot be read.
        StorageError, NotFoundError: Its store cannot be asked, or has it no more.
    """
    if isinstance(path, Path) and not stat.S_ISREG(path.stat().st_mode):
        raise zipfile.BadZipFile("is not a regular file")
    return _open_zip_of_part(_open_whole_file(path))


def open_nested(
    archive: zipfile.ZipFile, path: Path | StoredPath, member: zipfile.ZipInfo
) -> zipfile.ZipFile:
    """Open a zip that is a member of another.

    A member that is compressed is unpacked into a file without a name, which ends with the process.

    Args:
        archive: The outer zip, open.
        path: Its file.
        member: The inner zip; where it is compressed, the bytes that it unpacks to are counted.

    Raises:
        zipfile.BadZipFile: It is damaged, encrypted, no zip, or larger than the limit.
        OSError: It cannot be read, or there is no room to unpack it.
    """
    if member.flag_bits & _ENCRYPTED:
        raise zipfile.BadZipFile("is encrypted")
    if member.compress_type == zipfile.ZIP_STORED:
        file, at = _open_whole_file(path), member.header_offset
        file.seek(at)
        header = file.read(_HEADER.size)
        if len(header) < _HEADER.size or not header.startswith(_HEADER_MARK):
            raise zipfile.BadZipFile("has no header where the zip file's list of members says")
        start = at + _HEADER.size + sum(_HEADER.unpack(header))
        return _open_zip_of_part(file.restrict_to_part(start, member.file_size))
    if not isinstance(path, Path):
        # To reach a member of it, all of it would have to be fetched.
        raise zipfile.BadZipFile(
            "is a zip compressed inside another zip: unpack it and use it by itself"
        )
    with tempfile.TemporaryFile() as unpacked:
        total = 0
        with archive.open(member) as packed:
            while chunk := packed.read(_CHUNK):
                total += len(chunk)
                if total > MAX_UNPACKED:
                    raise zipfile.BadZipFile(f"unpacks to more than {MAX_UNPACKED:,} bytes")
                unpacked.write(chunk)
        unpacked.flush()
        return _open_zip_of_part(_make_part_of_handle(os.dup(unpacked.fileno()), total))


def split_nested_name(archive: zipfile.ZipFile, name: str) -> tuple[str, str] | None:
    """The member that is a zip, and the name inside it; None where ``name`` is not of this kind.

    A member of exactly this name goes before.
    """
    parts = name.split("/")
    for count in range(1, len(parts)):
        outer = "/".join(parts[:count])
        if outer.lower().endswith(".zip") and outer in archive.NameToInfo:
            return outer, "/".join(parts[count:])
    return None


def count_unlisted_members(archive: zipfile.ZipFile) -> int:
    """How many members more the end of a zip counts than its list has; below 0: fewer.

    ``zipfile`` believes the list alone: a damaged byte there, such as a length, makes it read over
    members without an error. Old programs count to 65,535 and begin again; 0 where there is no end.
    """
    end = None if archive.fp is None else _read_end_record(archive.fp)
    if end is None:
        return 0
    listed = len(archive.infolist())
    return end.members - (listed if end.is_wide else listed & 0xFFFF)


def list_first_member_names(path: Path, most: int) -> list[str]:
    """Names of the first members that a zip lists; none where no list is where it has to be.

    Args:
        path: A plain file.
        most: How many names.

    Raises:
        OSError: It cannot be read.
    """
    with path.open("rb") as file:
        end = _read_end_record(file)
        if end is None or end.list_bytes > end.at:
            return []
        file.seek(end.at - end.list_bytes)
        records = file.read(min(end.list_bytes, MAX_LIST))
    names: list[str] = []
    for _at, _flags, name in _parse_member_records(records):
        if len(names) == most:
            break
        names.append(name.decode("utf-8", errors="replace").replace("\\", "/"))
    return names


class _EndRecord(NamedTuple):
    """What the end of a zip says: where it lies, bytes and members of the list before it, and whether
    the members are counted beyond 65,535."""

    at: int
    list_bytes: int
    members: int
    is_wide: bool


def _read_end_record(file: IO[bytes]) -> _EndRecord | None:
    most = _END_64.size + _LOCATOR_BYTES + _END.size + _MAX_COMMENT
    begin = max(file.seek(0, os.SEEK_END) - most, 0)
    file.seek(begin)
    tail = file.read(most)
    end = tail.rfind(_END_MARK, 0, max(len(tail) - _END.size, 0) + len(_END_MARK))
    if end < 0 or len(tail) < end + _END.size:
        return None
    members, size = _END.unpack_from(tail, end)
    wide = end - _LOCATOR_BYTES - _END_64.size
    if wide < 0 or not tail.startswith(_LOCATOR_MARK, end - _LOCATOR_BYTES):
        return _EndRecord(begin + end, size, members, False)
    if not tail.startswith(_END_64_MARK, wide):
        return _EndRecord(begin + end, 0, members, False)
    members, size = _END_64.unpack_from(tail, wide)
    return _EndRecord(begin + wide, size, members, True)


def _parse_member_records(records: bytes) -> Iterator[tuple[int, int, bytes]]:
    """Place, flags and name of each member in a list of members, as far as it is one."""
    at = 0
    while records.startswith(_ENTRY_MARK, at) and at + _ENTRY.size <= len(records):
        flags, name, extra, comment = _ENTRY.unpack_from(records, at)
        start = at + _ENTRY.size
        yield at, flags, records[start : start + name]
        at = start + name + extra + comment


class FilePart(io.RawIOBase):
    """A part of a file or object as a file; reading it moves no other reader's position.

    It closes what it reads when nothing refers to it any more: a member may be read while its archive is
    closed.

    Args:
        pread: Reads so many bytes from a position, fewer at the end.
        start: Where the part begins.
        size: Bytes of the part.
        close: Releases what is read.
    """

    def __init__(
        self,
        pread: Callable[[int, int], bytes],
        start: int,
        size: int,
        close: Callable[[], object] = lambda: None,
    ):
        super().__init__()
        self._pread, self._close = pread, close
        self._start, self._size, self._at = start, size, 0
        self.lenient = False
        """Whether names in a list of members that are no text are marked as such, not as UTF-8."""

    def restrict_to_part(self, start: int, size: int) -> FilePart:
        """This file, restricted to a part of it from now on."""
        self._start, self._size, self._at = start, size, 0
        return self

    def readable(self) -> bool:
        """Always true."""
        return True

    def seekable(self) -> bool:
        """Always true."""
        return True

    def tell(self) -> int:
        """Where the next read begins."""
        return self._at

    def seek(self, offset: int, whence: int = os.SEEK_SET) -> int:
        """Set where the next read begins."""
        place = offset + {os.SEEK_SET: 0, os.SEEK_CUR: self._at, os.SEEK_END: self._size}[whence]
        if place < 0:
            raise OSError(errno.EINVAL, "the position lies before the beginning of the file")
        self._at = place
        return place

    def read(self, size: int = -1, /) -> bytes:
        """So many bytes, fewer where the part ends; ``readinto`` would copy each once more."""
        left = max(self._size - self._at, 0)
        data = self._pread(left if size < 0 else min(size, left), self._start + self._at)
        if self.lenient and data.startswith(_ENTRY_MARK):
            data = _clear_false_utf8_marks(data)
        self._at += len(data)
        return data

    def readinto(self, buffer: memoryview) -> int:  # type: ignore[override]
        """Fill a buffer as far as the part goes."""
        data = self.read(len(buffer))
        buffer[: len(data)] = data
        return len(data)

    def close(self) -> None:
        """Release what is read."""
        if not self.closed:
            self._close()
        super().close()


def _open_whole_file(path: Path | StoredPath) -> FilePart:
    if isinstance(path, StoredPath):
        return FilePart(path.reads().pread, 0, path.size)
    handle = os.open(path, os.O_RDONLY | os.O_CLOEXEC)
    return _make_part_of_handle(handle, os.fstat(handle).st_size)


def _make_part_of_handle(handle: int, size: int) -> FilePart:
    return FilePart(partial(os.pread, handle), 0, size, partial(os.close, handle))


def _open_zip_of_part(file: FilePart) -> zipfile.ZipFile:
    try:
        return zipfile.ZipFile(file)
    except UnicodeDecodeError:
        file.lenient = True
        archive = zipfile.ZipFile(file)
        file.lenient = False
        return archive


def _clear_false_utf8_marks(records: bytes) -> bytes:
    """The list of a zip's members, another mark in the place of that for UTF-8 at names that are not.

    Their own headers keep the false mark, so that ``zipfile`` could not open them anyway.
    """
    changed = bytearray(records)
    for at, flags, name in _parse_member_records(records):
        try:
            name.decode("utf-8")
        except UnicodeDecodeError:
            struct.pack_into("<H", changed, at + 8, flags & ~_UTF_8 | UNREADABLE)
    return bytes(changed)
