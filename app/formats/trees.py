"""Opens what files lie in: a folder, a zip, an object store."""

from __future__ import annotations

import io
import os
from collections.abc import Iterator
from contextlib import closing, contextmanager, nullcontext
from pathlib import Path
from typing import IO

from app.errors import DatasetFormatError, TooLargeError, UnsafePathError
from app.formats.file_tree import DEFAULT_LIMITS, FileTree, Limits, Root, read_limited
from app.formats.report import Report
from app.formats.safe_path import is_hidden, open_regular_file, require_safe_path, resolve_inside
from app.formats.zip_tree import ZipTree
from app.object_store.path import StoredPath
from app.object_store.store import Stored
from app.soccer.group import Media
from app.zip_file import FilePart


class FolderTree:
    """The files below a folder."""

    def __init__(self, path: Path, report: Report, limits: Limits):
        self.path: Path = path
        self._report = report
        self._limits = limits

    def names(self) -> list[str]:
        """Every file, sorted, without hidden ones.

        Links that lead out of the folder, and linked folders, are left out with a problem each.
        """
        found: list[str] = []
        pending = [""]
        while pending:
            inside = pending.pop()
            try:
                self._list_folder(inside, found, pending)
            except OSError as error:
                problem = f"cannot be read ({error.strerror})"
                self._report.note(self.shown(inside), None, None, problem)
        return sorted(found)

    def _list_folder(self, inside: str, found: list[str], pending: list[str]) -> None:
        with os.scandir(self.path / inside) as entries:
            for entry in entries:
                name = inside + entry.name
                if is_hidden(entry.name) or not self._is_inside(entry, name):
                    continue
                if entry.is_dir():
                    pending.append(name + "/")
                else:
                    found.append(name)

    def _is_inside(self, entry: os.DirEntry[str], name: str) -> bool:
        if not entry.is_symlink():
            return True
        try:
            if resolve_inside(self.path, name).is_file():
                return True
            problem = "is a link to a folder or to nothing, which is not followed"
        except UnsafePathError:
            problem = "is a link that leads out of its folder, which is not followed"
        self._report.note(self.shown(name), None, None, problem)
        return False

    def read_bytes(self, name: str) -> bytes:
        """The whole content of one file."""
        with self.open(name) as file:
            return read_limited(file, self._limits.file_bytes, self.shown(name))

    def open(self, name: str) -> IO[bytes]:
        """The content as a stream."""
        shown = self.shown(name)
        try:
            return open_regular_file(resolve_inside(self.path, name), shown)
        except UnsafePathError as error:
            raise DatasetFormatError(shown, None, None, error.message) from error
        except OSError as error:
            problem = f"cannot be read ({error.strerror})"
            raise DatasetFormatError(shown, None, None, problem) from error

    def shown(self, name: str) -> str:
        """The name as a person knows it."""
        return str(self.path / name).encode("utf-8", "replace").decode()

    def media(self, name: str) -> Media:
        """Where one file can be read later."""
        return Media(self.shown(name))

    def media_in_zip(self, name: str, member: str) -> Media:
        """Where a member of a zip file in the folder can be read later."""
        return Media(str(self.path / name), member)

    def open_nested_zip(self, name: str, report: Report) -> ZipTree:
        """The members of a zip file in the folder."""
        return ZipTree(self.path / name, report, self._limits)

    def close(self) -> None:
        """Nothing to release."""


class SingleFileTree(FolderTree):
    """One file as if it were alone in its folder."""

    def __init__(self, path: Path, report: Report, limits: Limits):
        super().__init__(path.parent, report, limits)
        self._name = path.name

    def names(self) -> list[str]:
        """Its name."""
        return [self._name]


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
            if self._is_readable_name(name, report):
                self._found[name] = stored

    def _is_readable_name(self, name: str, report: Report) -> bool:
        if any(map(is_hidden, name.split("/"))):
            return False
        try:
            return bool(require_safe_path(name))
        except UnsafePathError as error:
            report.note(str(self.path), name[:200], None, error.message)
            return False

    def names(self) -> list[str]:
        """Every object, sorted, without hidden ones."""
        return sorted(self._found)

    def read_bytes(self, name: str) -> bytes:
        """The whole content of one object."""
        stored, limit = self._stored_object(name), self._limits.file_bytes
        try:
            return self.path.store.read_whole(stored.key, limit, stored.etag)[0]
        except TooLargeError as error:
            problem = f"is longer than {limit:,} bytes"
            raise DatasetFormatError(self.shown(name), None, None, problem) from error

    def open(self, name: str) -> IO[bytes]:
        """The content as a stream."""
        path = self.path.of(self._stored_object(name))
        return io.BufferedReader(FilePart(path.reads(STREAM).pread, 0, path.size))

    def shown(self, name: str) -> str:
        """Its address."""
        return f"{self.path}/{name}" if self.path.key else f"{self.path}{name}"

    def media(self, name: str) -> Media:
        """Where an object can be read later, as long as it is this one."""
        return Media(self.path.of(self._stored_object(name)).sealed())

    def media_in_zip(self, name: str, member: str) -> Media:
        """Where a member of a zip file in the store can be read later."""
        return Media(self.path.of(self._stored_object(name)).sealed(), member)

    def open_nested_zip(self, name: str, report: Report) -> ZipTree:
        """The members of a zip file in the store, of which no more than its list is fetched."""
        return ZipTree(self.path.of(self._stored_object(name)), report, self._limits)

    def close(self) -> None:
        """Nothing to release."""

    def _stored_object(self, name: str) -> Stored:
        stored = self._found.get(name)
        if stored is None:
            raise DatasetFormatError(self.shown(name), None, None, "is not in the store")
        return stored


def open_tree(path: Root, report: Report, limits: Limits = DEFAULT_LIMITS) -> FileTree | None:
    """The folder, zip or single file at ``path``; None (and one problem) when it is unreadable.

    Members of an archive that are unsafe are left out, with a problem each.
    """
    if isinstance(path, StoredPath):
        return _open_store_tree(path, report, limits)
    if path.is_dir():
        return FolderTree(path, report, limits)
    if not path.exists():
        report.note(str(path), None, None, "does not exist")
        return None
    try:
        with open_regular_file(path) as file:
            # Arrays of numpy are a zip, too, and one file to whoever reads them.
            is_zip = path.suffix.lower() != ".npz" and (
                file.read(2) == b"PK" or path.suffix.lower() == ".zip"
            )
        return ZipTree(path, report, limits) if is_zip else SingleFileTree(path, report, limits)
    except DatasetFormatError as error:
        report.skip(error)
    except OSError as error:
        report.note(str(path), None, None, f"cannot be read ({error.strerror})")
    return None


@contextmanager
def opened_tree(
    path: Root, report: Report, limits: Limits = DEFAULT_LIMITS
) -> Iterator[FileTree | None]:
    """``open_tree`` for as long as somebody reads from it."""
    tree = open_tree(path, report, limits)
    with nullcontext() if tree is None else closing(tree):
        yield tree


def _open_store_tree(path: StoredPath, report: Report, limits: Limits) -> FileTree | None:
    if path.is_dir() or path.suffix.lower() != ".zip":
        return StoreTree(path, report, limits)
    try:
        return ZipTree(path, report, limits)
    except DatasetFormatError as error:
        report.skip(error)
    return None
