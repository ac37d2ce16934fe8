"""The files below a folder of an object store, listed once and read in place."""

from __future__ import annotations

import io
from typing import IO

from app.datasets.file_tree import Limits
from app.datasets.report import Report
from app.datasets.safe_path import check_name, is_hidden
from app.datasets.zip_tree import ZipTree
from app.errors import DatasetFormatError, TooLargeError, UnsafePathError
from app.object_store.path import StoredPath
from app.object_store.store import Stored
from app.soccer.media import Media
from app.zip_file import FilePart

STREAM = 4 * 1024**2
"""Bytes that are fetched at once of a file that is read from its beginning to its end."""


class StoreTree:
    """The objects below a folder, or one object as if it were alone in its folder.

    Raises:
        NotFoundError, StorageError: The store cannot be asked.
    """

    def __init__(self, path: StoredPath, report: Report, limits: Limits):
        self.path = path if path.is_dir() else path.parent
        self._limits = limits
        self._found: dict[str, Stored] = {}
        start = len(self.path.key) + 1 if self.path.key else 0
        found = self.path.store.below(self.path.key) if path.stored is None else [path.stored]
        for stored in found:
            name = stored.key[start:]
            if self._is_sound(name, report):
                self._found[name] = stored

    def _is_sound(self, name: str, report: Report) -> bool:
        if any(map(is_hidden, name.split("/"))):
            return False
        try:
            return bool(check_name(name))
        except UnsafePathError as error:
            report.note(str(self.path), name[:200], None, error.message)
            return False

    def names(self) -> list[str]:
        """Every object, sorted, without hidden ones."""
        return sorted(self._found)

    def read_bytes(self, name: str) -> bytes:
        """The whole content of one object."""
        stored, limit = self._get(name), self._limits.file_bytes
        try:
            return self.path.store.read_whole(stored.key, limit, stored.etag)[0]
        except TooLargeError as error:
            problem = f"is longer than {limit:,} bytes"
            raise DatasetFormatError(self.shown(name), None, None, problem) from error

    def open(self, name: str) -> IO[bytes]:
        """The content as a stream."""
        path = self.path.of(self._get(name))
        return io.BufferedReader(FilePart(path.reads(STREAM).pread, 0, path.size))

    def shown(self, name: str) -> str:
        """Its address."""
        return f"{self.path}/{name}" if self.path.key else f"{self.path}{name}"

    def media(self, name: str) -> Media:
        """Where an object can be read later, as long as it is this one."""
        return Media(self.path.of(self._get(name)).sealed())

    def media_inside(self, name: str, member: str) -> Media:
        """Where a member of a zip file in the store can be read later."""
        return Media(self.path.of(self._get(name)).sealed(), member)

    def nested(self, name: str, report: Report) -> ZipTree:
        """The members of a zip file in the store, of which no more than its list is fetched."""
        return ZipTree(self.path.of(self._get(name)), report, self._limits)

    def close(self) -> None:
        """Nothing to release."""

    def _get(self, name: str) -> Stored:
        stored = self._found.get(name)
        if stored is None:
            raise DatasetFormatError(self.shown(name), None, None, "is not in the store")
        return stored
