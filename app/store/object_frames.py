"""Frames in object stores: fetched once, checked, kept in a cache of bounded size.

A view says which content it means (``app.object_store.address.seal``): its entity tag, as the
import found it, or its SHA-256, as a list of frames said. Another content is never shown in its place. Members
of a zip are fetched by themselves.
"""

from __future__ import annotations

import contextlib
import hashlib
import os
from collections.abc import Iterator
from functools import lru_cache
from pathlib import Path

from app.config import Settings
from app.durable import replace_file
from app.object_store.address import is_address, split_address, unseal
from app.object_store.path import StoredPath
from app.object_store.store import ChangedObjectError, ObjectStore, open_store
from app.soccer.media import Media
from app.store.archives import Archives
from app.store.locks import lock_within

_ARCHIVES = Archives()
DIGEST = hashlib.sha256().digest_size
LOOKS = 50
"""After every fiftieth part of the room a process looks whether there is too much."""
KEPT = 0.8
"""Part of the room that is left full; the rest is for what is written between two looks."""
PATIENCE_S = 5.0
"""Who has written its part waits so long for another who makes room; one that was stopped holds nobody."""
CHANGED_HINT = "Import it again to take the new one, or put the old one back."


def is_stored(media: Media) -> bool:
    """Whether a frame lies in an object store."""
    return is_address(media.path)


def is_kept(media: Media, settings: Settings) -> bool:
    """Whether a frame of an object store is on this disk already."""
    return _cache(settings).has(_name(media))


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
    cache, name = _cache(settings), _name(media)
    data = cache.get(name)
    if data is None:
        data = _fetched(media, settings)
        cache.put(name, data)
    return data


def _fetched(media: Media, settings: Settings) -> bytes:
    address, kind, value = unseal(media.path)
    store_name, key = split_address(address)
    store = open_store(settings, store_name)
    etag = f'"{value}"' if kind == "etag" else ""
    try:
        data = _read(store, key, media.member, etag, settings)
    except ChangedObjectError:
        if etag:
            raise
        # The zip is another than that whose list is known here; its member may be the same.
        _zip.cache_clear()
        data = _read(store, key, media.member, etag, settings)
    if kind == "sha256" and hashlib.sha256(data).hexdigest() != value:
        raise ChangedObjectError(
            f"{_shown(address, media)} is not the frame that was meant: its SHA-256 is another",
            hint=CHANGED_HINT,
        )
    return data


def _read(store: ObjectStore, key: str, member: str | None, etag: str, settings: Settings) -> bytes:
    limit = settings.max_file_bytes
    if member is None:
        return store.read_whole(key, limit, etag)[0]
    path = _zip(store, key, etag)
    if etag and path.stored is not None and path.stored.etag != etag:
        raise ChangedObjectError(
            f"{path} was changed in its store since it was imported", hint=CHANGED_HINT
        )
    return _ARCHIVES.read(path, member, limit)


@lru_cache(maxsize=256)
def _zip(store: ObjectStore, key: str, _etag: str) -> StoredPath:
    """A zip in a store, as it was when it was first asked for here."""
    return StoredPath(store.name, store.settings, key, store.head(key))


def _shown(address: str, media: Media) -> str:
    return address if media.member is None else f"{address}/{media.member}"


def _name(media: Media) -> str:
    return repr((media.path, media.member))


def _cache(settings: Settings) -> ObjectCache:
    return _opened(settings.cache / "objects", settings.store_cache_bytes)


@lru_cache(maxsize=8)
def _opened(folder: Path, room: int) -> ObjectCache:
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
        place = self._place(name)
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
        return self._place(name).exists()

    def put(self, name: str, data: bytes) -> None:
        """Keep bytes under a name; a full disk costs the cache and nothing else."""
        if len(data) > self._room * (1 - KEPT):
            return
        place = self._place(name)
        with contextlib.suppress(OSError):
            place.parent.mkdir(mode=0o700, parents=True, exist_ok=True)
            replace_file(place, hashlib.sha256(data).digest() + data, durable=False)
        self._written += len(data)
        if self._written > self._room / LOOKS:
            self._written = 0
            with contextlib.suppress(OSError):
                self._make_room()

    def _make_room(self) -> None:
        """Delete what was not asked for longest; one process at a time."""
        with self._alone() as mine:
            if not mine:
                return
            found = sorted(self._files())
            total = sum(size for _, size, _ in found)
            for _, size, path in found:
                if total <= self._room * KEPT:
                    return
                path.unlink(missing_ok=True)
                total -= size

    def _files(self) -> Iterator[tuple[int, int, Path]]:
        for folder, _, names in os.walk(self._folder):
            for path in (Path(folder, name) for name in names):
                with contextlib.suppress(OSError):
                    status = path.stat()
                    yield status.st_mtime_ns, status.st_size, path

    @contextlib.contextmanager
    def _alone(self) -> Iterator[bool]:
        """Whether no other makes room any more: what was written meanwhile counts, too."""
        handle = os.open(self._folder, os.O_RDONLY | os.O_CLOEXEC)
        try:
            yield lock_within(handle, PATIENCE_S)
        finally:
            os.close(handle)

    def _place(self, name: str) -> Path:
        digest = hashlib.sha256(name.encode()).hexdigest()
        return self._folder / digest[:2] / digest[2:34]
