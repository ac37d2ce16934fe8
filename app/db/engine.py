"""Engine: the connections to a home's database, and what it refuses as a sentence."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager

from sqlalchemy import Engine
from sqlalchemy.exc import DBAPIError, OperationalError

from app.config import Settings
from app.db.dialects.dialect import WRITE as WRITE
from app.db.dialects.dialect import Failure, dialect_of, unstorable_text_error
from app.errors import EXAMINE, BusyError, DamagedError, StorageError


def make_engine(settings: Settings, *, lasting: bool = True) -> Engine:
    """An engine whose connections keep our promises and begin transactions as told.

    Args:
        settings: Where the database is.
        lasting: False: what its transactions write may be lost in a power cut.

    Raises:
        InputError: The URL is neither one of SQLite nor of PostgreSQL.
    """
    return dialect_of(settings).make_engine(settings, lasting=lasting)


@contextmanager
def report_storage_errors(settings: Settings) -> Iterator[None]:
    """Turn what the disk or the database refuses into a ``StorageError`` with a sentence.

    A text that no database of its kind can hold is the caller's: an ``InputError``.
    """
    try:
        yield
    except DBAPIError as error:
        kind, name = dialect_of(settings).failure(error)
        if kind is Failure.TEXT:
            raise unstorable_text_error() from error
        if kind is not Failure.OTHER or isinstance(error, OperationalError):
            raise _storage_error(error, kind, name, settings) from error
        raise StorageError(
            "the database could not carry out the request", hint="Nothing was saved. Try again."
        ) from error


def _storage_error(error: DBAPIError, kind: Failure, name: str, settings: Settings) -> StorageError:
    file = settings.database_name
    if kind is Failure.FULL:
        return StorageError(
            "the disk is full: the change was not saved, everything before it is safe",
            hint="Free some space and send the change again.",
        )
    if kind is Failure.BUSY:
        return BusyError(
            "another process is writing; the change was not saved", hint="Try again in a moment."
        )
    if kind is Failure.DAMAGED:
        return DamagedError(f"{file} is damaged or not a database", hint=EXAMINE)
    if kind is Failure.UNREADABLE:
        return StorageError(
            f"{file} cannot be read and written ({name})",
            hint="Make the home folder and its files writable, or set TOUCHLINE_HOME to another.",
        )
    if kind is Failure.DISK:
        return StorageError(
            f"the disk does not read or write {file} ({name})",
            hint="Free space on the disk; touchline doctor reports how much is left.",
        )
    if kind is Failure.AWAY:
        return StorageError(
            f"{file} cannot be reached" + (f" ({name})" if name else ""),
            hint="Is the server of the database running, and are TOUCHLINE_DATABASE_URL's host,"
            " database, user and password right? Nothing was saved.",
        )
    return StorageError(f"the database refuses the statement ({name or type(error).__name__})")
