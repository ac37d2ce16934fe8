"""Object stores: objects below the prefixes that the operator configured, and nothing else.

Every request has a time limit.
"""

from __future__ import annotations

import importlib
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, contextmanager, suppress
from dataclasses import dataclass
from datetime import timedelta
from functools import lru_cache
from typing import IO, TYPE_CHECKING, Any, cast

from app.errors import NotFoundError, StorageError, TooLargeError
from app.object_store.address import SCHEME
from app.object_store.keys import read_keys
from app.object_store.refusal import told

if TYPE_CHECKING:
    from app.config import Settings, StoreSettings

PART = 8 * 1024**2
"""Bytes of a part of an upload, of which a few are on their way at once."""
PARTS_AT_ONCE = 4
PART_SECONDS = 120.0
"""Longest time that a part may take to be written."""
LISTED = 1000
"""Objects that one request lists."""


@dataclass(frozen=True)
class Stored:
    """An object.

    Attributes:
        key: Inside the store.
        size: Bytes.
        etag: What the store calls this content; changes with it.
    """

    key: str
    size: int
    etag: str


class ObjectStore:
    """One configured store.

    Args:
        name: What people call it.
        settings: Where it is.
        keys: Access key, secret and token, or None of a public one.
    """

    def __init__(self, name: str, settings: StoreSettings, keys: tuple[str, ...] | None):
        self.name, self.settings = name, settings
        self._engine = _engine()
        self._store = self._connect(keys, settings.seconds)
        self._slow = self._connect(keys, PART_SECONDS)

    def _connect(self, keys: tuple[str, ...] | None, seconds: float) -> Any:
        settings = self.settings
        values: dict[str, Any] = {"region": settings.region}
        if settings.endpoint is not None:
            values |= {"endpoint": settings.endpoint, "virtual_hosted_style_request": False}
        if keys is None:
            values["skip_signature"] = True
        else:
            names = ("access_key_id", "secret_access_key", "session_token")
            values |= {name: value for name, value in zip(names, keys, strict=True) if value}
        limit = timedelta(seconds=seconds)
        return self._engine.store.S3Store(
            settings.bucket,
            prefix=settings.prefix or None,
            client_options={
                "timeout": limit,
                "connect_timeout": min(limit, timedelta(seconds=5)),
                "allow_http": (settings.endpoint or "").lower().startswith("http:"),
            },
            retry_config={
                "max_retries": 2,
                "retry_timeout": limit,
                "backoff": {
                    "init_backoff": timedelta(milliseconds=100),
                    "max_backoff": timedelta(seconds=1),
                    "base": 2,
                },
            },
            **values,
        )

    def address(self, key: str) -> str:
        """What people call an object or folder."""
        return f"{SCHEME}{self.name}/{key}"

    def head(self, key: str) -> Stored:
        """What there is under a key.

        Raises:
            NotFoundError: Nothing.
            StorageError: The store cannot be asked.
        """
        with self._told(key):
            return _stored(self._engine.head(self._store, key))

    def read(self, key: str, start: int, end: int, etag: str) -> bytes:
        """Some bytes of an object, as long as it is the one that was meant.

        Raises:
            ChangedObjectError, NotFoundError: It is another, or gone.
            StorageError: The store cannot be asked, or ends in the midst of it.
        """
        options = {"range": (start, end), "if_match": etag}
        with self._told(key):
            data = bytes(self._engine.get(self._store, key, options=options).bytes())
        if len(data) != end - start:
            raise StorageError(f"{self.address(key)} came in part only", hint="Try again.")
        return data

    def read_whole(self, key: str, limit: int, etag: str = "") -> tuple[bytes, Stored]:
        """A whole object.

        Args:
            key: Its key.
            limit: Most bytes that are taken.
            etag: The one that is meant; empty: whatever is there.

        Raises:
            TooLargeError: It is larger.
            NotFoundError, StorageError: As of ``read``.
        """
        with self._told(key):
            answer = self._engine.get(self._store, key, options={"if_match": etag} if etag else {})
            found = _stored(answer.meta)
            if found.size > limit:
                raise TooLargeError(f"{self.address(key)} is larger than {limit:,} bytes")
            data = bytes(answer.bytes())
        if len(data) != found.size:
            raise StorageError(f"{self.address(key)} came in part only", hint="Try again.")
        return data, found

    def below(self, folder: str) -> Iterator[Stored]:
        """Every object below a folder (empty: the whole store), by key.

        Raises:
            StorageError: The store cannot be asked.
        """
        with self._told(folder):
            for some in self._engine.list(self._store, folder or None, chunk_size=LISTED):
                yield from map(_stored, some)

    def folder(self, folder: str) -> tuple[list[str], list[Stored]]:
        """Names of folders in a folder, and the objects in it.

        Raises:
            StorageError: The store cannot be asked.
        """
        with self._told(folder):
            found = self._engine.list_with_delimiter(self._store, folder or None)
        names = [prefix.rsplit("/", 1)[-1] for prefix in found["common_prefixes"]]
        return names, [_stored(item) for item in found["objects"]]

    def put(self, key: str, content: bytes) -> None:
        """Write an object, whole or not at all.

        Raises:
            StorageError: The store refuses.
        """
        with self._told(key):
            self._engine.put(self._slow, key, content)

    @contextmanager
    def writing(self, key: str, kind: str) -> Iterator[IO[bytes]]:
        """A file whose content becomes an object when the block ends without an error.

        It goes out in parts while it is written; nobody sees it before, nor after an error.

        Args:
            key: Its key.
            kind: Its media type.

        Raises:
            StorageError: The store refuses.
        """
        with self._told(key):
            file = self._engine.open_writer(
                self._slow,
                key,
                attributes={"Content-Type": kind},
                buffer_size=PART,
                max_concurrency=PARTS_AT_ONCE,
            )
        try:
            yield cast(IO[bytes], _Written(file, lambda: self._told(key)))
        except BaseException as error:
            # The parts that are there already are taken back, if the store can be asked.
            with suppress(OSError, self._engine.exceptions.BaseError):
                file.__exit__(type(error), error, error.__traceback__)
            raise
        with self._told(key):
            file.close()

    def delete(self, key: str) -> None:
        """Delete an object; one that is gone already stays so."""
        with self._told(key):
            self._engine.delete(self._store, key)

    def signed(self, key: str, seconds: int) -> str:
        """An address of the store itself under which a browser gets an object for so long."""
        with self._told(key):
            return str(self._engine.sign(self._store, "GET", key, timedelta(seconds=seconds)))

    def _told(self, key: str) -> AbstractContextManager[None]:
        return told(self.name, self.address(key), self._engine.exceptions)


