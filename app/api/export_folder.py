"""The folder of exports made over REST: a zip and, once that is complete, its record."""

from __future__ import annotations

import hashlib
import json
import os
import re
import threading
import uuid
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import asdict, dataclass
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

from app.api.errors import BusyError
from app.errors import IdempotencyError, NotFoundError
from app.review.export import ExportReport

_ID = re.compile(r"[0-9a-f]{32}")


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


class ExportFolder:
    """Exports by id; ids and file names are ours, never the caller's."""

    def __init__(self, folder: Path):
        self.folder = folder
        self._turn = threading.Lock()

    def make(
        self,
        request: dict[str, Any],
        key: str | None,
        write: Callable[[Path], ExportReport],
    ) -> ExportEntry:
        """Write an export, or return the one that this key already made.

        Args:
            request: What was asked for, plain JSON values.
            key: Idempotency key, or None.
            write: Writes the zip to the path that it is given .

        Raises:
            IdempotencyError: The key was used for another request.
            BusyError: Another export is being written.
        """
        name = uuid.uuid4().hex if key is None else _digest(key)
        with self._one_at_a_time():
            if key is not None and self._record(name).is_file():
                return self._repeated(name, request)
            self.folder.mkdir(mode=0o700, parents=True, exist_ok=True)
            report = write(self.content(name))
            entry = self._entry(name, request, report)
            _write_atomically(self._record(name), json.dumps(asdict(entry)).encode())
        return entry

    def get(self, name: str) -> ExportEntry:
        """The export of that id.

        Raises:
            NotFoundError: There is none.
        """
        if not _ID.fullmatch(name) or not self._record(name).is_file():
            raise NotFoundError("there is no such export")
        return ExportEntry(**json.loads(self._record(name).read_bytes()))

    def content(self, name: str) -> Path:
        """Path of the zip of an export."""
        return self.folder / f"{name}.zip"

    def _entry(self, name: str, request: dict[str, Any], report: ExportReport) -> ExportEntry:
        return ExportEntry(
            id=name,
            request=request,
            created=datetime.now(UTC).isoformat(),
            counts=dict(report.counts),
            left_out=dict(report.left_out),
            missing_images=list(report.missing_images),
            bytes=self.content(name).stat().st_size,
        )

    def _record(self, name: str) -> Path:
        return self.folder / f"{name}.json"

    def _repeated(self, name: str, request: dict[str, Any]) -> ExportEntry:
        entry = self.get(name)
        if entry.request != request:
            raise IdempotencyError("this Idempotency-Key was used for another export")
        return entry

    @contextmanager
    def _one_at_a_time(self) -> Iterator[None]:
        if not self._turn.acquire(blocking=False):
            raise BusyError("another export is being written", hint="Ask again in a few seconds.")
        try:
            yield
        finally:
            self._turn.release()


def _digest(key: str) -> str:
    return hashlib.sha256(key.encode()).hexdigest()[:32]


def _write_atomically(path: Path, content: bytes) -> None:
    """A reader sees the whole file or none, also after a power cut."""
    temporary = path.with_suffix(".part")
    with temporary.open("wb") as file:
        file.write(content)
        file.flush()
        os.fsync(file.fileno())
    temporary.replace(path)
