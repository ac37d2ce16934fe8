"""SQLite: a file in the home, with the settings that keep an acknowledged edit safe."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from contextlib import AbstractContextManager, contextmanager, nullcontext
from functools import partial
from time import monotonic, sleep
from typing import Any

import pysqlite3.dbapi2
from sqlalchemy import Connection, Engine, FromClause, Table, create_engine, event, text
from sqlalchemy.dialects.sqlite.base import SQLiteCompiler
from sqlalchemy.exc import DBAPIError, OperationalError

from app.config import Settings
from app.db.dialects.dialect import (
    AUTOCOMMIT,
    DatabaseFailure,
    SingleProcessCoordinator,
    unstorable_text_error,
)
from app.db.session import Session
from app.errors import StorageError

BUSY_SECONDS = 5.0
"""So long a connection waits for what another process writes."""
AGAIN_S = 0.002
"""Between two looks whether a write may begin. SQLite itself looks again after up to 100 ms, and who writes
one transaction after the other, as an import does, leaves gaps that are shorter."""
_BUSY_MS = int(1000 * BUSY_SECONDS)
_WAIT, _WAIT_NOT = f"PRAGMA busy_timeout={_BUSY_MS}", "PRAGMA busy_timeout=0"

PRAGMAS: dict[str, tuple[str, object]] = {
    "journal_mode": ("WAL", "wal"),
    # With NORMAL a power cut loses acknowledged edits.
    "synchronous": ("FULL", 2),
    "foreign_keys": ("ON", 1),
    "busy_timeout": (str(_BUSY_MS), _BUSY_MS),
    "trusted_schema": ("OFF", 0),
}
"""What each connection sets, and what SQLite must answer when asked."""

MIN_SQLITE = (3, 51, 3)
"""Older ones can corrupt the file when the WAL is reset."""

STEPS = 10_000
"""Of SQLite's machine between two looks whether to go on: some microseconds each."""

_BEFORE = "touchline_changes"
"""Where a connection notes how many rows it had changed before its transaction."""

_FAILURES = {
    "SQLITE_FULL": DatabaseFailure.FULL,
    "SQLITE_BUSY": DatabaseFailure.BUSY,
    "SQLITE_LOCKED": DatabaseFailure.BUSY,
    "SQLITE_CORRUPT": DatabaseFailure.DAMAGED,
    "SQLITE_NOTADB": DatabaseFailure.DAMAGED,
    "SQLITE_READONLY": DatabaseFailure.UNREADABLE,
    "SQLITE_CANTOPEN": DatabaseFailure.UNREADABLE,
    "SQLITE_PERM": DatabaseFailure.UNREADABLE,
    "SQLITE_IOERR": DatabaseFailure.DISK,
}
"""By how SQLite's name of an error begins."""


class SQLiteDialect:
    """A file of the home."""

    name = "SQLite"
    no_fault = "SQLite finds no fault"
    restoring = "Run touchline restore BACKUP: it takes the place of the database, which is kept."
    is_file = True

    def make_engine(self, settings: Settings, *, lasting: bool = True) -> Engine:
        """See ``Dialect``."""
        # As many connections as a server has threads; a file that is open costs little.
        return _make_engine(settings, lasting, pool_size=16, max_overflow=48)

    def reading(self, engine: Engine) -> Engine:
        """See ``Dialect``; a deferred transaction sees one snapshot already."""
        return engine

    def autocommit_engine(self, engine: Engine) -> Engine:
        """See ``Dialect``."""
        return engine.execution_options(**AUTOCOMMIT)

    def nonblocking_engine(self, settings: Settings) -> Engine:
        """See ``Dialect``; readers of a write-ahead log wait for nobody, but while it is recovered."""
        engine = _make_engine(settings, True, pool_size=1, max_overflow=0, pool_timeout=0)
        event.listen(engine, "connect", _disable_busy_timeout)
        return engine.execution_options(**AUTOCOMMIT)

    def sharing(
        self, engine: Engine, reported: Callable[[], AbstractContextManager[None]]
    ) -> SingleProcessCoordinator:
        """See ``Dialect``; one server has a file."""
        return SingleProcessCoordinator()

    def require_supported_configuration(self, engine: Engine) -> None:
        """See ``Dialect``."""
        with engine.connect() as connection:
            for name, (value, expected) in PRAGMAS.items():
                answer = connection.exec_driver_sql(f"PRAGMA {name}").scalar()
                if answer != expected:
                    raise StorageError(
                        f"SQLite did not accept {name}={value}: the setting is still {answer}"
                    )

    def failure(self, error: DBAPIError) -> tuple[DatabaseFailure, str]:
        """See ``Dialect``."""
        name = str(getattr(error.orig, "sqlite_errorname", ""))
        # Text that is no UTF-8 has no name of its own.
        if "Could not decode to UTF-8" in str(error.orig):
            return DatabaseFailure.DAMAGED, name
        found = (kind for start, kind in _FAILURES.items() if name.startswith(start))
        return next(found, DatabaseFailure.OTHER), name

    @contextmanager
    def interrupt_when(self, session: Session, ends: Callable[[], bool]) -> Iterator[None]:
        """See ``Dialect``."""
        driver: Any = session.connection.driver_connection
        driver.set_progress_handler(ends, STEPS)
        try:
            yield
        except OperationalError:
            if not ends():
                raise
        finally:
            driver.set_progress_handler(None, 0)

    def migration_context(self, connection: Connection, *, new: bool) -> nullcontext[None]:
        """See ``Dialect``; the migrations are written for SQLite."""
        return nullcontext()

    def settle(self, connection: Connection, tables: Sequence[Table], key: str) -> None:
        """See ``Dialect``; ids follow the rows, and the first page says whose they are (``recovery.preopen_check``)."""
        connection.exec_driver_sql(f"PRAGMA application_id = {int(key[:7], 16)}")

    def find_file_faults(
        self, session: Session, most: int = 5, *, thorough: bool = False
    ) -> list[str]:
        """See ``Dialect``."""
        check = "integrity_check" if thorough else "quick_check"
        found = session.scalars(text(f"PRAGMA {check}({most})")).all()
        return [] if found == ["ok"] else [" ".join(sentence.split()) for sentence in found]

    def count_lost_references(self, session: Session) -> int:
        """See ``Dialect``."""
        return len(session.execute(text("PRAGMA foreign_key_check")).all())


