"""Opens what files lie in: a folder, a zip, an object store."""

from __future__ import annotations

import io
import os
import stat
import zipfile
from collections import Counter
from collections.abc import Iterator
from contextlib import closing, contextmanager, nullcontext, suppress
from dataclasses import replace
from pathlib import Path
from typing import IO

from app.errors import DatasetFormatError, TooLargeError, UnsafePathError
from app.formats.file_tree import BROKEN, DEFAULT_LIMITS, FileTree, ImportLimits, Root, read_limited
from app.formats.report import ReaderReport
from app.formats.safe_path import is_hidden, open_regular_file, require_safe_path, resolve_inside
from app.object_store.path import StoredPath
from app.object_store.store import StoredObject
from app.soccer.group import Media
from app.zip_file import UNREADABLE, FilePart, count_unlisted_members, open_nested, open_zip

_RATIO_FLOOR = 1024 * 1024
_UTF_8 = 0x800
"""Flag of members whose names say that they are UTF-8."""


class ZipTree:
    """The members of a zip file, read in place.

    Raises:
        DatasetFormatError: Not a complete zip file, or beyond the limits.
    """

    def __init__(
        self,
        path: Root,
        report: ReaderReport,
        limits: ImportLimits,
        archive: zipfile.ZipFile | None = None,
    ):
        self.path = path
        self._limits = limits
        self._archive = _open_zip(path) if archive is None else archive
        self._count = self._total = 0
        try:
            self._members = self._select_safe_members(report)
        except DatasetFormatError:
            self._archive.close()
            raise

    def open_nested_zip(self, name: str, report: ReaderReport) -> ZipTree:
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
        except (*BROKEN, ValueError, UnicodeError) as error:
            problem = f"cannot be opened inside the zip file ({error})."
            raise DatasetFormatError(shown, None, None, problem) from error
        inner = ZipTree(self.path / name, report, limits, archive)
        self._count += inner._count
        self._total += inner._total - member.file_size
        return inner

    def names(self) -> list[str]:
        """Every member that is a safe plain file, sorted."""
        return sorted(self._members)

    def read_bytes(self, name: str) -> bytes:
        """The whole content of one member."""
        with self.open(name) as file:
            return read_limited(file, self._limits.file_bytes, self.shown(name))

    def open(self, name: str) -> IO[bytes]:
        """The content as a stream."""
        member = self._members.get(name)
        if member is None:
            raise DatasetFormatError(self.shown(name), None, None, "is not in the zip file")
        try:
            return self._archive.open(member)
        except (*BROKEN, UnicodeError) as error:
            problem = "is damaged or encrypted inside the zip file"
            raise DatasetFormatError(self.shown(name), None, None, problem) from error

    def shown(self, name: str) -> str:
        """The name as a person knows it."""
        return f"{self.path}/{name}"

    def media(self, name: str) -> Media:
        """Where a member can be read later."""
        return self._locate_member_media(self.stored_name(name))

    def media_in_zip(self, name: str, member: str) -> Media:
        """Where a member of a zip file that is a member can be read later."""
        return self._locate_member_media(f"{self.stored_name(name)}/{member}")

    def stored_name(self, name: str) -> str:
        """The name of a member as the zip file itself spells it, by which it is opened later."""
        found = self._members.get(name)
        return name if found is None else found.filename

    def _locate_member_media(self, member: str) -> Media:
        if isinstance(self.path, StoredPath):
            return Media(self.path.make_pinned_address(), member)
        return Media(str(self.path), member)

    def close(self) -> None:
        """Close the zip file."""
        self._archive.close()

    def _select_safe_members(self, report: ReaderReport) -> dict[str, zipfile.ZipInfo]:
        members = self._archive.infolist()
        self._check_total_size_and_count(members)
        if lost := count_unlisted_members(self._archive):
            damage = (
                f"has a damaged list of members: it should have {len(members) + lost:,} and has"
                f" {len(members):,}; copy it again, or read the folder that it was made of"
            )
            report.add_problem_at(str(self.path), None, None, damage)
        # Names that differ in case alone are one file on some disks: which one is meant?
        names = [decode_member_name(member) for member in members]
        folded = Counter(name.rstrip("/").casefold() for name in names)
        checked = {}
        for name, member in zip(names, members, strict=True):
            # A name that begins with NUL is empty, which ``is_dir`` does not survive.
            if name.endswith("/") or any(map(is_hidden, name.split("/"))):
                continue
            problem = self._find_member_problem(member, name, folded)
            if problem is None:
                checked[name] = member
            else:
                # As the zip file spells it: that is what a person looks for.
                shown = member.filename if "\\" in member.filename else name
                report.add_problem_at(str(self.path), shown[:200], None, problem)
        return checked

    def _check_total_size_and_count(self, members: list[zipfile.ZipInfo]) -> None:
        limits, shown = self._limits, str(self.path)
        if len(members) > limits.members:
            problem = f"has {len(members):,} members, and the limit is {limits.members:,}: split it"
            raise DatasetFormatError(shown, None, None, problem)
        total = sum(member.file_size for member in members)
        if total > limits.total_bytes:
            problem = (
                f"unpacks to {total:,} bytes, and the limit is {limits.total_bytes:,}: split it"
            )
            raise DatasetFormatError(shown, None, None, problem)
        self._count, self._total = len(members), total

    def _find_member_problem(
        self, member: zipfile.ZipInfo, name: str, folded: Counter[str]
    ) -> str | None:
        kind = stat.S_IFMT(member.external_attr >> 16)
        if kind not in (0, stat.S_IFREG):
            return "is a link or device, not a regular file"
        if member.flag_bits & UNREADABLE:
            return "has a name that is not text, so it cannot be read"
        if folded[name.casefold()] > 1:
            return "is there more than once, or under names that differ in case alone"
        if member.file_size > _RATIO_FLOOR and (
            member.file_size > self._limits.ratio * max(member.compress_size, 1)
        ):
            return f"grows more than {self._limits.ratio} times when it is unpacked"
        try:
            # ZipInfo itself cuts a name at NUL; look at the original.
            require_safe_path(member.orig_filename.replace("\\", "/"))
        except UnsafePathError as error:
            return error.message
        return None


