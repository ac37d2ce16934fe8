"""Uploads: files that a browser or script sends, one folder each, until they expire.

An upload's id is the digest of its name and content: sending a file again makes no second one,
and what an import noted about its place stays true. Its folder holds a record (``upload.json``)
and, in a folder of its own, the file under the name that it was sent with; it is complete before
it gets its name.
"""

from __future__ import annotations

import errno
import hashlib
import json
import os
import re
import threading
import uuid
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from dataclasses import asdict, dataclass, replace
from datetime import UTC, datetime, timedelta
from pathlib import Path

from app.config import Settings
from app.db.home import PART, delete_path
from app.db.locks import require_lock
from app.db.session import now
from app.durable import replace_file, sync_to_disk
from app.errors import ConflictError, InputError, NotFoundError, StorageError, TooLargeError
from app.features.imports.upload_quota import (
    count_used_bytes,
    find_person_quota,
    require_within_quota,
)
from app.json_text import json_text

_ID = re.compile(r"[0-9a-f]{32}")
_UNSAFE = re.compile(r"[^A-Za-z0-9._ -]")
_MAX_NAME = 120
_MAX_SUFFIX = 20
"""With its dot; what is longer tells no kind of file, and is cut like the rest of a name."""
_RECORD = "upload.json"
CONTENT = "content"
_CHUNK = 1 << 20
_STEP = 1 << 26
"""Bytes that are reserved at a time where nobody says how many come."""
_WRITING = threading.Lock()
WRITING_SECONDS = 10.0
"""So long one process waits for another that writes a record."""


@dataclass(frozen=True)
class Upload:
    """One uploaded file.

    Attributes:
        name: As it was sent, without what no file's name should have.
        kept: Whether a dataset reads frames from it, so that it does not expire.
        format: What it most likely holds, as was seen when it came.
        by: Who sent it, each of whom it belongs to.
        size: How many bytes it has once all parts of it are here; None: it came in one piece.
    """

    id: str
    name: str
    bytes: int
    created: str
    kept: bool = False
    format: str | None = None
    by: tuple[str, ...] = ()
    size: int | None = None

    @property
    def whole_size(self) -> int:
        """How many bytes the file has."""
        return self.bytes if self.size is None else self.size


@contextmanager
def lock_upload_records(settings: Settings) -> Iterator[None]:
    """Held from reading a record until what follows from it is written, among all processes.

    Raises:
        BusyError: Another process writes for too long.
    """
    with _WRITING:
        with _convert_storage_errors():
            ensure_folder_of_all_uploads(settings.uploads)
            folder = os.open(settings.uploads, os.O_RDONLY | os.O_CLOEXEC)
        try:
            require_lock(folder, "has been writing uploads", WRITING_SECONDS)
            yield
        finally:
            os.close(folder)


def ensure_folder_of_all_uploads(uploads: Path) -> None:
    """Make the folder of all uploads, if need be, so that it is there after a power cut."""
    if not uploads.is_dir():
        uploads.mkdir(mode=0o700, parents=True, exist_ok=True)
        sync_to_disk(uploads.parent)


def find_complete_upload_path(settings: Settings, upload_id: str) -> Path:
    """Where the content of an upload is.

    Raises:
        NotFoundError: There is none of that id, or it has expired.
        ConflictError: A part of it is missing.
    """
    upload = get_upload(settings, upload_id)
    if upload.bytes < upload.whole_size:
        raise ConflictError(
            f"only {upload.bytes:,} of {upload.whole_size:,} bytes of {upload.name} were received",
            hint="Send the rest of it first.",
        )
    return content_path(settings, upload)


def content_path(settings: Settings, upload: Upload) -> Path:
    """Where the file of an upload is, which may not be whole."""
    content = settings.uploads / upload.id / CONTENT
    # Uploads of earlier versions have their file beside the record.
    return (content if content.is_dir() else content.parent) / upload.name


