"""Frames in object stores: fetched once, checked, kept in a cache.

A few zip archives are kept open, because opening one reads its whole directory.
"""

from __future__ import annotations

import contextlib
import hashlib
import os
import threading
import zipfile
import zlib
from collections import OrderedDict
from collections.abc import Callable, Iterator
from functools import lru_cache
from pathlib import Path

from app.config import Settings
from app.db.locks import try_to_lock
from app.durable import replace_file
from app.errors import ImageError, NotFoundError, StorageError, TooLargeError
from app.object_store.path import StoredPath, is_address, split_address, split_pinned_address
from app.object_store.store import ChangedObjectError, ObjectStore, open_store
from app.soccer.group import Media
from app.zip_file import open_nested, open_zip, split_nested_name

MAX_OPEN = 16

_Place = Path | StoredPath
_Key = tuple[str, int, int, str]
"""Path, time of change and size: a file that was replaced is another archive. The name of the zip
inside it last, or empty."""


class ArchiveMemberReader:
    """Members of zip archives by path; safe to use from many threads.

    A member may lie in a zip that is itself a member: ``<match>/Frames-v3.zip/7.png``.
    """

    def __init__(self, most: int = MAX_OPEN):
        self._most = most
        self._open: OrderedDict[_Key, zipfile.ZipFile] = OrderedDict()
        self._lock = threading.Lock()

    def read(self, path: _Place, member: str, limit: int) -> bytes:
        """The content of a member.

        Raises:
            NotFoundError: There is no such file or member.
            TooLargeError: The member is larger than ``limit`` bytes, whatever it declares.
            ImageError: The archive or the member is damaged.
        """
        data = self.read_first_bytes(path, member, limit + 1)
        if len(data) > limit:
            raise TooLargeError(f"{path.name}/{member} is larger than {limit} bytes")
        return data

    def read_first_bytes(self, path: _Place, member: str, count: int) -> bytes:
        """The first bytes of a member, so many at most; raises NotFoundError and ImageError."""
        archive, name = self._find_member(path, member)
        try:
            # ZipFile locks its own file.
            with archive.open(name) as file:
                return file.read(count)
        except KeyError as error:
            raise NotFoundError(f"{path.name} has no member {member}") from error
        except (zipfile.BadZipFile, EOFError, OSError, ValueError, RuntimeError) as error:
            raise ImageError(f"{path.name}/{member} cannot be read: {error}") from error
        except NotImplementedError as error:
            raise ImageError(f"{path.name}/{member} is compressed in an unknown way") from error

    def read_size_and_crc(self, path: Path, member: str) -> tuple[int, int]:
        """Size and CRC-32 of a member, as the archive's directory says."""
        archive, name = self._find_member(path, member)
        try:
            info = archive.getinfo(name)
        except KeyError as error:
            raise NotFoundError(f"{path.name} has no member {member}") from error
        return info.file_size, info.CRC

    def has(self, path: Path, member: str) -> bool:
        """Whether the archive's directory lists a member of that name."""
        archive, name = self._find_member(path, member)
        return name in archive.NameToInfo

    def close(self) -> None:
        """Close all archives."""
        with self._lock:
            while self._open:
                self._open.popitem()[1].close()

    def _find_member(self, path: _Place, member: str) -> tuple[zipfile.ZipFile, str]:
        """The open archive that a member lies in, and its name there."""
        key = _archive_key(path)
        archive = self._get_archive(key, lambda: _open_archive(path))
        if member in archive.NameToInfo or (nested := split_nested_name(archive, member)) is None:
            return archive, member
        outer, inner = nested
        info = archive.getinfo(outer)
        return self._get_archive((*key[:3], outer), lambda: _open_nested_archive(path, info)), inner

    def _get_archive(self, key: _Key, open_it: Callable[[], zipfile.ZipFile]) -> zipfile.ZipFile:
        with self._lock:
            if key not in self._open:
                self._open[key] = open_it()
            self._open.move_to_end(key)
            while len(self._open) > self._most:
                # Not closed here: another thread may have found it, and not opened its member yet.
                # It closes with whoever holds it last.
                self._open.popitem(last=False)
            return self._open[key]


