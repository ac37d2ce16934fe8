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
from app.errors import EXAMINE, BusyError, DamagedError, InputError, StorageError

PRAGMAS: dict[str, tuple[str, object]] = {
    "journal_mode": ("WAL", "wal"),
    # With NORMAL a power cut loses acknowledged edits.
    "synchronous": ("FULL", 2),
    "foreign_keys": ("ON", 1),
    "busy_timeout": ("5000", 5000),
    "trusted_schema": ("OFF", 0),
}
"""What each connection sets, and what SQLite must answer when asked."""

_DAMAGE = ("SQLITE_CORRUPT", "SQLITE_NOTADB")

MIN_SQLITE = (3, 51, 3)
"""Older ones can corrupt the file when the WAL is reset."""

_BEFORE = "touchline_changes"
"""Where a connection notes how many rows it had changed before its transaction."""
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
    event.listen(engine, "commit", _count)
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
    write = _writes(connection)
    connection.exec_driver_sql("BEGIN IMMEDIATE" if write else "BEGIN")
    if write:
        connection.info[_BEFORE] = _driver(connection).total_changes


def _count(connection: Connection) -> None:
    """Count a write in the first page, by which a write-ahead log knows its database (``wal``)."""
    driver = _driver(connection)
    if _writes(connection) and driver.total_changes != connection.info[_BEFORE]:
        (count,) = driver.execute("PRAGMA user_version").fetchone()
        driver.execute(f"PRAGMA user_version = {(count + 1) % 2**31}")


def _writes(connection: Connection) -> bool:
    return bool(connection.get_execution_options().get("touchline_write", False))


def _driver(connection: Connection) -> Any:
    return connection.connection.dbapi_connection


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
        if _is_damage(error):
            raise _storage_error(error, settings) from error
        raise StorageError(
            "the database could not carry out the request", hint="Nothing was saved. Try again."
        ) from error


def _is_damage(error: DBAPIError) -> bool:
    # Text that is no UTF-8 has no name of its own.
    return _name(error).startswith(_DAMAGE) or "Could not decode to UTF-8" in str(error.orig)


def _name(error: DBAPIError) -> str:
    return str(getattr(error.orig, "sqlite_errorname", ""))


def _storage_error(error: DBAPIError, settings: Settings) -> StorageError:
    name = _name(error)
    file = Path(settings.database.partition("///")[2]).name
    if name.startswith("SQLITE_FULL"):
        return StorageError(
            "the disk is full: the change was not saved, everything before it is safe",
            hint="Free some space and send the change again.",
        )
    if name.startswith(("SQLITE_BUSY", "SQLITE_LOCKED")):
        return BusyError(
            "another process is writing; the change was not saved", hint="Try again in a moment."
        )
    if _is_damage(error):
        return DamagedError(f"{file} is damaged or not a database", hint=EXAMINE)
    if name.startswith(("SQLITE_READONLY", "SQLITE_CANTOPEN", "SQLITE_PERM")):
        return StorageError(
            f"{file} cannot be read and written ({name})",
            hint="Make the home folder and its files writable, or set TOUCHLINE_HOME to another.",
        )
    if name.startswith("SQLITE_IOERR"):
        return StorageError(
            f"the disk does not read or write {file} ({name})",
            hint="Look after the disk; touchline doctor says what is left.",
        )
    return StorageError(f"the database refuses the statement ({name or type(error).__name__})")
