"""Folders and zip files behind one small interface, and paths that stay where they belong."""

from __future__ import annotations

import os
import re
import stat
import unicodedata
import zipfile
import zlib
from bisect import bisect_left
from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path
from typing import IO, Protocol
from urllib.parse import unquote

from app.config import Settings
from app.datasets.plain_file import open_plain
from app.datasets.report import Report
from app.errors import DatasetFormatError, UnsafePathError
from app.finite import quoted
from app.nested_zip import UNREADABLE, open_nested, open_zip

_DRIVE = re.compile(r"[A-Za-z]:")
_RATIO_FLOOR = 1024 * 1024
_CHUNK = 1024 * 1024
MAX_PART = 255
"""Most bytes of the name of a file or folder; what is longer fits on no disk."""


@dataclass(frozen=True)
class Limits:
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
    def of(settings: Settings) -> Limits:
        """The limits that an operator has set."""
        return Limits(members=settings.max_members, file_bytes=settings.max_file_bytes)


DEFAULT_LIMITS = Limits()


def check_name(path: str) -> str:
    """The relative path unchanged, when it stays inside whatever folder it is joined to.

    Raises:
        UnsafePathError: Empty, absolute, longer than disks take, with a drive letter, ``..``,
            backslash or control character; also when only its decoded or normalised spelling is so.
    """
    for spelling in _spellings(path):
        problem = _unsafe(spelling)
        if problem:
            raise UnsafePathError(f"the path {quoted(path, 200)} {problem}")
    if any(len(part.encode()) > MAX_PART for part in path.split("/")):
        raise UnsafePathError(
            f"the path {quoted(path, 200)} has a part of more than {MAX_PART} bytes"
        )
    return path


def resolve_inside(root: Path, path: str) -> Path:
    """The real path of ``path`` below ``root``; symbolic links may not lead out of it.

    Args:
        root: Folder that must contain the result; may itself be a symbolic link.
        path: Relative, with forward slashes; need not exist.

    Raises:
        UnsafePathError: The path would leave the folder.
    """
    check_name(path)
    real_root = Path(os.path.realpath(root))
    real = Path(os.path.realpath(real_root / path))
    if real != real_root and real_root not in real.parents:
        raise UnsafePathError(f"the path {quoted(path, 200)} leads out of its folder")
    return real


def _spellings(path: str) -> list[str]:
    spellings = [path, unicodedata.normalize("NFKC", path)]
    decoded = path
    for _ in range(3):
        decoded = unquote(decoded)
        spellings += [decoded, unicodedata.normalize("NFKC", decoded)]
    return spellings


def _unsafe(path: str) -> str | None:
    if not path:
        return "is empty"
    if "\\" in path or any(ord(letter) < 32 or letter == "\x7f" for letter in path):
        return "holds a backslash or a control character"
    if any(0xD800 <= ord(letter) <= 0xDFFF for letter in path):
        return "is not valid text"
    if path.startswith("/") or _DRIVE.match(path):
        return "is absolute"
    if ".." in path.split("/"):
        return "holds '..'"
    return None


class FileTree(Protocol):
    """Files by relative name (forward slashes), in a folder or in a zip."""

    path: Path
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

    def close(self) -> None:
        """Release the archive."""


def open_tree(path: Path, report: Report, limits: Limits = DEFAULT_LIMITS) -> FileTree | None:
    """The folder, zip or single file at ``path``; None (and one problem) when it is unreadable.

    Members of an archive that are unsafe are left out, with a problem each.
    """
    if path.is_dir():
        return FolderTree(path, report, limits)
    if not path.exists():
        report.note(str(path), None, None, "does not exist")
        return None
    try:
        with open_plain(path) as file:
            is_zip = file.read(2) == b"PK" or path.suffix.lower() == ".zip"
        return ZipTree(path, report, limits) if is_zip else FileAlone(path, report, limits)
    except DatasetFormatError as error:
        report.skip(error)
    except OSError as error:
        report.note(str(path), None, None, f"cannot be read ({error.strerror})")
    return None