def get_upload(settings: Settings, upload_id: str) -> Upload:
    """An upload by its id.

    Raises:
        NotFoundError: There is none of that id, or it has expired.
    """
    upload = read_upload(settings.uploads / upload_id) if _ID.fullmatch(upload_id) else None
    if upload is None:
        raise NotFoundError(
            "there is no such upload", hint="Uploads expire after some days; send the file again."
        )
    return upload


def list_uploads(settings: Settings) -> list[Upload]:
    """All uploads, the newest first."""
    return sorted(
        _iterate_uploads(settings), key=lambda item: (item.created, item.id), reverse=True
    )


def mark_upload_permanent(settings: Settings, upload_id: str, *, kept: bool = True) -> bool:
    """Let an upload never expire: a dataset reads frames from it. Or let it expire again.

    Returns:
        Whether that is another than before.
    """
    with lock_upload_records(settings):
        upload = get_upload(settings, upload_id)
        if upload.kept != kept:
            with _convert_storage_errors():
                write_upload_record(settings.uploads / upload_id, replace(upload, kept=kept))
    return upload.kept != kept


def delete_upload(
    settings: Settings, upload_id: str, mine: Callable[[str], bool] = lambda _actor: True
) -> None:
    """Delete an upload, or no longer be among those who sent it while others have sent it, too.

    Args:
        settings: Where it lies.
        upload_id: Which.
        mine: Whether whoever asks is that sender.

    Raises:
        NotFoundError: There is none of that id.
        InputError: A dataset reads frames from it.
    """
    with lock_upload_records(settings):
        upload = get_upload(settings, upload_id)
        require_unused_by_datasets(upload)
        others = tuple(actor for actor in upload.by if not mine(actor))
        if not others:
            _remove_folder(settings.uploads / upload_id)
            with _convert_storage_errors():
                sync_to_disk(settings.uploads)
            return
        with _convert_storage_errors():
            write_upload_record(settings.uploads / upload_id, replace(upload, by=others))


def require_unused_by_datasets(upload: Upload) -> None:
    """Raise InputError while a dataset reads frames from an upload."""
    if upload.kept:
        raise InputError("a dataset reads its frames from this upload, so it cannot be deleted")


def expire_uploads(settings: Settings) -> int:
    """Delete what is older than the settings allow, with a record or without; returns how many."""
    limit = datetime.now(UTC) - timedelta(days=settings.upload_days)
    gone = 0
    for folder in [path for path in settings.uploads.glob("*") if _ID.fullmatch(path.name)]:
        if _is_expired(folder, limit):
            with lock_upload_records(settings):
                if _is_expired(folder, limit):
                    _remove_folder(folder)
                    gone += 1
    return gone


def _is_expired(folder: Path, limit: datetime) -> bool:
    """Whether nobody needs a folder that has been there since before some moment."""
    upload = read_upload(folder)
    try:
        # Each part that comes is written down.
        since = datetime.fromtimestamp(folder.lstat().st_mtime, UTC)
    except FileNotFoundError:
        return False
    if upload is None:
        return since < limit and not _may_hold_dataset_frames(folder)
    if upload.size is None:
        since = datetime.fromisoformat(upload.created)
    return not upload.kept and since < limit


def _may_hold_dataset_frames(folder: Path) -> bool:
    """Whether a record that is none of ours keeps frames of a dataset: it says so, or cannot say no."""
    try:
        values = json.loads((folder / _RECORD).read_bytes())
    except FileNotFoundError:
        return False
    except (OSError, ValueError):
        return True
    return not isinstance(values, dict) or values.get("kept") is not False


def _iterate_uploads(settings: Settings) -> Iterator[Upload]:
    for record in settings.uploads.glob(f"*/{_RECORD}"):
        upload = read_upload(record.parent)
        if upload is not None:
            yield upload


