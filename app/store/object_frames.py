"""Frames in object stores: fetched once, checked, kept in a cache of bounded size.

A view says which content it means (``app.object_store.address.seal``): its entity tag, as the
import found it, or its SHA-256, as a list of frames said. Another content is never shown in its place. Members
of a zip are fetched by themselves.
"""

from __future__ import annotations

import hashlib
from functools import lru_cache
from pathlib import Path

from app.config import Settings
from app.object_store.address import is_address, split_address, unseal
from app.object_store.path import StoredPath
from app.object_store.refusal import ChangedObjectError
from app.object_store.store import ObjectStore, open_store
from app.soccer.media import Media
from app.store.archives import Archives
from app.store.object_cache import ObjectCache

_ARCHIVES = Archives()
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
