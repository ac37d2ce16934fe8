"""The folder of exports made over REST: a zip and, once that is complete, its record."""

from __future__ import annotations

import json
import re
import secrets
import time
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import asdict, dataclass, replace
from datetime import UTC, datetime, timedelta
from pathlib import Path
from typing import Any

from app.db.home import DAY, clear, last_written
from app.db.session import now
from app.durable import PARTIAL, replace_file
from app.errors import NotFoundError
from app.features.exports.service import ExportReport
from app.finite import json_text
from app.formats.export_formats import missing_for_use
from app.object_store.path import StoredPath

_ID = re.compile(r"[0-9a-f]{32}|[1-9][0-9]{0,18}")
"""Ids of jobs, and those of exports that were made before there were jobs."""


@dataclass(frozen=True)
class ExportEntry:
    """One finished export: what was asked for, and what came of it."""

    id: str
    request: dict[str, Any]
    created: str
    counts: dict[str, int]
    left_out: dict[str, int]
    missing_images: list[str]
    bytes: int
    stored: str | None = None
    """Where in an object store the zip lies, and what its content is called; None: here."""
    expired: bool = False
    """The zip was deleted because it was old; what it held is still known."""

    def expires(self, days: int) -> datetime | None:
        """When the zip is deleted where zips are kept for so many days (0: for good); None: never,
        or it is gone."""
        if not days or self.expired or self.stored is not None:
            return None
        return datetime.fromisoformat(self.created) + timedelta(days=days)

    @property
    def incomplete(self) -> str | None:
        """What the files still lack before they can be used; None: nothing."""
        return missing_for_use(self.request["format"], self.counts)


class ExportFolder:
    """Exports by id; ids and file names are ours, never the caller's."""

    def __init__(self, folder: Path):
        self.folder = folder

    @contextmanager
    def writing(self, name: str) -> Iterator[Path]:
        """A path beside the zip of an export, for this run to call its half written files after.

        What a server or a process that was killed at an export has left of it goes before, also
        under a server that is still at it: it is no longer theirs. After it goes what is this run's
        alone, for another server may have begun with it anew.
        """
        self.folder.mkdir(mode=0o700, parents=True, exist_ok=True)
        self._delete_partial_files(f"{name}.zip")
        beside = self.folder / f"{name}.zip.{secrets.token_hex(4)}"
        try:
            yield beside
        finally:
            self._delete_partial_files(beside.name)

    def keep(self, name: str, request: Mapping[str, Any], report: ExportReport) -> ExportEntry:
        """Record an export whose zip is written; only then it can be found.

        Args:
            name: Its id.
            request: What was asked for, plain JSON values.
            report: What came of it.
        """
        stored = None
        if isinstance(report.out, StoredPath):
            stored = report.out.of(report.out.store.head(report.out.key))
        entry = ExportEntry(
            id=name,
            request=dict(request),
            created=now(),
            counts=dict(report.counts),
            left_out=dict(report.left_out),
            missing_images=list(report.missing_images),
            bytes=self.content(name).stat().st_size if stored is None else stored.size,
            stored=None if stored is None else stored.sealed(),
        )
        self._write_record(entry)
        return entry

    def find(self, name: str) -> ExportEntry | None:
        """The finished export of that id, or None."""
        if not _ID.fullmatch(name) or not self._record_path(name).is_file():
            return None
        return ExportEntry(**json.loads(self._record_path(name).read_bytes()))

    def get(self, name: str) -> ExportEntry:
        """The finished export of that id.

        Raises:
            NotFoundError: There is none.
        """
        entry = self.find(name)
        if entry is None:
            raise NotFoundError("there is no such export")
        return entry

    def content(self, name: str) -> Path:
        """Path of the zip of an export."""
        return self.folder / f"{name}.zip"

    def forget(self, name: str) -> None:
        """Delete an export, its record first: what is listed has a file.

        One that lies in an object store was delivered there, and stays.
        """
        if _ID.fullmatch(name):
            self._record_path(name).unlink(missing_ok=True)
            self.content(name).unlink(missing_ok=True)

    def expire(self, days: int) -> int:
        """Delete zips that were finished so many days ago (0: none), and say how many.

        Their records stay, and say that they expired. What was delivered to an object store stays.
        """
        at, gone = datetime.now(UTC), 0
        for name in [path.stem for path in self.folder.glob("*.json")]:
            try:
                entry = self.find(name)
            except (ValueError, TypeError):
                # A record that is none of ours says nothing of its age.
                entry = None
            if entry is None:
                continue
            expires = entry.expires(days)
            if expires is not None and expires < at:
                # The record first: what is listed as ready has a file.
                entry = replace(entry, expired=True)
                self._write_record(entry)
                gone += 1
            if entry.expired:
                self.content(name).unlink(missing_ok=True)
        return gone

    def forget_unfinished(self) -> int:
        """Delete zips that never got their record, or lost it, and say how many: nothing lists them.

        One that was written within a day may get its record yet.
        """
        gone = 0
        for path in self.folder.glob("*.zip"):
            name, written = path.name.removesuffix(".zip"), last_written(path)
            known = not _ID.fullmatch(name) or self._record_path(name).exists()
            if not known and written is not None and written < time.time() - DAY:
                path.unlink(missing_ok=True)
                gone += 1
        return gone

    def _write_record(self, entry: ExportEntry) -> None:
        replace_file(self._record_path(entry.id), json_text(asdict(entry), ascii_=True).encode())

    def _delete_partial_files(self, name: str) -> None:
        for path in self.folder.glob(f".{name}.*{PARTIAL}"):
            clear(path)

    def _record_path(self, name: str) -> Path:
        return self.folder / f"{name}.json"
