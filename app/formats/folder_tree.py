"""The files below a folder, or one file alone."""

from __future__ import annotations

import os
from pathlib import Path
from typing import IO

from app.errors import DatasetFormatError, UnsafePathError
from app.formats.file_tree import Limits, read_limited
from app.formats.plain_file import open_regular_file
from app.formats.report import Report
from app.formats.safe_path import is_hidden, resolve_inside
from app.formats.zip_tree import ZipTree
from app.soccer.media import Media


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