class _Written:
    """What is written to an object; nothing is sent but parts of their full size, and the last one."""

    def __init__(self, file: Any, told: Callable[[], AbstractContextManager[None]]):
        self._file, self._told = file, told

    def write(self, data: bytes) -> int:
        """Take some more bytes."""
        with self._told():
            return int(self._file.write(data))

    def flush(self) -> None:
        """Nothing: a part that is too small would be refused."""


def _stored(meta: Any) -> Stored:
    return Stored(meta["path"], meta["size"], meta["e_tag"] or "")


def _engine() -> Any:
    """The library that speaks to stores; who has none configured needs it not."""
    try:
        for part in ("obstore.store", "obstore.exceptions"):
            importlib.import_module(part)
        return importlib.import_module("obstore")
    except ImportError as error:
        raise StorageError(
            "stores need a library that is not installed", hint='Run pip install "touchline[s3]".'
        ) from error


def open_store(settings: Settings, name: str) -> ObjectStore:
    """The store of that name.

    Raises:
        NotFoundError: None is configured under it.
        StorageError: Its file of keys cannot be used, or the library is missing.
    """
    found = settings.stores.get(name)
    if found is None:
        raise NotFoundError(
            f'there is no store "{name[:63]}"',
            hint="The operator names stores in TOUCHLINE_STORES.",
        )
    return open_configured(name, found)


def open_configured(name: str, settings: StoreSettings) -> ObjectStore:
    """The store that is described so, with the keys that hold now.

    Raises:
        StorageError: Its file of keys cannot be used, or the library is missing.
    """
    return _open(name, settings, read_keys(settings))


@lru_cache(maxsize=64)
def _open(name: str, settings: StoreSettings, keys: tuple[str, ...] | None) -> ObjectStore:
    return ObjectStore(name, settings, keys)