def _open_archive(path: _Place) -> zipfile.ZipFile:
    try:
        return open_zip(path)
    except (zipfile.BadZipFile, NotImplementedError, ValueError) as error:
        raise ImageError(f"{path.name} is not a complete zip archive") from error
    except OSError as error:
        raise StorageError(f"{path.name} cannot be read") from error


def _open_nested_archive(path: _Place, info: zipfile.ZipInfo) -> zipfile.ZipFile:
    shown = f"{path.name}/{info.filename}"
    try:
        # Opened anew: one that is kept open may be closed for others' sake meanwhile.
        with _open_archive(path) as archive:
            return open_nested(archive, path, info)
    except OSError as error:
        raise StorageError(f"{shown} cannot be read") from error
    except (zipfile.BadZipFile, zlib.error, EOFError, ValueError, RuntimeError) as error:
        raise ImageError(f"{shown} cannot be read: {error}") from error


def _archive_key(path: _Place) -> _Key:
    if isinstance(path, StoredPath):
        return path.make_pinned_address(), 0, path.size, ""
    try:
        status = path.stat()
    except OSError as error:
        raise NotFoundError(
            f"the file {path.name} is no longer in the place that it was imported from"
        ) from error
    return str(path), status.st_mtime_ns, status.st_size, ""


_ARCHIVES = ArchiveMemberReader()
DIGEST = hashlib.sha256().digest_size
LOOKS = 50
"""After every fiftieth part of the room a process looks whether there is too much."""
KEPT = 0.8
"""Part of the room that is left full; the rest is for what is written between two looks."""
PATIENCE_S = 5.0
"""Who has written its part waits so long for another who makes room; one that was stopped holds nobody."""
CHANGED_HINT = "Import it again to take the new one, or put the old one back."


def is_in_object_store(media: Media) -> bool:
    """Whether a frame lies in an object store."""
    return is_address(media.path)


def is_cached(media: Media, settings: Settings) -> bool:
    """Whether a frame of an object store is on this disk already."""
    return _get_cache(settings).has(_cache_name(media))


def fetch_frame(media: Media, settings: Settings) -> bool:
    """See to it that a frame of an object store is on this disk; true when it is.

    Raises:
        NotFoundError: It is gone, was changed, or no store of that name is configured.
        TooLargeError: It is larger than the limits allow.
        ImageError: Its archive is damaged.
        StorageError: The store cannot be asked.
    """
    read_object(media, settings)
    return True


def read_object(media: Media, settings: Settings) -> bytes:
    """The bytes of a frame of an object store, from this disk where they are kept.

    Raises:
        As ``fetch_frame``.
    """
    cache, name = _get_cache(settings), _cache_name(media)
    data = cache.get(name)
    if data is None:
        data = _fetch_object(media, settings)
        cache.put(name, data)
    return data


def _fetch_object(media: Media, settings: Settings) -> bytes:
    address, kind, value = split_pinned_address(media.path)
    store_name, key = split_address(address)
    store = open_store(settings, store_name)
    etag = f'"{value}"' if kind == "etag" else ""
    try:
        data = _read_object_or_member(store, key, media.member, etag, settings)
    except ChangedObjectError:
        if etag and media.member is None:
            raise
        # The zip is another than that whose list is known here: its member may be the same, or the
        # zip of then may be back.
        _make_stored_zip_path.cache_clear()
        data = _read_object_or_member(store, key, media.member, etag, settings)
    if kind == "sha256" and hashlib.sha256(data).hexdigest() != value:
        raise ChangedObjectError(
            f"{_describe_address(address, media)} has changed: its SHA-256 differs from that of"
            " the imported frame",
            hint=CHANGED_HINT,
        )
    return data