DIALECT = SQLiteDialect()


class _TableHintCompiler(SQLiteCompiler):
    """Writes hints on a table (INDEXED BY), which SQLAlchemy leaves out for SQLite."""

    def get_from_hint_text(self, table: FromClause, text: str | None) -> str | None:
        """What stands behind the table's name."""
        return text


def _make_engine(settings: Settings, lasting: bool, **pool: int) -> Engine:
    if pysqlite3.dbapi2.sqlite_version_info < MIN_SQLITE:
        needed = ".".join(map(str, MIN_SQLITE))
        raise StorageError(
            f"SQLite {pysqlite3.dbapi2.sqlite_version} has a fault that can damage a database;"
            f" Touchline needs {needed} or later",
            hint="Install the version of pysqlite3 that requirements.txt requires.",
        )
    engine = create_engine(settings.database, module=pysqlite3.dbapi2, hide_parameters=True, **pool)
    engine.dialect.statement_compiler = _TableHintCompiler
    event.listen(engine, "connect", partial(_set_pragmas, lasting))
    event.listen(engine, "begin", _begin_transaction)
    event.listen(engine, "commit", _count_write)
    event.listen(engine, "before_cursor_execute", _refuse_null_characters)
    return engine


def _refuse_null_characters(
    _connection: object, _cursor: object, _statement: str, values: Any, _context: object, many: bool
) -> None:
    """PostgreSQL cannot keep U+0000: what SQLite took could never be transferred."""
    for row in values if many else (values,):
        for value in row.values() if isinstance(row, dict) else row:
            if isinstance(value, str) and "\0" in value:
                raise unstorable_text_error()


def _disable_busy_timeout(connection: Any, _record: object) -> None:
    connection.execute(_WAIT_NOT)


def _set_pragmas(lasting: bool, connection: Any, _record: object) -> None:
    # The driver must not begin transactions by itself: it would begin them late and deferred.
    connection.isolation_level = None
    cursor = connection.cursor()
    # First, so that the switch to WAL waits for another process doing the same.
    cursor.execute(_WAIT)
    for name, (value, _answer) in PRAGMAS.items():
        cursor.execute(f"PRAGMA {name}={value}")
    if not lasting:
        cursor.execute("PRAGMA synchronous=NORMAL")
    cursor.close()


def _begin_transaction(connection: Connection) -> None:
    if connection.get_execution_options().get("touchline_glance", False):
        return
    if not _is_write_connection(connection):
        connection.exec_driver_sql("BEGIN")
        return
    driver, until = _driver_connection(connection), monotonic() + BUSY_SECONDS
    driver.execute(_WAIT_NOT)
    try:
        while not _try_to_begin_write(connection, last=monotonic() >= until):
            sleep(AGAIN_S)
    finally:
        driver.execute(_WAIT)
    connection.info[_BEFORE] = driver.total_changes


def _try_to_begin_write(connection: Connection, *, last: bool) -> bool:
    """Whether a write could begin; the last time that it could not is an error."""
    try:
        connection.exec_driver_sql("BEGIN IMMEDIATE")
    except OperationalError as error:
        if last or DIALECT.failure(error)[0] is not DatabaseFailure.BUSY:
            raise
        return False
    return True


def _count_write(connection: Connection) -> None:
    """Count a write in the first page, by which a write-ahead log knows its database (``wal``)."""
    driver = _driver_connection(connection)
    if _is_write_connection(connection) and driver.total_changes != connection.info[_BEFORE]:
        (count,) = driver.execute("PRAGMA user_version").fetchone()
        driver.execute(f"PRAGMA user_version = {(count + 1) % 2**31}")


def _is_write_connection(connection: Connection) -> bool:
    return bool(connection.get_execution_options().get("touchline_write", False))


def _driver_connection(connection: Connection) -> Any:
    return connection.connection.dbapi_connection
