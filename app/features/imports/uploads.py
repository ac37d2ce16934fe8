"""Uploads: files that people send, whole or in parts, and folders that the operator allows imports to read.

An upload in parts is named by what its sender says of the file, not by its content, so that the same file
is found again before a byte of it has come. Its record says how many bytes are on disk; what lies
behind them in the file was never acknowledged, and is written over.
"""

from __future__ import annotations

import hashlib
import os
import shutil
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass, replace
from itertools import islice
from pathlib import Path

from app.config import Settings
from app.db.idempotency import has_idempotency_key, read_progress, save_progress
from app.db.json_columns import Json
from app.db.session import now
from app.db.store import Store
from app.durable import sync_to_disk
from app.errors import ConflictError, InputError, NotFoundError, StorageError, UnsafePathError
from app.features.imports.upload_queries import (
    CONTENT,
    content_path,
    delete_upload,
    ensure_folder_of_all_uploads,
    get_upload,
    is_full_disk,
    list_uploads,
    lock_upload_records,
    make_safe_file_name,
    read_upload,
    require_unused_by_datasets,
    require_upload_size,
    write_upload_record,
)
from app.features.imports.upload_queries import Upload as Upload
from app.features.imports.upload_queries import UploadWriter as UploadWriter
from app.features.imports.upload_quota import count_used_bytes as used_bytes
from app.features.imports.upload_quota import find_person_quota, require_within_quota
from app.features.people.visibility_queries import Visibility
from app.formats.file_tree import Root
from app.formats.guess_format import guess_format, guess_format_from_names
from app.formats.safe_path import MAX_PART, require_safe_path, resolve_inside
from app.json_text import canonical_json_text
from app.object_store.path import StoredPath, find_path, is_address
from app.object_store.store import SCHEME

MAX_ITEMS = 1000
"""Entries of a folder that are listed."""


@dataclass(frozen=True)
class FolderItem:
    """A folder or file that an import could read; ``path`` starts with an allowed folder's name."""

    path: str
    name: str
    folder: bool


@dataclass(frozen=True)
class FolderListing:
    """What is in a folder.

    Attributes:
        path: Empty for the list of allowed folders.
        format: What it most likely holds, or None.
        more: Whether there is more than is listed.
    """

    path: str
    format: str | None
    items: tuple[FolderItem, ...]
    more: bool


def map_import_folders_by_name(settings: Settings) -> dict[str, Path]:
    """The operator's folders by the names that requests use for them."""
    found: dict[str, Path] = {}
    for folder in settings.import_folders:
        name = folder.name or "root"
        number = 2
        while name in found:
            name, number = f"{folder.name}-{number}", number + 1
        found[name] = folder
    return found


def resolve_folder(settings: Settings, path: str) -> Root:
    """The folder or file that a request means by ``<allowed folder>/<inside>`` or an address.

    Raises:
        UnsafePathError: The path would leave the allowed folder.
        NotFoundError: Nothing is there.
        InputError: The operator allows no folders.
    """
    if is_address(path):
        return _resolve_address(settings, path)
    folders = map_import_folders_by_name(settings)
    if not folders:
        raise InputError(
            "the operator has allowed no folder for imports",
            hint="Upload the data, or ask the operator to set TOUCHLINE_IMPORT_FOLDERS.",
        )
    if any(len(part.encode(errors="replace")) > MAX_PART for part in path.split("/")):
        raise NotFoundError("the folder name is too long")
    names = ", ".join(sorted(folders))
    try:
        root, _, inside = require_safe_path(path.rstrip("/")).partition("/")
    except UnsafePathError as error:
        hint = f"Write FOLDER/FILE, where FOLDER is one of: {names}."
        raise UnsafePathError(error.message, hint=hint) from error
    if root not in folders:
        raise NotFoundError(
            f'there is no folder "{root}" to import from', hint=f"There are: {names}."
        )
    found = resolve_inside(folders[root], inside) if inside else folders[root]
    if not os.path.exists(found):  # noqa: PTH110 - a path that is too long is not there either
        raise NotFoundError(f'there is no file or folder "{path}" in the folders for imports')
    return found


def _resolve_address(settings: Settings, address: str) -> StoredPath:
    require_safe_path(address.removeprefix(SCHEME).strip("/"))
    return find_path(settings, address)