def read_upload(folder: Path) -> Upload | None:
    """The upload of a folder; None where its record is missing or is none of ours."""
    try:
        values = json.loads((folder / _RECORD).read_bytes())
        upload = Upload(**{**values, "by": tuple(values.get("by", ()))})
        named = upload.id == folder.name and upload.name == make_safe_file_name(upload.name)
        sound = named and datetime.fromisoformat(upload.created).tzinfo is not None
        if sound and upload.size is not None:
            # A copy of a home that was being written to may have the record of more than it has.
            there = (folder / CONTENT / upload.name).stat().st_size
            upload = replace(upload, bytes=min(upload.bytes, there))
    except (OSError, ValueError, TypeError, AttributeError, InputError):
        return None
    return upload if sound else None


def make_safe_file_name(name: str) -> str:
    """A name that any disk takes, as near to the sent one as can be.

    Raises:
        InputError: Nothing is left of it.
    """
    last = re.split(r"[/\\]", name)[-1]
    clean = _UNSAFE.sub("_", last).strip(" .")
    suffix = Path(clean).suffix
    if len(suffix) > _MAX_SUFFIX:
        suffix = ""
    stem = clean.removesuffix(suffix)[: _MAX_NAME - len(suffix)]
    short = (stem + suffix).rstrip(" .")
    if not short.strip("_"):
        raise InputError("an upload needs the name of a file", pointer="/name")
    return short


class UploadDigest:
    """The id of an upload of some name, from its content chunk by chunk."""

    def __init__(self, name: str):
        self._digest = hashlib.sha256(name.encode() + b"\0")

    def update(self, chunk: bytes) -> None:
        """Add some bytes."""
        self._digest.update(chunk)

    @property
    def id(self) -> str:
        """The id for what was added until now."""
        return self._digest.hexdigest()[:32]


def upload_id(file: Path) -> str:
    """The id that a file gets where it is sent; a name that a server writes otherwise makes another."""
    digest = UploadDigest(file.name)
    with file.open("rb") as content:
        while chunk := content.read(_CHUNK):
            digest.update(chunk)
    return digest.id


class UploadWriter:
    """Takes an upload chunk by chunk; it is there when ``finish`` returns, or not at all.

    Args:
        settings: Where it will lie, and how large it may be.
        name: As it is sent.
        by: Who sends it.
        declared: How many bytes its sender says that it has; 0: nobody says.

    Raises:
        TooLargeError: Its sender may not have so much, here and while it is written.
        StorageError: The disk refuses, here and in each method.
    """

    def __init__(self, settings: Settings, name: str, *, by: str | None = None, declared: int = 0):
        self._settings, self._name, self._by = settings, make_safe_file_name(name), by
        self._folder = settings.uploads / f"{uuid.uuid4().hex}{PART}"
        self._digest = UploadDigest(self._name)
        self._quota = find_person_quota(settings) if by else None
        self._reserved = 0
        self.bytes = 0
        if self._quota is None:
            self._open_content()
        else:
            self._reserve_quota(declared, self._quota)

    def _reserve_quota(self, size: int, quota: int) -> None:
        """Reserve so many bytes of the sender's quota, or some more where nobody says how many come."""
        by = self._by or ""
        with lock_upload_records(self._settings):
            used = count_used_bytes(self._settings, by, but=self._folder)
            require_within_quota(self._settings, size, quota, used)
            more = 0 if size > self.bytes else _STEP
            self._reserved = min(size + more, quota - used)
            if not self._folder.exists():
                self._open_content()
            # Without an id it is none that is listed; ``finish`` writes the one that counts.
            draft = Upload("", self._name, self._reserved, now(), by=(by,))
            with _convert_storage_errors():
                write_upload_record(self._folder, draft)

    def _open_content(self) -> None:
        with _convert_storage_errors():
            settings = self._settings
            ensure_folder_of_all_uploads(settings.uploads)
            content = self._folder / CONTENT
            content.mkdir(mode=0o700, parents=True)
            self._folder.chmod(0o700)
            self._file = (content / self._name).open("xb")

    def write(self, chunk: bytes) -> None:
        """Add some bytes.

        Raises:
            TooLargeError: It is longer than the settings, or the quota of its sender, allow.
        """
        self.bytes += len(chunk)
        require_upload_size(self._settings, self.bytes)
        if self._quota is not None and self.bytes > self._reserved:
            self._reserve_quota(self.bytes, self._quota)
        self._digest.update(chunk)
        with _convert_storage_errors():
            self._file.write(chunk)

    def finish(self, guess: Callable[[Path], str | None] = lambda path: None) -> Upload:
        """Make it an upload.

        Args:
            guess: From the file to the format that it most likely has.

        Raises:
            InputError: Nothing was sent.
        """
        if not self.bytes:
            self.abort()
            raise InputError("the upload is empty", hint="Send the file as the request's body.")
        with _convert_storage_errors():
            self._file.flush()
            os.fsync(self._file.fileno())
            self._file.close()
        upload = Upload(self._digest.id, self._name, self.bytes, now())
        by = self._by
        shared = _add_sender(self._settings, upload.id, by)
        if shared is not None:
            self.abort()
            return shared
        upload = replace(upload, format=guess(Path(self._file.name)), by=(by,) if by else ())
        with _convert_storage_errors():
            sync_to_disk(self._folder / CONTENT)
            write_upload_record(self._folder, upload)
            return self._publish(upload)

    def _publish(self, upload: Upload) -> Upload:
        """Give the complete folder its name, or find that somebody sent the same meanwhile."""
        place = self._settings.uploads / upload.id
        for _ in range(2):
            try:
                self._folder.rename(place)
            except OSError as error:
                if error.errno not in (errno.EEXIST, errno.ENOTEMPTY):
                    raise
            else:
                sync_to_disk(place.parent)
                return upload
            shared = _add_sender(self._settings, upload.id, *upload.by)
            if shared is not None:
                self.abort()
                return shared
            # What lies there has no record, so nobody can have been told of it.
            _remove_folder(place)
        raise StorageError(
            "the server could not save the upload",
            hint="Wait, then send it again with the same Idempotency-Key.",
        )

    def abort(self) -> None:
        """Leave nothing behind."""
        with suppress(OSError):
            self._file.close()
        delete_path(self._folder)


