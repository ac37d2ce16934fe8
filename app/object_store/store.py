"""Object stores: objects below the prefixes that the operator configured, and nothing else.

Every request has a time limit.
"""

from __future__ import annotations

import configparser
import importlib
import re
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, contextmanager, suppress
from dataclasses import dataclass
from datetime import timedelta
from functools import lru_cache
from typing import IO, TYPE_CHECKING, Any, cast

from app.durable import is_open_to_others
from app.errors import InputError, NotFoundError, StorageError, TooLargeError

if TYPE_CHECKING:
    from app.config import ObjectStoreSettings, Settings

SCHEME = "s3://"
"""What addresses begin with."""
PART = 8 * 1024**2
"""Bytes of a part of an upload, of which a few are on their way at once."""
PARTS_AT_ONCE = 4
PART_SECONDS = 120.0
"""Longest time that a part may take to be written."""
LISTED = 1000
"""Objects that one request lists."""
OPERATOR = "Ask the operator: touchline doctor reports what is wrong with a store."
_CODE = re.compile(r"<Code>(\w{1,60})</Code>")
_KEYS_REFUSED = frozenset(
    {"AccessDenied", "ExpiredToken", "InvalidAccessKeyId", "InvalidToken", "SignatureDoesNotMatch", "TokenRefreshRequired"}
)  # fmt: skip


class ChangedObjectError(NotFoundError):
    """The object is not the one that was meant any more."""


@dataclass(frozen=True)
class StoredObject:
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

    def __init__(self, name: str, settings: ObjectStoreSettings, keys: tuple[str, ...] | None):
        self.name, self.settings = name, settings
        self._engine = _load_library()
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

    def head(self, key: str) -> StoredObject:
        """What there is under a key.

        Raises:
            NotFoundError: Nothing.
            StorageError: The store cannot be asked.
        """
        with self._translate_errors(key):
            return _make_stored_object(self._engine.head(self._store, key))

    def read(self, key: str, start: int, end: int, etag: str) -> bytes:
        """Some bytes of an object, as long as it is the one that was meant.

        Raises:
            ChangedObjectError, NotFoundError: It is another, or gone.
            StorageError: The store cannot be asked, or ends in the midst of it.
        """
        options = {"range": (start, end), "if_match": etag}
        with self._translate_errors(key):
            data = bytes(self._engine.get(self._store, key, options=options).bytes())
        if len(data) != end - start:
            raise StorageError(f"{self.address(key)} was received only in part", hint="Try again.")
        return data

    def read_whole(self, key: str, limit: int, etag: str = "") -> tuple[bytes, StoredObject]:
        """A whole object.

        Args:
            key: Its key.
            limit: Most bytes that are taken.
            etag: The one that is meant; empty: whatever is there.

        Raises:
            TooLargeError: It is larger.
            NotFoundError, StorageError: As of ``read``.
        """
        with self._translate_errors(key):
            answer = self._engine.get(self._store, key, options={"if_match": etag} if etag else {})
            found = _make_stored_object(answer.meta)
            if found.size > limit:
                raise TooLargeError(f"{self.address(key)} is larger than {limit:,} bytes")
            data = bytes(answer.bytes())
        if len(data) != found.size:
            raise StorageError(f"{self.address(key)} was received only in part", hint="Try again.")
        return data, found

    def iterate_objects_below(self, folder: str) -> Iterator[StoredObject]:
        """Every object below a folder (empty: the whole store), by key.

        Raises:
            StorageError: The store cannot be asked.
        """
        with self._translate_errors(folder):
            for some in self._engine.list(self._store, folder or None, chunk_size=LISTED):
                yield from map(_make_stored_object, some)

    def list_folder(self, folder: str) -> tuple[list[str], list[StoredObject]]:
        """Names of folders in a folder, and the objects in it.

        Raises:
            StorageError: The store cannot be asked.
        """
        with self._translate_errors(folder):
            found = self._engine.list_with_delimiter(self._store, folder or None)
        names = [prefix.rsplit("/", 1)[-1] for prefix in found["common_prefixes"]]
        return names, [_make_stored_object(item) for item in found["objects"]]

    def put(self, key: str, content: bytes) -> None:
        """Write an object, whole or not at all.

        Raises:
            StorageError: The store refuses.
        """
        with self._translate_errors(key):
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
        with self._translate_errors(key):
            file = self._engine.open_writer(
                self._slow,
                key,
                attributes={"Content-Type": kind},
                buffer_size=PART,
                max_concurrency=PARTS_AT_ONCE,
            )
        try:
            yield cast(IO[bytes], _ObjectWriter(file, lambda: self._translate_errors(key)))
        except BaseException as error:
            # The parts that are there already are taken back, if the store can be asked.
            with suppress(OSError, self._engine.exceptions.BaseError):
                file.__exit__(type(error), error, error.__traceback__)
            raise
        with self._translate_errors(key):
            file.close()

    def delete(self, key: str) -> None:
        """Delete an object; one that is gone already stays so."""
        with self._translate_errors(key):
            self._engine.delete(self._store, key)

    def make_signed_url(self, key: str, seconds: int) -> str:
        """An address of the store itself under which a browser gets an object for so long."""
        with self._translate_errors(key):
            return str(self._engine.sign(self._store, "GET", key, timedelta(seconds=seconds)))

    def _translate_errors(self, key: str) -> AbstractContextManager[None]:
        return translate_store_errors(self.name, self.address(key), self._engine.exceptions)


