"""The members of a zip file, read in place."""

from __future__ import annotations

import stat
import zipfile
from collections import Counter
from contextlib import suppress
from dataclasses import replace
from typing import IO

from app.errors import DatasetFormatError, UnsafePathError
from app.formats.file_tree import BROKEN, Limits, Root, read_limited
from app.formats.report import Report
from app.formats.safe_path import is_hidden, require_safe_path
from app.object_store.path import StoredPath
from app.soccer.group import Media
from app.zip_file import UNREADABLE, count_truncated, open_nested, open_zip

_RATIO_FLOOR = 1024 * 1024
_UTF_8 = 0x800
"""Flag of members whose names say that they are UTF-8."""


class ZipTree:
    """The members of a zip file, read in place.

    Raises:
        DatasetFormatError: Not a complete zip file, or beyond the limits.
    """

    def __init__(
        self, path: Root, report: Report, limits: Limits, archive: zipfile.ZipFile | None = None
    ):
        self.path = path
        self._limits = limits
        self._archive = _open_zip(path) if archive is None else archive
        self._count = self._total = 0
        try:
            self._members = self._checked_members(report)
        except DatasetFormatError:
            self._archive.close()
            raise

    def open_nested_zip(self, name: str, report: Report) -> ZipTree:
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
        return self._media_of_member(self.stored_name(name))

    def media_in_zip(self, name: str, member: str) -> Media:
        """Where a member of a zip file that is a member can be read later."""
        return self._media_of_member(f"{self.stored_name(name)}/{member}")

    def stored_name(self, name: str) -> str:
        """The name of a member as the zip file itself spells it, by which it is opened later."""
        found = self._members.get(name)
        return name if found is None else found.filename

    def _media_of_member(self, member: str) -> Media:
        if isinstance(self.path, StoredPath):
            return Media(self.path.sealed(), member)
        return Media(str(self.path), member)

    def close(self) -> None:
        """Close the zip file."""
        self._archive.close()

    def _checked_members(self, report: Report) -> dict[str, zipfile.ZipInfo]:
        members = self._archive.infolist()
        self._check_totals(members)
        if lost := count_truncated(self._archive):
            damage = (
                f"has a damaged list of members: it should have {len(members) + lost:,} and has"
                f" {len(members):,}; copy it again, or read the folder that it was made of"
            )
            report.note(str(self.path), None, None, damage)
        # Names that differ in case alone are one file on some disks: which one is meant?
        names = [member_name(member) for member in members]
        folded = Counter(name.rstrip("/").casefold() for name in names)
        checked = {}
        for name, member in zip(names, members, strict=True):
            # A name that begins with NUL is empty, which ``is_dir`` does not survive.
            if name.endswith("/") or any(map(is_hidden, name.split("/"))):
                continue
            problem = self._member_problem(member, name, folded)
            if problem is None:
                checked[name] = member
            else:
                # As the zip file spells it: that is what a person looks for.
                shown = member.filename if "\\" in member.filename else name
                report.note(str(self.path), shown[:200], None, problem)
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

    def _member_problem(
        self, member: zipfile.ZipInfo, name: str, folded: Counter[str]
    ) -> str | None:
        kind = stat.S_IFMT(member.external_attr >> 16)
        if kind not in (0, stat.S_IFREG):
            return "is a link or device, not a plain file"
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


def member_name(member: zipfile.ZipInfo) -> str:
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
