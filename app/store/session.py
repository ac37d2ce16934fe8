"""Store: the database, opened with the settings that keep an acknowledged edit safe."""

from __future__ import annotations

import threading
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import pysqlite3.dbapi2
from sqlalchemy import Connection, Engine, create_engine, event, text
from sqlalchemy.exc import DBAPIError, OperationalError
from sqlalchemy.orm import Session

from app.config import Settings
from app.errors import InputError, StorageError
from app.store.home import make_home
from app.store.migrate import KNOWN_REVISIONS, SCHEMA_REVISION, migrate, schema_revision

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

_WRITE = {"touchline_write": True}


class Store:
    """The database of one home: short read transactions, and one write at a time.

    Use ``Store.open``; the constructor trusts its engine.
    """

    def __init__(self, engine: Engine, settings: Settings):
        self.settings = settings
        self._engine = engine
        self._writer = engine.execution_options(**_WRITE)
        self._turn = threading.Lock()

    @staticmethod
    def open(settings: Settings) -> Store:
        """Open the database; an empty home is migrated, an older one must be first.

        Raises:
            StorageError: The schema is older or newer than this version's, or the file is not
                a database, or SQLite does not keep the promises asked of it.
            InputError: The URL is not one of SQLite.
        """
        make_home(settings)
        engine = make_engine(settings)
        with reported(settings):
            _require_pragmas(engine)
            if schema_revision(engine) is None:
                migrate(settings)
            _require_schema(engine)
        return Store(engine, settings)

    @contextmanager
    def read(self) -> Iterator[Session]:
        """A session on one consistent snapshot; nothing that it changes is kept."""
        with reported(self.settings), Session(self._engine, autoflush=False) as session:
            yield session

    @contextmanager
    def write(self) -> Iterator[Session]:
        """A session that holds the database's write lock from its start and commits at its end.

        Threads of one process wait for their turn here, processes in SQLite. It does not nest.
        """
        with self._turn, reported(self.settings), Session(self._writer) as session:
            # Take the lock before anything is read, so that what is read is still true when it
            # is written.
            session.connection()
            yield session
            session.commit()

    def close(self) -> None:
        """Close all connections."""
        self._engine.dispose()


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


def _require_pragmas(engine: Engine) -> None:
    with engine.connect() as connection:
        for name, (value, expected) in PRAGMAS.items():
            answer = connection.exec_driver_sql(f"PRAGMA {name}").scalar()
            if answer != expected:
                raise StorageError(f"SQLite refuses {name}={value} (it answers {answer})")


def _require_schema(engine: Engine) -> None:
    revision = schema_revision(engine)
    if revision == SCHEMA_REVISION:
        return
    if revision in KNOWN_REVISIONS:
        raise StorageError(
            "the database was made by an older version of Touchline", hint="Run touchline migrate."
        )
    raise StorageError(
        f"the database was made by a newer version of Touchline (schema {revision})",
        hint="Update Touchline; an older version would damage the data.",
    )


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
        raise


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


def ping(store: Store) -> None:
    """Ask the database one question; raises ``StorageError`` when it does not answer."""
    with store.read() as session:
        session.execute(text("SELECT 1"))
