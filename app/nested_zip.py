"""A zip file inside a zip file, read in place: one level, never deeper.

``<match>/Frames-v3.zip/7.png`` names the member ``7.png`` of the zip that is itself the member
``<match>/Frames-v3.zip``. A zip that was stored as it is (the usual way, it is compressed
already) is read where it lies; one that was compressed once more is unpacked for as long as it
is open, into a file without a name that is gone with the process.
"""

from __future__ import annotations

import io
import os
import stat
import struct
import tempfile
import zipfile
from pathlib import Path
from typing import Protocol

MAX_UNPACKED = 4 * 1024**3
"""Bytes of a compressed zip that are unpacked to reach its members."""

_CHUNK = 1024 * 1024
_HEADER = struct.Struct("<4s5H3I2H")
"""Local header of a member: name and extra field follow it, then the data."""
_SIGNATURE = b"PK\x03\x04"
_ENCRYPTED, _UTF_8 = 0x1, 0x800
UNREADABLE = 0x20
"""Flag of members that ``zipfile`` refuses to open (it means patched data, which nobody writes)."""
_LISTED = b"PK\x01\x02"
_ENTRY = struct.Struct("<8xH18x3H12x")
"""Of a member in the list: its flags, and how long its name, extra field and comment are."""
_ENTRY_BYTES = 46
_FLAGS, _FLAGS_AT = struct.Struct("<H"), 8


class Reads(Protocol):
    """Bytes of something, from any place in it."""

    def pread(self, count: int, at: int) -> bytes:
        """So many bytes from there, fewer at the end."""

    def close(self) -> None:
        """Nobody reads it any more."""


class Elsewhere(Protocol):
    """A file that lies on no disk here."""

    def reads(self) -> Reads:
        """Begin to read it."""

    @property
    def size(self) -> int:
        """Bytes."""


class _Handle:
    """A file of this machine."""

    def __init__(self, handle: int):
        self._handle = handle

    def pread(self, count: int, at: int) -> bytes:
        return os.pread(self._handle, count, at)

    def close(self) -> None:
        os.close(self._handle)


def open_zip_elsewhere(place: Elsewhere) -> zipfile.ZipFile:
    """``open_zip`` of a file that lies on no disk here; reads its list of members.

    Raises:
        zipfile.BadZipFile, ValueError: It is no zip file.
    """
    return _open_window(_Window(place.reads(), 0, place.size))


def open_zip(path: Path) -> zipfile.ZipFile:
    """Open a zip file; a member whose name is not the text that it is said to be is ``UNREADABLE``.

    Raises:
        zipfile.BadZipFile: It is no zip file, or no plain file.
        OSError, ValueError: It cannot be read.
    """
    if not stat.S_ISREG(path.stat().st_mode):
        raise zipfile.BadZipFile("is not a plain file")
    try:
        return zipfile.ZipFile(path)
    except UnicodeDecodeError:
        handle = os.open(path, os.O_RDONLY | os.O_CLOEXEC)
        return _with_any_names(_Window(_Handle(handle), 0, os.fstat(handle).st_size))


def _open_window(window: _Window) -> zipfile.ZipFile:
    try:
        return zipfile.ZipFile(window)
    except UnicodeDecodeError:
        return _with_any_names(window)


def _with_any_names(window: _Window) -> zipfile.ZipFile:
    window.lenient = True
    archive = zipfile.ZipFile(window)
    window.lenient = False
    return archive


def _without_false_marks(records: bytes) -> bytes:
    """The list of a zip's members, another mark in the place of that for UTF-8 at names that are not.

    Their own headers keep the false mark, so that ``zipfile`` could not open them anyway.
    """
    changed, at = bytearray(records), 0
    while records[at : at + 4] == _LISTED and at + _ENTRY_BYTES <= len(records):
        flags, name, extra, comment = _ENTRY.unpack_from(records, at)
        start = at + _ENTRY_BYTES
        try:
            records[start : start + name].decode("utf-8")
        except UnicodeDecodeError:
            _FLAGS.pack_into(changed, at + _FLAGS_AT, flags & ~_UTF_8 | UNREADABLE)
        at = start + name + extra + comment
    return bytes(changed)


def nested_name(archive: zipfile.ZipFile, name: str) -> tuple[str, str] | None:
    """The member that is a zip, and the name inside it; None where ``name`` is not of this kind.

    A member of exactly this name goes before.
    """
    parts = name.split("/")
    for count in range(1, len(parts)):
        outer = "/".join(parts[:count])
        if outer.lower().endswith(".zip") and outer in archive.NameToInfo:
            return outer, "/".join(parts[count:])
    return None


def open_nested(
    archive: zipfile.ZipFile,
    path: Path | Elsewhere,
    member: zipfile.ZipInfo,
) -> zipfile.ZipFile:
    """Open a zip that is a member of another.

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
        return _open_window(_stored(path, member))
    if not isinstance(path, Path):
        # To reach a member of it, all of it would have to be fetched.
        raise zipfile.BadZipFile("is a zip compressed inside another; put it there by itself")
    with tempfile.TemporaryFile() as file:
        total = 0
        with archive.open(member) as packed:
            while chunk := packed.read(_CHUNK):
                total += len(chunk)
                if total > MAX_UNPACKED:
                    raise zipfile.BadZipFile(f"unpacks to more than {MAX_UNPACKED:,} bytes")
                file.write(chunk)
        file.flush()
        return _open_window(_Window(_Handle(os.dup(file.fileno())), 0, total))


def _stored(path: Path | Elsewhere, member: zipfile.ZipInfo) -> _Window:
    if isinstance(path, Path):
        reads: Reads = _Handle(os.open(path, os.O_RDONLY | os.O_CLOEXEC))
    else:
        reads = path.reads()
    window = _Window(reads, member.header_offset, _HEADER.size)
    header = window.read(_HEADER.size)
    if len(header) < _HEADER.size or not header.startswith(_SIGNATURE):
        raise zipfile.BadZipFile("has no header where the zip file's list of members says")
    *_, name, extra = _HEADER.unpack(header)
    start = member.header_offset + _HEADER.size + name + extra
    return window.moved(start, member.file_size)


class _Window(io.RawIOBase):
    """A part of a file as a file; reading it moves nobody else's place in it.

    It closes what it reads when nobody holds it any more: a member may be under way while its
    archive is closed.
    """

    def __init__(self, reads: Reads, start: int, size: int):
        super().__init__()
        self._reads, self._start, self._size, self._at = reads, start, size, 0
        self.lenient = False
        """Whether it is read for the list of a zip's members, whose names may be no text."""

    def moved(self, start: int, size: int) -> _Window:
        """The same file, another part of it."""
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
        """Go to a place."""
        place = offset + {os.SEEK_SET: 0, os.SEEK_CUR: self._at, os.SEEK_END: self._size}[whence]
        if place < 0:
            raise ValueError("a place before the beginning")
        self._at = place
        return place

    def readinto(self, buffer: memoryview) -> int:  # type: ignore[override]
        """Fill a buffer as far as the part goes."""
        count = max(min(len(buffer), self._size - self._at), 0)
        data = self._reads.pread(count, self._start + self._at)
        if self.lenient and data.startswith(_LISTED):
            data = _without_false_marks(data)
        buffer[: len(data)] = data
        self._at += len(data)
        return len(data)

    def close(self) -> None:
        """Release the handle."""
        if not self.closed:
            self._reads.close()
        super().close()
