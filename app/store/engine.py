"""Engine: connections to SQLite with the settings that keep an acknowledged edit safe."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import pysqlite3.dbapi2
from sqlalchemy import Connection, Engine, create_engine, event
from sqlalchemy.exc import DBAPIError, OperationalError

from app.config import Settings
from app.errors import InputError, StorageError

PRAGMAS: dict[str, tuple[str, object]] = {
    "journal_mode": ("WAL", "wal"),
    # With NORMAL a power cut loses acknowledged edits.
    "synchronous": ("FULL", 2),
    "foreign_keys": ("ON", 1),
    "busy_timeout": ("5000", 5000),
    "trusted_schema": ("OFF", 0),
}
"""What each connection sets, and what SQLite must answer when asked."""

MIN_SQLITE = (3, 51, 3)
"""Older ones can corrupt the file when the WAL is reset."""

WRITE = {"touchline_write": True}
"""Options of an engine whose transactions take the write lock at their start."""


def make_engine(settings: Settings) -> Engine:
    """An engine whose connections carry the pragmas and begin transactions as told."""
    if not settings.database.startswith(("sqlite:", "sqlite+pysqlite:")):
        raise InputError(
            "only SQLite databases are supported", hint="Leave TOUCHLINE_DATABASE_URL unset."
        )
    if pysqlite3.dbapi2.sqlite_version_info < MIN_SQLITE:
        raise StorageError(f"SQLite {pysqlite3.dbapi2.sqlite_version} can corrupt its file")
    # As many connections as a server has threads; a file that is open costs little.
    engine = create_engine(
        settings.database, module=pysqlite3.dbapi2, pool_size=16, max_overflow=48
    )
    event.listen(engine, "connect", _set_pragmas)
    event.listen(engine, "begin", _begin)
    return engine


def _set_pragmas(connection: Any, _record: object) -> None:
    # The driver must not begin transactions by itself: it would begin them late and deferred.
    connection.isolation_level = None
    cursor = connection.cursor()
    # First, so that the switch to WAL waits for another process doing the same.
    cursor.execute("PRAGMA busy_timeout=5000")
    for name, (value, _answer) in PRAGMAS.items():
        cursor.execute(f"PRAGMA {name}={value}")
    cursor.close()


def _begin(connection: Connection) -> None:
    write = connection.get_execution_options().get("touchline_write", False)
    connection.exec_driver_sql("BEGIN IMMEDIATE" if write else "BEGIN")


def require_pragmas(engine: Engine) -> None:
    """Raise StorageError where SQLite does not keep the promises asked of it."""
    with engine.connect() as connection:
        for name, (value, expected) in PRAGMAS.items():
            answer = connection.exec_driver_sql(f"PRAGMA {name}").scalar()
            if answer != expected:
                raise StorageError(f"SQLite refuses {name}={value} (it answers {answer})")


@contextmanager
def reported(settings: Settings) -> Iterator[None]:
    """Turn what the disk or SQLite refuses into a ``StorageError`` with a sentence."""
    try:
        yield
    except OperationalError as error:
        raise _storage_error(error, settings) from error
    except DBAPIError as error:
        if getattr(error.orig, "sqlite_errorname", "") in ("SQLITE_NOTADB", "SQLITE_CORRUPT"):
            raise _storage_error(error, settings) from error
        raise StorageError(
            "the database could not carry out the request", hint="Nothing was saved. Try again."
        ) from error


def _storage_error(error: DBAPIError, settings: Settings) -> StorageError:
    name = str(getattr(error.orig, "sqlite_errorname", ""))
    file = Path(settings.database.partition("///")[2]).name
    if name.startswith("SQLITE_FULL"):
        return StorageError(
            "the disk is full: the change was not saved, everything before it is safe",
            hint="Free some space and send the change again.",
        )
    if name.startswith(("SQLITE_BUSY", "SQLITE_LOCKED")):
        return StorageError(
            "another process is writing; the change was not saved", hint="Try again in a moment."
        )
    if name.startswith(("SQLITE_CORRUPT", "SQLITE_NOTADB")):
        return StorageError(
            f"{file} is damaged or not a database", hint="Put a backup in its place."
        )
    if name.startswith(("SQLITE_READONLY", "SQLITE_CANTOPEN", "SQLITE_IOERR", "SQLITE_PERM")):
        return StorageError(f"{file} cannot be read or written ({name})")
    return StorageError(f"the database refuses the statement ({name or type(error).__name__})")
