"""Uploads in parts: whoever loses the connection, the page or the server goes on where the server is.

Such an upload is named by what its sender says of the file, not by its content, so that the same file
is found again before a byte of it has come. Its record says how many bytes are on disk; what lies
behind them in the file was never acknowledged, and is written over.
"""

from __future__ import annotations

import hashlib
import os
import shutil
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from dataclasses import replace
from pathlib import Path

from app.canonical import canonical
from app.config import Settings
from app.db.session import now
from app.durable import sync
from app.errors import ConflictError, InputError, StorageError
from app.features.imports.upload_queries import (
    CONTENT,
    Upload,
    content_path,
    get_upload,
    is_full_disk,
    lock_upload_records,
    make_folder,
    read_upload,
    require_size,
    safe_name,
    write_record,
)
from app.features.imports.upload_quota import person_quota, require_quota, used_bytes

Guess = Callable[[Path], str | None]


def begin_upload_in_parts(
    settings: Settings, name: str, size: int, mark: str, *, by: str
) -> Upload:
    """An upload that comes in parts: as far as it came where the same was begun before, else of no bytes.

    Args:
        settings: Where it will lie, and how large it may be.
        name: As it is sent.
        size: How many bytes the file has.
        mark: What tells it from another of its name and size: when it was changed, or its digest.
        by: Who sends it.

    Raises:
        InputError: The name is none that a file can have, or the file is empty.
        TooLargeError: It is larger than the settings, or the quota of its sender, allow.
        StorageError: The disk has no room for it.
    """
    require_size(settings, size)
    name = safe_name(name)
    if not size:
        raise InputError(f"{name} is empty")
    said = canonical([by, name, size, mark]).encode()
    folder = settings.uploads / hashlib.sha256(said).hexdigest()[:32]
    with lock_upload_records(settings):
        upload = read_upload(folder)
        begun = Upload(folder.name, name, 0, now(), by=(by,), size=size)
        if upload is None and (quota := person_quota(settings)) is not None:
            require_quota(settings, size, quota, used_bytes(settings, by, but=folder))
        with _storage_errors(upload or begun):
            if upload is None or upload.bytes < size:
                _require_disk(settings, upload or begun)
            if upload is None:
                _make_upload_folder(folder, begun)
    return upload or begun


def _make_upload_folder(folder: Path, upload: Upload) -> None:
    make_folder(folder.parent)
    (folder / CONTENT).mkdir(mode=0o700, parents=True, exist_ok=True)
    folder.chmod(0o700)
    (folder / CONTENT / upload.name).write_bytes(b"")
    sync(folder / CONTENT)
    write_record(folder, upload)
    sync(folder.parent)


def _require_disk(settings: Settings, upload: Upload) -> None:
    make_folder(settings.uploads)
    missing, free = upload.whole_size - upload.bytes, shutil.disk_usage(settings.uploads).free
    if missing > free:
        raise StorageError(
            f"{upload.name} needs {missing:,} bytes more, and the disk of the server has {free:,}",
            hint="Free some space and send the file again: the upload continues where it stopped.",
        )


class PartWriter:
    """Adds bytes to an upload in parts; what is written is acknowledged.

    Args:
        settings: Where it lies.
        upload_id: Which.
        offset: Place of the next byte. Bytes that are here already are passed over, so that a part may
            be sent twice.
        guess: From the whole file to the format that it most likely has.

    Raises:
        NotFoundError: There is no such upload.
        ConflictError: Bytes before the offset are missing.
    """

    def __init__(
        self, settings: Settings, upload_id: str, offset: int, guess: Guess = lambda path: None
    ):
        self._settings, self._id, self._next, self._guess = settings, upload_id, offset, guess
        self._require_next_byte(get_upload(settings, upload_id))

    def write(self, chunk: bytes) -> None:
        """Put some bytes on the disk.

        Raises:
            InputError: The file gets longer than its sender said.
            NotFoundError, ConflictError: The upload was deleted or shortened meanwhile.
            StorageError: The disk refuses; what was acknowledged stays.
        """
        with lock_upload_records(self._settings):
            upload = get_upload(self._settings, self._id)
            self._require_next_byte(upload)
            fresh = chunk[upload.bytes - self._next :]
            grown = replace(upload, bytes=upload.bytes + len(fresh))
            if grown.bytes > upload.whole_size:
                raise InputError(
                    f"{upload.name} is longer than the {upload.whole_size:,} bytes that it was said "
                    "to have",
                    hint="Start a new upload for the changed file.",
                )
            if fresh:
                path = content_path(self._settings, upload)
                with _storage_errors(upload):
                    _append_chunk(path, upload.bytes, fresh)
                    if grown.bytes == upload.whole_size:
                        grown = replace(grown, format=self._guess(path))
                    write_record(path.parent.parent, grown)
        self._next += len(chunk)

    def finish(self) -> Upload:
        """The upload as far as it is."""
        return get_upload(self._settings, self._id)

    def abort(self) -> None:
        """What was written stays."""

    def _require_next_byte(self, upload: Upload) -> None:
        if self._next > upload.bytes:
            raise ConflictError(
                f"{upload.bytes:,} bytes of {upload.name} were received, and these begin at {self._next:,}",
                hint="Request the number of received bytes (GET /api/v1/uploads/ID), and continue there.",
            )


def _append_chunk(path: Path, offset: int, chunk: bytes) -> None:
    with path.open("r+b") as file:
        try:
            file.seek(offset)
            file.write(chunk)
            file.truncate()
            file.flush()
            os.fsync(file.fileno())
        except OSError:
            # What a full disk took of it leaves room for others again.
            with suppress(OSError):
                os.truncate(path, offset)
            raise


@contextmanager
def _storage_errors(upload: Upload) -> Iterator[None]:
    try:
        yield
    except OSError as error:
        why = "is full" if is_full_disk(error) else f"refuses ({error.strerror})"
        raise StorageError(
            f"the disk of the server {why}: {upload.bytes:,} of {upload.whole_size:,} bytes of "
            f"{upload.name} are there",
            hint="Free some space and send the file again: the upload continues where it stopped.",
        ) from error