def decode_member_name(member: zipfile.ZipInfo) -> str:
    """The name of a member with forward slashes, in the letters that its writer meant.

    Windows' own programs wrote backslashes. Names without the mark for UTF-8 are read as cp437,
    and many programs write UTF-8 all the same: what is UTF-8 byte for byte is taken for that.
    """
    name = member.filename
    if not name.isascii() and not member.flag_bits & _UTF_8:
        with suppress(UnicodeError):
            name = name.encode("cp437").decode("utf-8")
    return name.replace("\\", "/")


def _open_zip(path: Root) -> zipfile.ZipFile:
    try:
        return open_zip(path)
    except (*BROKEN, ValueError, UnicodeError) as error:
        problem = "is not a complete zip file; was it cut off while it was copied?"
        raise DatasetFormatError(str(path), None, None, problem) from error


class FolderTree:
    """The files below a folder."""

    def __init__(self, path: Path, report: ReaderReport, limits: ImportLimits):
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
                self._report.add_problem_at(self.shown(inside), None, None, problem)
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
        self._report.add_problem_at(self.shown(name), None, None, problem)
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

    def open_nested_zip(self, name: str, report: ReaderReport) -> ZipTree:
        """The members of a zip file in the folder."""
        return ZipTree(self.path / name, report, self._limits)

    def close(self) -> None:
        """Nothing to release."""