def require_upload_size(settings: Settings, size: int) -> None:
    """Raise TooLargeError where an upload of that size is not allowed."""
    if size > settings.max_upload_bytes:
        raise TooLargeError(
            f"an upload may have at most {settings.max_upload_bytes:,} bytes",
            hint="Import larger data from a folder that the operator allows.",
        )


def _add_sender(settings: Settings, upload_id: str, by: str | None = None) -> Upload | None:
    """An upload that somebody has sent again, which is theirs as well; None where it is not there."""
    with lock_upload_records(settings):
        upload = read_upload(settings.uploads / upload_id)
        if upload is None or by is None or by in upload.by:
            return upload
        shared = replace(upload, by=(*upload.by, by))
        with _convert_storage_errors():
            write_upload_record(settings.uploads / upload_id, shared)
        return shared


def write_upload_record(folder: Path, upload: Upload) -> None:
    """Put the record of an upload in its place, and on the disk."""
    replace_file(folder / _RECORD, json_text(asdict(upload), ascii_=True).encode())


def _remove_folder(folder: Path) -> None:
    """Delete an upload: it is gone at once, and what is left of it is half-sent."""
    aside = folder.with_name(f"{uuid.uuid4().hex}{PART}")
    with suppress(FileNotFoundError):
        folder.rename(aside)
    delete_path(aside)


def is_full_disk(error: OSError) -> bool:
    """Whether an error says that a disk, or what one user may have of it, is full."""
    return error.errno in (errno.ENOSPC, errno.EDQUOT)


@contextmanager
def _convert_storage_errors() -> Iterator[None]:
    try:
        yield
    except OSError as error:
        full = is_full_disk(error)
        problem = "the disk is full" if full else f"the disk cannot be written ({error.strerror})"
        raise StorageError(
            f"{problem}: the upload was not kept", hint="Free some space and send it again."
        ) from error