def list_folder(settings: Settings, path: str = "") -> FolderListing:
    """The allowed folders and stores, or what is in one of them."""
    if not path:
        roots = [
            FolderItem(name, name, True) for name in sorted(map_import_folders_by_name(settings))
        ]
        stores = (f"{SCHEME}{name}" for name in sorted(settings.stores))
        roots += [FolderItem(address, address, True) for address in stores]
        return FolderListing("", None, tuple(roots), False)
    found = resolve_folder(settings, path)
    if isinstance(found, StoredPath):
        return _list_store_folder(found)
    if not found.is_dir():
        return FolderListing(path, guess_format(found), (), False)
    items = list(islice(_iterate_folder_items(found, path.rstrip("/")), MAX_ITEMS + 1))
    items.sort(key=lambda item: (not item.folder, item.name))
    more = len(items) > MAX_ITEMS
    return FolderListing(path, guess_format(found), tuple(items[:MAX_ITEMS]), more)


def _list_store_folder(found: StoredPath) -> FolderListing:
    """What is in a folder of a store; one request, so that the format is guessed of this level."""
    if not found.is_dir():
        return FolderListing(str(found), guess_format_from_names([found.name]), (), False)
    folders, objects = found.store.list_folder(found.key)
    at = str(found).rstrip("/")
    items = [FolderItem(f"{at}/{name}", name, True) for name in folders]
    names = [stored.key.rpartition("/")[2] for stored in objects]
    items += [FolderItem(f"{at}/{name}", name, False) for name in names]
    items = [item for item in items if not item.name.startswith(".") and _is_valid_name(item.name)]
    items.sort(key=lambda item: (not item.folder, item.name))
    shown, more = tuple(items[:MAX_ITEMS]), len(items) > MAX_ITEMS
    return FolderListing(at, guess_format_from_names(names), shown, more)


def _iterate_folder_items(folder: Path, path: str) -> Iterator[FolderItem]:
    with os.scandir(folder) as entries:
        for entry in entries:
            hidden = entry.name.startswith(".")
            # A link may lead out; what it leads to is reached by its own name, if it may be.
            if hidden or entry.is_symlink() or not _is_valid_name(entry.name):
                continue
            if entry.is_dir() or entry.is_file():
                yield FolderItem(f"{path}/{entry.name}", entry.name, entry.is_dir())


def _is_valid_name(name: str) -> bool:
    try:
        return bool(require_safe_path(name))
    except InputError:
        return False


def begin_upload(settings: Settings, name: str, declared: int, actor: str) -> UploadWriter:
    """Begin to take a file of which its sender says how many bytes it has; 0: it says nothing.

    Raises:
        TooLargeError: It is longer than the settings, or the quota of its sender, allow.
        InputError: The name is none that a file can have.
        StorageError: The disk refuses.
    """
    require_upload_size(settings, declared)
    return UploadWriter(settings, name, by=actor, declared=declared)


def finish_upload(writer: UploadWriter) -> Upload:
    """Make what was taken an upload of its sender's, and see what it most likely holds.

    Raises:
        InputError: Nothing was sent.
        StorageError: The disk refuses.
    """
    return writer.finish(guess_format)


def begin_part(settings: Settings, upload_id: str, offset: int, declared: int) -> PartWriter:
    """Begin to take a part of an upload, of which its sender says how many bytes it has.

    Raises:
        TooLargeError: It is longer than the settings allow.
        NotFoundError: There is no such upload.
        ConflictError: Bytes before it are missing.
    """
    require_upload_size(settings, declared)
    return PartWriter(settings, upload_id, offset, guess_format)


def find_upload(settings: Settings, upload_id: str) -> Upload:
    """An upload by its id.

    Raises:
        NotFoundError: There is none of that id, or it has expired.
    """
    return get_upload(settings, upload_id)


def list_own_uploads(settings: Settings, visibility: Visibility) -> list[Upload]:
    """The uploads that somebody sent, the newest first; of an admin everybody's."""
    return [
        item
        for item in list_uploads(settings)
        if visibility.sees(None) or any(visibility.sees(None, name) for name in item.by)
    ]


