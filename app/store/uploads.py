"""Uploads: files that a browser or script sends, one folder each, until they expire.

An upload's id is the digest of its name and content: sending a file again makes no second one,
and what an import noted about its place stays true.
"""

from __future__ import annotations

import hashlib
import json
import os
import re
import shutil
import uuid
from collections.abc import Iterator
from dataclasses import asdict, dataclass, replace
from datetime import UTC, datetime, timedelta
from pathlib import Path

from app.config import Settings
from app.errors import InputError, NotFoundError, TooLargeError
from app.finite import json_text
from app.store.clock import now

_ID = re.compile(r"[0-9a-f]{32}")
_UNSAFE = re.compile(r"[^A-Za-z0-9._ -]")
_MAX_NAME = 120
_RECORD = "upload.json"
_PART = ".part"
_PART_HOURS = 24
"""After so many hours a half-sent file is nobody's any more."""


@dataclass(frozen=True)
class Upload:
    """One uploaded file.

    Attributes:
        name: As it was sent, without what no file's name should have.
        kept: Whether a dataset reads frames from it, so that it does not expire.
    """

    id: str
    name: str
    bytes: int
    created: str
    kept: bool = False


def upload_path(settings: Settings, upload_id: str) -> Path:
    """Where the content of an upload is.

    Raises:
        NotFoundError: There is none of that id, or it has expired.
    """
    return settings.uploads / upload_id / get_upload(settings, upload_id).name


def get_upload(settings: Settings, upload_id: str) -> Upload:
    """An upload by its id.

    Raises:
        NotFoundError: There is none of that id, or it has expired.
    """
    record = settings.uploads / upload_id / _RECORD
    if not _ID.fullmatch(upload_id) or not record.is_file():
        raise NotFoundError(
            "there is no such upload", hint="Uploads expire after some days; send the file again."
        )
    return Upload(**json.loads(record.read_bytes()))


def list_uploads(settings: Settings) -> list[Upload]:
    """All uploads, the newest first."""
    return sorted(_all(settings), key=lambda item: (item.created, item.id), reverse=True)


def keep_upload(settings: Settings, upload_id: str) -> None:
    """Let an upload never expire: a dataset reads frames from it."""
    upload = get_upload(settings, upload_id)
    if not upload.kept:
        _write_record(settings.uploads / upload_id, replace(upload, kept=True))


def delete_upload(settings: Settings, upload_id: str) -> None:
    """Delete an upload.

    Raises:
        NotFoundError: There is none of that id.
        InputError: A dataset reads frames from it.
    """
    if get_upload(settings, upload_id).kept:
        raise InputError("a dataset reads its frames from this upload, so it stays")
    shutil.rmtree(settings.uploads / upload_id)


def expire_uploads(settings: Settings) -> int:
    """Delete what is older than the settings allow and half-sent files; returns how many."""
    day = datetime.now(UTC)
    gone = 0
    for upload in list(_all(settings)):
        age = day - datetime.fromisoformat(upload.created)
        if not upload.kept and age > timedelta(days=settings.upload_days):
            shutil.rmtree(settings.uploads / upload.id, ignore_errors=True)
            gone += 1
    for path in settings.uploads.glob(f"*{_PART}"):
        if day.timestamp() - path.stat().st_mtime > _PART_HOURS * 3600:
            path.unlink(missing_ok=True)
            gone += 1
    return gone


def _all(settings: Settings) -> Iterator[Upload]:
    for record in settings.uploads.glob(f"*/{_RECORD}"):
        yield Upload(**json.loads(record.read_bytes()))


def safe_name(name: str) -> str:
    """A name that any disk takes, as near to the sent one as can be.

    Raises:
        InputError: Nothing is left of it.
    """
    last = re.split(r"[/\\]", name)[-1]
    clean = _UNSAFE.sub("_", last).strip(" .")
    if not clean.strip("_"):
        raise InputError("an upload needs the name of a file", pointer="/name")
    path = Path(clean)
    return path.stem[: _MAX_NAME - len(path.suffix)] + path.suffix


class UploadWriter:
    """Takes an upload chunk by chunk; it is there when ``finish`` returns, or not at all."""

    def __init__(self, settings: Settings, name: str):
        self._settings, self._name = settings, safe_name(name)
        settings.uploads.mkdir(mode=0o700, parents=True, exist_ok=True)
        self._path = settings.uploads / f"{uuid.uuid4().hex}{_PART}"
        self._file = self._path.open("xb")
        self._digest = hashlib.sha256(self._name.encode() + b"\0")
        self.bytes = 0

    def write(self, chunk: bytes) -> None:
        """Add some bytes.

        Raises:
            TooLargeError: It is longer than the settings allow.
        """
        self.bytes += len(chunk)
        require_size(self._settings, self.bytes)
        self._digest.update(chunk)
        self._file.write(chunk)

    def finish(self) -> Upload:
        """Make it an upload.

        Raises:
            InputError: Nothing was sent.
        """
        if not self.bytes:
            self.abort()
            raise InputError("the upload is empty", hint="Send the file as the request's body.")
        self._file.flush()
        os.fsync(self._file.fileno())
        self._file.close()
        upload = Upload(self._digest.hexdigest()[:32], self._name, self.bytes, now())
        folder = self._settings.uploads / upload.id
        if (folder / _RECORD).is_file():
            self._path.unlink()
            return get_upload(self._settings, upload.id)
        folder.mkdir(mode=0o700, exist_ok=True)
        self._path.replace(folder / upload.name)
        _write_record(folder, upload)
        return upload

    def abort(self) -> None:
        """Leave nothing behind."""
        self._file.close()
        self._path.unlink(missing_ok=True)


def require_size(settings: Settings, size: int) -> None:
    """Raise TooLargeError where an upload of that size is not allowed."""
    if size > settings.max_upload_bytes:
        raise TooLargeError(
            f"an upload may have at most {settings.max_upload_bytes:,} bytes",
            hint="Import larger data from a folder that the operator allows.",
        )


def _write_record(folder: Path, upload: Upload) -> None:
    temporary = folder / f"{_RECORD}.new"
    with temporary.open("wb") as file:
        file.write(json_text(asdict(upload), ascii_=True).encode())
        file.flush()
        os.fsync(file.fileno())
    temporary.replace(folder / _RECORD)
