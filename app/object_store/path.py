"""Addresses in object stores, as text and as paths that read like those of a disk.

An address is ``s3://NAME/inside``: the name is that of a configured store, not of a bucket, so
that no request and no file can name another bucket, prefix or endpoint.
"""

from __future__ import annotations

import re
from contextlib import suppress
from dataclasses import dataclass
from pathlib import PurePosixPath
from typing import TYPE_CHECKING

from app.errors import InputError, NotFoundError
from app.object_store.store import (
    SCHEME,
    ObjectStore,
    StoredObject,
    open_configured_store,
    open_store,
)

if TYPE_CHECKING:
    from app.config import ObjectStoreSettings, Settings

_SEAL = re.compile(r"(.+)#(etag|sha256)=([^#]+)", re.DOTALL)


def is_address(text: str) -> bool:
    """Whether a text names something in an object store."""
    return text.startswith(SCHEME)


def split_address(address: str) -> tuple[str, str]:
    """Name of the store, and the key inside it without slashes at its ends.

    Raises:
        InputError: It is no address, or leads out of the store.
    """
    name, _, inside = address.removeprefix(SCHEME).partition("/")
    parts = inside.strip("/").split("/") if inside.strip("/") else []
    wrong = any(part in ("", ".", "..") or "\\" in part for part in parts)
    if not is_address(address) or wrong or not inside.isprintable() or len(inside) > 1000:
        raise InputError(
            "an address in a store is s3://NAME/folder/file: at most 1,000 printable characters, no backslash, and no part that is empty, '.' or '..'"
        )
    return name, "/".join(parts)


def pin_address_to_content(address: str, etag: str) -> str:
    """An address with what the content is called that is meant."""
    return f"{address}#etag={etag.strip(chr(34))}"


def split_pinned_address(sealed: str) -> tuple[str, str, str]:
    """Address, and how its content is known: ``etag`` or ``sha256`` and its value, or empty."""
    found = _SEAL.fullmatch(sealed)
    return (found[1], found[2], found[3]) if found else (sealed, "", "")


AHEAD = 128 * 1024
"""Bytes that a range read takes at least: a member of a zip and its header come in one or two."""


@dataclass(frozen=True)
class StoredPath:
    """A folder or an object of a store.

    It travels between processes: the store is opened where it is used, with the keys of then.

    Attributes:
        store_name: The store.
        settings: What the operator says of it.
        key: Inside the store; empty: all of it.
        stored: The object as it was when it was looked up; None of a folder.
    """

    store_name: str
    settings: ObjectStoreSettings
    key: str
    stored: StoredObject | None = None

    @property
    def store(self) -> ObjectStore:
        """Where it lies."""
        return open_configured_store(self.store_name, self.settings)

    @property
    def name(self) -> str:
        """The last part of its key, or the store's name."""
        return self.key.rpartition("/")[2] or self.store_name

    @property
    def suffix(self) -> str:
        """Ending of its name."""
        return PurePosixPath(self.name).suffix

    @property
    def stem(self) -> str:
        """Its name without the ending."""
        return PurePosixPath(self.name).stem

    @property
    def parts(self) -> tuple[str, ...]:
        """Store and folders, as those of an absolute path: the first one is no name."""
        return (SCHEME, self.store_name, *PurePosixPath(self.key).parts)

    @property
    def parent(self) -> StoredPath:
        """The folder that it lies in."""
        return StoredPath(self.store_name, self.settings, self.key.rpartition("/")[0])

    @property
    def size(self) -> int:
        """Bytes of the object."""
        assert self.stored is not None
        return self.stored.size

    def is_dir(self) -> bool:
        """Whether it is a folder."""
        return self.stored is None

    def resolve(self) -> StoredPath:
        """Itself: there are no links."""
        return self

    def make_object_path(self, stored: StoredObject) -> StoredPath:
        """An object of the same store."""
        return StoredPath(self.store_name, self.settings, stored.key, stored)

    def reads(self, ahead: int = AHEAD) -> RangeReader:
        """Begin to read the object in ranges."""
        return RangeReader(self, ahead)

    def make_pinned_address(self) -> str:
        """Address of the object with what its content is called: another content is not it."""
        assert self.stored is not None
        return pin_address_to_content(str(self), self.stored.etag)

    def __truediv__(self, inside: str) -> StoredPath:
        key = "/".join(filter(None, (self.key, inside.strip("/"))))
        return StoredPath(self.store_name, self.settings, key)

    def __str__(self) -> str:
        return f"{SCHEME}{self.store_name}/{self.key}"


def find_path(settings: Settings, address: str) -> StoredPath:
    """What lies under an address: an object, else a folder.

    Raises:
        InputError: It is no address.
        NotFoundError: There is no such store, or nothing there.
        StorageError: The store cannot be asked.
    """
    name, key = split_address(address)
    store = open_store(settings, name)
    path = StoredPath(name, store.settings, key)
    if key:
        with suppress(NotFoundError):
            return path.make_object_path(store.head(key))
    if next(store.iterate_objects_below(key), None) is None:
        raise NotFoundError(f"there is nothing at {path}")
    return path


def resolve_target_path(settings: Settings, address: str) -> StoredPath:
    """Where an address is, whatever lies there.

    Raises:
        InputError: It is no address.
        NotFoundError: There is no such store.
        StorageError: Its keys cannot be used.
    """
    name, key = split_address(address)
    return StoredPath(name, open_store(settings, name).settings, key)


class RangeReader:
    """An object read in ranges; nothing between them is fetched.

    Args:
        path: The object, as it was when it was looked up.
        ahead: Bytes that are fetched at least.
    """

    def __init__(self, path: StoredPath, ahead: int = AHEAD):
        self._path, self._size, self._ahead = path, path.size, ahead
        self._span, self._start = b"", 0

    def pread(self, count: int, at: int) -> bytes:
        """So many bytes from there, fewer at the end; the last range that was fetched is kept."""
        end = min(at + count, self._size)
        if at >= end:
            return b""
        have = self._start + len(self._span)
        if not self._start <= at < have:
            start = min(at, max(self._size - self._ahead, 0))
            self._span = self._fetch(start, max(end, min(start + self._ahead, self._size)))
            self._start = start
        elif end > have:
            self._span = self._span[at - self._start :] + self._fetch(have, end)
            self._start = at
        return self._span[at - self._start : end - self._start]

    def _fetch(self, start: int, end: int) -> bytes:
        stored = self._path.stored
        assert stored is not None
        return self._path.store.read(stored.key, start, end, stored.etag)