class FolderTree:
    """The files below a folder."""

    def __init__(self, path: Path, report: Report, limits: Limits):
        self.path = path
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
                self._list(inside, found, pending)
            except OSError as error:
                problem = f"cannot be read ({error.strerror})"
                self._report.note(self.shown(inside), None, None, problem)
        return sorted(found)

    def _list(self, inside: str, found: list[str], pending: list[str]) -> None:
        with os.scandir(self.path / inside) as entries:
            for entry in entries:
                name = inside + entry.name
                if _is_hidden(entry.name) or not self._is_inside(entry, name):
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
            return _read_capped(file, self._limits.file_bytes, self.shown(name))

    def open(self, name: str) -> IO[bytes]:
        """The content as a stream."""
        shown = self.shown(name)
        try:
            return open_plain(resolve_inside(self.path, name), shown)
        except UnsafePathError as error:
            raise DatasetFormatError(shown, None, None, error.message) from error
        except OSError as error:
            problem = f"cannot be read ({error.strerror})"
            raise DatasetFormatError(shown, None, None, problem) from error

    def shown(self, name: str) -> str:
        """The name as a person knows it."""
        return str(self.path / name).encode("utf-8", "replace").decode()

    def close(self) -> None:
        """Nothing to release."""


class FileAlone(FolderTree):
    """One file as if it were alone in its folder."""

    def __init__(self, path: Path, report: Report, limits: Limits):
        super().__init__(path.parent, report, limits)
        self._name = path.name

    def names(self) -> list[str]:
        """Its name."""
        return [self._name]


class ZipTree:
    """The members of a zip file, read in place.

    Raises:
        DatasetFormatError: Not a complete zip file, or beyond the limits.
    """

    def __init__(
        self, path: Path, report: Report, limits: Limits, archive: zipfile.ZipFile | None = None
    ):
        self.path = path
        self._limits = limits
        self._archive = _open_zip(path) if archive is None else archive
        self._count = self._total = 0
        try:
            self._members = self._checked(report)
        except DatasetFormatError:
            self._archive.close()
            raise

    def nested(self, name: str, report: Report) -> ZipTree:
        """The members of a zip file that is itself a member, read in place.

        What the zip files inside hold counts toward the limits of the one around them. A zip
        file inside one of them is a file like any other, and is not opened.

        Raises:
            DatasetFormatError: It is damaged, or beyond the limits.
        """
        shown = self.shown(name)
        member = self._members.get(name)
        if member is None:
            raise DatasetFormatError(shown, None, None, "is not in the zip file")
        grown = max(member.file_size, 1) / max(member.compress_size, 1)
        limits = replace(
            self._limits,
            members=self._limits.members - self._count,
            total_bytes=self._limits.total_bytes - self._total + member.file_size,
            ratio=max(int(self._limits.ratio / max(grown, 1.0)), 1),
        )
        try:
            archive = open_nested(self._archive, self.path, member)
        except (*_BROKEN, ValueError, UnicodeError) as error:
            problem = f"cannot be opened inside the zip file ({error})."
            raise DatasetFormatError(shown, None, None, problem) from error
        inner = ZipTree(Path(shown), report, limits, archive)
        self._count += inner._count
        self._total += inner._total - member.file_size
        return inner

    def names(self) -> list[str]:
        """Every member that is a safe plain file, sorted."""
        return sorted(self._members)

    def read_bytes(self, name: str) -> bytes:
        """The whole content of one member."""
        with self.open(name) as file:
            return _read_capped(file, self._limits.file_bytes, self.shown(name))

    def open(self, name: str) -> IO[bytes]:
        """The content as a stream."""
        member = self._members.get(name)
        if member is None:
            raise DatasetFormatError(self.shown(name), None, None, "is not in the zip file")
        try:
            return self._archive.open(member)
        except (*_BROKEN, UnicodeError) as error:
            problem = "is damaged or encrypted inside the zip file"
            raise DatasetFormatError(self.shown(name), None, None, problem) from error

    def shown(self, name: str) -> str:
        """The name as a person knows it."""
        return f"{self.path}/{name}"

    def close(self) -> None:
        """Close the zip file."""
        self._archive.close()

    def _checked(self, report: Report) -> dict[str, zipfile.ZipInfo]:
        members = self._archive.infolist()
        self._check_totals(members)
        # Names that differ in case alone are one file on some disks: which one is meant?
        folded = Counter(member.filename.rstrip("/").casefold() for member in members)
        checked = {}
        for member in members:
            # A name that begins with NUL is empty, which ``is_dir`` does not survive.
            if member.filename.endswith("/") or any(map(_is_hidden, member.filename.split("/"))):
                continue
            problem = self._problem(member, folded)
            if problem is None:
                checked[member.filename] = member
            else:
                report.note(str(self.path), member.filename[:200], None, problem)
        return checked

    def _check_totals(self, members: list[zipfile.ZipInfo]) -> None:
        limits, shown = self._limits, str(self.path)
        if len(members) > limits.members:
            problem = f"has {len(members):,} members; at most {limits.members:,} are read"
            raise DatasetFormatError(shown, None, None, problem)
        total = sum(member.file_size for member in members)
        if total > limits.total_bytes:
            problem = f"unpacks to {total:,} bytes; at most {limits.total_bytes:,} are read"
            raise DatasetFormatError(shown, None, None, problem)
        self._count, self._total = len(members), total

    def _problem(self, member: zipfile.ZipInfo, folded: Counter[str]) -> str | None:
        kind = stat.S_IFMT(member.external_attr >> 16)
        if kind not in (0, stat.S_IFREG):
            return "is a link or device, not a plain file"
        if member.flag_bits & UNREADABLE:
            return "has a name that is no text, so it cannot be read"
        if folded[member.filename.casefold()] > 1:
            return "is there more than once, or under names that differ in case alone"
        if member.file_size > _RATIO_FLOOR and (
            member.file_size > self._limits.ratio * max(member.compress_size, 1)
        ):
            return f"grows more than {self._limits.ratio} times when it is unpacked"
        try:
            # ZipInfo itself cuts a name at NUL and turns backslashes; look at the original.
            check_name(member.orig_filename)
        except UnsafePathError as error:
            return error.message
        return None