class SingleFileTree(FolderTree):
    """One file as if it were alone in its folder."""

    def __init__(self, path: Path, report: ReaderReport, limits: ImportLimits):
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

    def __init__(self, path: StoredPath, report: ReaderReport, limits: ImportLimits):
        self.path = path if path.is_dir() else path.parent
        self._limits = limits
        self._found: dict[str, StoredObject] = {}
        start = len(self.path.key) + 1 if self.path.key else 0
        found = (
            self.path.store.iterate_objects_below(self.path.key)
            if path.stored is None
            else [path.stored]
        )
        for stored in found:
            name = stored.key[start:]
            if self._is_readable_name(name, report):
                self._found[name] = stored

    def _is_readable_name(self, name: str, report: ReaderReport) -> bool:
        if any(map(is_hidden, name.split("/"))):
            return False
        try:
            return bool(require_safe_path(name))
        except UnsafePathError as error:
            report.add_problem_at(str(self.path), name[:200], None, error.message)
            return False

    def names(self) -> list[str]:
        """Every object, sorted, without hidden ones."""
        return sorted(self._found)

    def read_bytes(self, name: str) -> bytes:
        """The whole content of one object."""
        stored, limit = self._find_stored_object(name), self._limits.file_bytes
        try:
            return self.path.store.read_whole(stored.key, limit, stored.etag)[0]
        except TooLargeError as error:
            problem = f"is longer than {limit:,} bytes"
            raise DatasetFormatError(self.shown(name), None, None, problem) from error

    def open(self, name: str) -> IO[bytes]:
        """The content as a stream."""
        path = self.path.make_object_path(self._find_stored_object(name))
        return io.BufferedReader(FilePart(path.reads(STREAM).pread, 0, path.size))

    def shown(self, name: str) -> str:
        """Its address."""
        return f"{self.path}/{name}" if self.path.key else f"{self.path}{name}"

    def media(self, name: str) -> Media:
        """Where an object can be read later, as long as it is this one."""
        return Media(
            self.path.make_object_path(self._find_stored_object(name)).make_pinned_address()
        )

    def media_in_zip(self, name: str, member: str) -> Media:
        """Where a member of a zip file in the store can be read later."""
        return Media(
            self.path.make_object_path(self._find_stored_object(name)).make_pinned_address(), member
        )

    def open_nested_zip(self, name: str, report: ReaderReport) -> ZipTree:
        """The members of a zip file in the store, of which no more than its list is fetched."""
        return ZipTree(
            self.path.make_object_path(self._find_stored_object(name)), report, self._limits
        )

    def close(self) -> None:
        """Nothing to release."""

    def _find_stored_object(self, name: str) -> StoredObject:
        stored = self._found.get(name)
        if stored is None:
            raise DatasetFormatError(self.shown(name), None, None, "is not in the store")
        return stored


def open_tree(
    path: Root, report: ReaderReport, limits: ImportLimits = DEFAULT_LIMITS
) -> FileTree | None:
    """The folder, zip or single file at ``path``; None (and one problem) when it is unreadable.

    Members of an archive that are unsafe are left out, with a problem each.
    """
    if isinstance(path, StoredPath):
        return _open_store_tree(path, report, limits)
    if path.is_dir():
        return FolderTree(path, report, limits)
    if not path.exists():
        report.add_problem_at(str(path), None, None, "does not exist")
        return None
    try:
        with open_regular_file(path) as file:
            # Arrays of numpy are a zip, too, and one file to whoever reads them.
            is_zip = path.suffix.lower() != ".npz" and (
                file.read(2) == b"PK" or path.suffix.lower() == ".zip"
            )
        return ZipTree(path, report, limits) if is_zip else SingleFileTree(path, report, limits)
    except DatasetFormatError as error:
        report.add_problem(error)
    except OSError as error:
        report.add_problem_at(str(path), None, None, f"cannot be read ({error.strerror})")
    return None


@contextmanager
def open_tree_context(
    path: Root, report: ReaderReport, limits: ImportLimits = DEFAULT_LIMITS
) -> Iterator[FileTree | None]:
    """``open_tree`` for as long as somebody reads from it."""
    tree = open_tree(path, report, limits)
    with nullcontext() if tree is None else closing(tree):
        yield tree


def _open_store_tree(
    path: StoredPath, report: ReaderReport, limits: ImportLimits
) -> FileTree | None:
    if path.is_dir() or path.suffix.lower() != ".zip":
        return StoreTree(path, report, limits)
    try:
        return ZipTree(path, report, limits)
    except DatasetFormatError as error:
        report.add_problem(error)
    return None