class _ObjectWriter:
    """What is written to an object; nothing is sent but parts of their full size, and the last one."""

    def __init__(self, file: Any, translated: Callable[[], AbstractContextManager[None]]):
        self._file, self._translated = file, translated

    def write(self, data: bytes) -> int:
        """Take some more bytes."""
        with self._translated():
            return int(self._file.write(data))

    def flush(self) -> None:
        """Nothing: a part that is too small would be refused."""


def _make_stored_object(meta: Any) -> StoredObject:
    return StoredObject(meta["path"], meta["size"], meta["e_tag"] or "")


def _load_library() -> Any:
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
    return open_configured_store(name, found)


def open_configured_store(name: str, settings: ObjectStoreSettings) -> ObjectStore:
    """The store that is described so, with the keys that hold now.

    Raises:
        StorageError: Its file of keys cannot be used, or the library is missing.
    """
    return _open_with_keys(name, settings, read_access_keys(settings))


@lru_cache(maxsize=64)
def _open_with_keys(
    name: str, settings: ObjectStoreSettings, keys: tuple[str, ...] | None
) -> ObjectStore:
    return ObjectStore(name, settings, keys)


def read_access_keys(settings: ObjectStoreSettings) -> tuple[str, ...] | None:
    """Access key, secret and token, or None of a public store.

    They are read anew each time, for keys in a file are changed there.

    Raises:
        StorageError: The file of keys cannot be used.
    """
    if settings.anonymous:
        return None
    if settings.key_file is not None:
        return _read_key_file(settings)
    given = (settings.key, settings.secret, settings.token)
    return tuple("" if value is None else value.get_secret_value() for value in given)


def _read_key_file(settings: ObjectStoreSettings) -> tuple[str, ...]:
    path, parser = settings.key_file, configparser.ConfigParser(interpolation=None)
    assert path is not None
    try:
        if is_open_to_others(path.stat()):
            raise StorageError(
                f"other users can read {path}, which holds the keys of a store",
                hint=f"Run chmod 600 {path}.",
            )
        parser.read_string(path.read_text("utf-8"))
        section = parser[settings.profile]
        return (
            section["aws_access_key_id"],
            section["aws_secret_access_key"],
            section.get("aws_session_token", ""),
        )
    except (OSError, KeyError, UnicodeDecodeError, configparser.Error):
        # The text of the file is in no message.
        raise StorageError(
            "the file with the credentials of a store cannot be read, or lacks the profile or a key",
            hint=OPERATOR,
        ) from None


@contextmanager
def translate_store_errors(store: str, address: str, wrong: Any) -> Iterator[None]:
    """Raise errors of the library as ours, in sentences without keys, buckets or endpoints.

    Args:
        store: Its name.
        address: What it was asked for, as people call it.
        wrong: The errors of the library that speaks to it.

    Raises:
        ChangedObjectError, NotFoundError: The object is another, or not there.
        InputError: It cannot be the address of an object.
        StorageError: The store cannot be asked, or refuses.
    """
    try:
        yield
    except FileNotFoundError as error:
        raise NotFoundError(f"{address} is not in its store") from error
    except wrong.PreconditionError as error:
        raise ChangedObjectError(
            f"{address} was changed in its store since it was imported",
            hint="Import it again to use the new object, or restore the old one.",
        ) from error
    except (wrong.BaseError, OSError) as error:
        raise _store_error(store, error, wrong) from error
    except ValueError as error:
        raise InputError(f"{address} cannot be the address of an object") from error


def _store_error(name: str, error: Exception, wrong: Any) -> StorageError:
    """The error of a store that cannot be asked."""
    found = _CODE.search(str(error))
    code = f" ({found[1]})" if found else ""
    denied = isinstance(error, wrong.PermissionDeniedError | wrong.UnauthenticatedError)
    if denied or (found and found[1] in _KEYS_REFUSED):
        return StorageError(
            f'the store "{name}" refuses the keys of this server{code}', hint=OPERATOR
        )
    if code:
        return StorageError(
            f'the store "{name}" failed to carry out a request{code}', hint=OPERATOR
        )
    return StorageError(
        f'the store "{name}" cannot be reached, or does not answer in time',
        hint="Try again in a moment. " + OPERATOR,
    )