def _read_object_or_member(
    store: ObjectStore, key: str, member: str | None, etag: str, settings: Settings
) -> bytes:
    limit = settings.max_file_bytes
    if member is None:
        return store.read_whole(key, limit, etag)[0]
    path = _make_stored_zip_path(store, key, etag)
    if etag and path.stored is not None and path.stored.etag != etag:
        raise ChangedObjectError(
            f"{path} was changed in its store since it was imported", hint=CHANGED_HINT
        )
    return _ARCHIVES.read(path, member, limit)


@lru_cache(maxsize=256)
def _make_stored_zip_path(store: ObjectStore, key: str, _etag: str) -> StoredPath:
    """A zip in a store, as it was when it was first asked for here."""
    return StoredPath(store.name, store.settings, key, store.head(key))


def _describe_address(address: str, media: Media) -> str:
    return address if media.member is None else f"{address}/{media.member}"


def _cache_name(media: Media) -> str:
    return repr((media.path, media.member))


def _get_cache(settings: Settings) -> ObjectCache:
    return _open_cache(settings.cache / "objects", settings.store_cache_bytes)


@lru_cache(maxsize=8)
def _open_cache(folder: Path, room: int) -> ObjectCache:
    return ObjectCache(folder, room)


class ObjectCache:
    """Bytes by name, kept on this disk up to a size; can be deleted at any time.

    Several processes share it. A file is written under another name and renamed, and begins with the
    digest of what follows: one that is cut off or damaged is deleted and never returned.

    Args:
        folder: Where they are.
        room: Most bytes that they take together.
    """

    def __init__(self, folder: Path, room: int):
        self._folder, self._room = folder, room
        self._written = room
        """Bytes written since the last look; the first one to write looks at once."""

    def get(self, name: str) -> bytes | None:
        """What is kept under a name, whole, or None; it is the newest then."""
        place = self._file_path(name)
        try:
            content = place.read_bytes()
        except OSError:
            return None
        data = content[DIGEST:]
        if hashlib.sha256(data).digest() != content[:DIGEST]:
            place.unlink(missing_ok=True)
            return None
        with contextlib.suppress(OSError):
            os.utime(place)
        return data

    def has(self, name: str) -> bool:
        """Whether something is kept under a name; ``get`` may find that it is damaged."""
        return self._file_path(name).exists()

    def put(self, name: str, data: bytes) -> None:
        """Keep bytes under a name; a full disk costs the cache and nothing else."""
        if len(data) > self._room * (1 - KEPT):
            return
        place = self._file_path(name)
        with contextlib.suppress(OSError):
            place.parent.mkdir(mode=0o700, parents=True, exist_ok=True)
            replace_file(place, hashlib.sha256(data).digest() + data, durable=False)
        self._written += len(data)
        if self._written > self._room / LOOKS:
            self._written = 0
            with contextlib.suppress(OSError):
                self._evict_oldest()

    def _evict_oldest(self) -> None:
        """Delete what was not asked for longest; one process at a time."""
        with self._try_exclusive_lock() as mine:
            if not mine:
                return
            found = sorted(self._list_files())
            total = sum(size for _, size, _ in found)
            for _, size, path in found:
                if total <= self._room * KEPT:
                    return
                path.unlink(missing_ok=True)
                total -= size

    def _list_files(self) -> Iterator[tuple[int, int, Path]]:
        for folder, _, names in os.walk(self._folder):
            for path in (Path(folder, name) for name in names):
                with contextlib.suppress(OSError):
                    status = path.stat()
                    yield status.st_mtime_ns, status.st_size, path

    @contextlib.contextmanager
    def _try_exclusive_lock(self) -> Iterator[bool]:
        """Whether no other makes room any more: what was written meanwhile counts, too."""
        handle = os.open(self._folder, os.O_RDONLY | os.O_CLOEXEC)
        try:
            yield try_to_lock(handle, PATIENCE_S)
        finally:
            os.close(handle)

    def _file_path(self, name: str) -> Path:
        digest = hashlib.sha256(name.encode()).hexdigest()
        return self._folder / digest[:2] / digest[2:34]
