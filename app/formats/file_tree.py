"""Files by relative name, wherever they lie, behind one small interface; and how much is taken of them."""

from __future__ import annotations

import zipfile
import zlib
from bisect import bisect_left
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import IO, TYPE_CHECKING, Protocol

from app.config import Settings
from app.errors import DatasetFormatError
from app.formats.report import ReaderReport
from app.object_store.path import StoredPath
from app.soccer.group import Media

if TYPE_CHECKING:
    from app.formats.trees import ZipTree

_CHUNK = 1024 * 1024
BROKEN = (zipfile.BadZipFile, zlib.error, EOFError, RuntimeError, NotImplementedError, OSError)
"""What reading raises where a zip file, or the disk below it, is damaged."""


@dataclass(frozen=True)
class ImportLimits:
    """How much an importer takes from one folder or archive.

    Attributes:
        members: Most members of an archive.
        file_bytes: Largest file, counted while it is read.
        total_bytes: Largest sum of the sizes that an archive declares.
        ratio: Most that a member above a megabyte may grow when unpacked.
    """

    members: int = 200_000
    file_bytes: int = 256 * 1024 * 1024
    total_bytes: int = 16 * 1024**3
    ratio: int = 200

    @staticmethod
    def of(settings: Settings) -> ImportLimits:
        """The limits that an operator has set."""
        return ImportLimits(members=settings.max_members, file_bytes=settings.max_file_bytes)


DEFAULT_LIMITS = ImportLimits()

Root = Path | StoredPath
"""Where a dataset lies: on a disk, or in an object store."""


class FileTree(Protocol):
    """Files by relative name (forward slashes), in a folder, in a zip or in an object store."""

    @property
    def path(self) -> Root:
        """The folder or the zip file itself."""

    def names(self) -> list[str]:
        """Every readable file, sorted."""

    def read_bytes(self, name: str) -> bytes:
        """The whole content of one file.

        Raises:
            DatasetFormatError: It cannot be read, or is larger than the limit.
        """

    def open(self, name: str) -> IO[bytes]:
        """The content as a stream; the caller counts what it takes."""

    def shown(self, name: str) -> str:
        """The name as a person knows it, for messages."""

    def media(self, name: str) -> Media:
        """Where one file can be read later, as a frame."""

    def media_in_zip(self, name: str, member: str) -> Media:
        """The same of a member of a zip file among the files."""

    def open_nested_zip(self, name: str, report: ReaderReport) -> ZipTree:
        """The members of a zip file among the files, read in place.

        Raises:
            DatasetFormatError: It is damaged, or beyond the limits.
        """

    def close(self) -> None:
        """Release the archive."""


def read_limited(file: IO[bytes], limit: int, shown: str) -> bytes:
    """All bytes of a stream; real bytes are counted, whatever a header declares."""
    return b"".join(read_limited_chunks(file, limit, shown))


def read_limited_chunks(file: IO[bytes], limit: int, shown: str) -> Iterator[bytes]:
    """A stream in chunks.

    Raises:
        DatasetFormatError: It holds more than ``limit`` bytes, or is damaged.
    """
    total = 0
    while chunk := _read_chunk(file, shown):
        total += len(chunk)
        if total > limit:
            raise DatasetFormatError(shown, None, None, f"is longer than {limit:,} bytes")
        yield chunk


def _read_chunk(file: IO[bytes], shown: str) -> bytes:
    try:
        return file.read(_CHUNK)
    except BROKEN as error:
        raise DatasetFormatError(shown, None, None, "is damaged, or its zip file is") from error


def list_files_in_folder(names: list[str], folder: str) -> set[str]:
    """The names below a folder among sorted ones, each without that folder."""
    first = bisect_left(names, folder)
    last = bisect_left(names, folder + chr(0x10FFFF))
    return {name[len(folder) :] for name in names[first:last]}