_BROKEN = (zipfile.BadZipFile, zlib.error, EOFError, RuntimeError, NotImplementedError, OSError)


def _open_zip(path: Path) -> zipfile.ZipFile:
    try:
        return open_zip(path)
    except (*_BROKEN, ValueError, UnicodeError) as error:
        problem = "is not a complete zip file; was it cut off while it was copied?"
        raise DatasetFormatError(str(path), None, None, problem) from error


def _read_capped(file: IO[bytes], limit: int, shown: str) -> bytes:
    """All bytes of a stream; real bytes are counted, whatever a header declares."""
    return b"".join(capped_chunks(file, limit, shown))


def capped_chunks(file: IO[bytes], limit: int, shown: str) -> Iterator[bytes]:
    """A stream in chunks.

    Raises:
        DatasetFormatError: It holds more than ``limit`` bytes, or is damaged.
    """
    total = 0
    while chunk := _chunk(file, shown):
        total += len(chunk)
        if total > limit:
            raise DatasetFormatError(shown, None, None, f"is longer than {limit:,} bytes")
        yield chunk


def _chunk(file: IO[bytes], shown: str) -> bytes:
    try:
        return file.read(_CHUNK)
    except _BROKEN as error:
        raise DatasetFormatError(
            shown, None, None, "is damaged, here or in its zip file"
        ) from error


def _is_hidden(name: str) -> bool:
    return (name.startswith(".") and name not in (".", "..")) or name == "__MACOSX"


def files_inside(names: list[str], folder: str) -> set[str]:
    """The names below a folder among sorted ones, each without that folder."""
    first = bisect_left(names, folder)
    last = bisect_left(names, folder + chr(0x10FFFF))
    return {name[len(folder) :] for name in names[first:last]}