def delete_own_upload(store: Store, upload_id: str, mine: Callable[[str], bool]) -> None:
    """``delete_upload`` for a request, and as it does.

    What goes is a file, which no transaction holds. Under a key, that it is to go is written down
    before, and the response stored afterwards: sent again, a request that was stopped in between
    does the rest.
    """
    if not has_idempotency_key():
        delete_upload(store.settings, upload_id, mine)
        return
    begun = _read_interrupted_deletion(store) or _begin_deletion(store, upload_id)
    with suppress(NotFoundError):
        # One that was sent once more meanwhile is another.
        if get_upload(store.settings, begun["upload"]).created == begun["created"]:
            delete_upload(store.settings, begun["upload"], mine)
    with store.write() as session:
        session.respond(None)


def _read_interrupted_deletion(store: Store) -> Json | None:
    """Which upload the same request was deleting when it was stopped; None: it was not."""
    with store.read() as session:
        return read_progress(session)


def _begin_deletion(store: Store, upload_id: str) -> Json:
    upload = get_upload(store.settings, upload_id)
    require_unused_by_datasets(upload)
    begun = {"upload": upload.id, "created": upload.created}
    with store.write() as session:
        save_progress(session, begun)
    return begun


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
    require_upload_size(settings, size)
    name = make_safe_file_name(name)
    if not size:
        raise InputError(f"{name} is empty")
    said = canonical_json_text([by, name, size, mark]).encode()
    folder = settings.uploads / hashlib.sha256(said).hexdigest()[:32]
    with lock_upload_records(settings):
        upload = read_upload(folder)
        begun = Upload(folder.name, name, 0, now(), by=(by,), size=size)
        if upload is None and (quota := find_person_quota(settings)) is not None:
            require_within_quota(settings, size, quota, used_bytes(settings, by, but=folder))
        with _convert_storage_errors(upload or begun):
            if upload is None or upload.bytes < size:
                _require_disk_space(settings, upload or begun)
            if upload is None:
                _begin_upload_on_disk(folder, begun)
    return upload or begun


def _begin_upload_on_disk(folder: Path, upload: Upload) -> None:
    ensure_folder_of_all_uploads(folder.parent)
    (folder / CONTENT).mkdir(mode=0o700, parents=True, exist_ok=True)
    folder.chmod(0o700)
    (folder / CONTENT / upload.name).write_bytes(b"")
    sync_to_disk(folder / CONTENT)
    write_upload_record(folder, upload)
    sync_to_disk(folder.parent)


def _require_disk_space(settings: Settings, upload: Upload) -> None:
    ensure_folder_of_all_uploads(settings.uploads)
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
        self._require_matching_offset(get_upload(settings, upload_id))

    def write(self, chunk: bytes) -> None:
        """Put some bytes on the disk.

        Raises:
            InputError: The file gets longer than its sender said.
            NotFoundError, ConflictError: The upload was deleted or shortened meanwhile.
            StorageError: The disk refuses; what was acknowledged stays.
        """
        with lock_upload_records(self._settings):
            upload = get_upload(self._settings, self._id)
            self._require_matching_offset(upload)
            fresh = chunk[upload.bytes - self._next :]
            grown = replace(upload, bytes=upload.bytes + len(fresh))
            if grown.bytes > upload.whole_size:
                raise InputError(
                    f"{upload.name} is longer than the {upload.whole_size:,} bytes that were declared"
                    " when its upload began",
                    hint="Start a new upload for the changed file.",
                )
            if fresh:
                path = content_path(self._settings, upload)
                with _convert_storage_errors(upload):
                    _append_chunk(path, upload.bytes, fresh)
                    if grown.bytes == upload.whole_size:
                        grown = replace(grown, format=self._guess(path))
                    write_upload_record(path.parent.parent, grown)
        self._next += len(chunk)

    def finish(self) -> Upload:
        """The upload as far as it is."""
        return get_upload(self._settings, self._id)

    def abort(self) -> None:
        """What was written stays."""

    def _require_matching_offset(self, upload: Upload) -> None:
        if self._next > upload.bytes:
            raise ConflictError(
                f"this part of {upload.name} begins at byte {self._next:,}, and only {upload.bytes:,} bytes were received before it",
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
def _convert_storage_errors(upload: Upload) -> Iterator[None]:
    try:
        yield
    except OSError as error:
        why = "is full" if is_full_disk(error) else f"refuses ({error.strerror})"
        raise StorageError(
            f"the disk of the server {why}: {upload.bytes:,} of {upload.whole_size:,} bytes of"
            f" {upload.name} were received",
            hint="Free some space and send the file again: the upload continues where it stopped.",
        ) from error
