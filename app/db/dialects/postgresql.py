"""PostgreSQL: its connections, and what SQLAlchemy compiles differently for it.

Migrations get their triggers here.
"""

from __future__ import annotations

import re
import threading
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from functools import partial
from typing import Any

from sqlalchemy import (
    URL,
    Column,
    Connection,
    Constraint,
    Engine,
    String,
    Table,
    create_engine,
    event,
    make_url,
)
from sqlalchemy.dialects.postgresql.base import PGDDLCompiler, PGTypeCompiler
from sqlalchemy.dialects.postgresql.psycopg import PGDialect_psycopg
from sqlalchemy.exc import ArgumentError, DataError, DBAPIError, NoSuchModuleError, OperationalError

from app.config import Settings
from app.db.dialects.dialect import AUTOCOMMIT, DatabaseFailure, ProcessCoordinator
from app.db.dialects.postgresql_sharing import PostgreSQLCoordinator, Reported
from app.db.session import Session
from app.errors import InputError, StorageError

_Compiler: Any = PGDialect_psycopg.statement_compiler


class StatementCompiler(_Compiler):  # type: ignore[misc]
    """LIKE that takes no notice of the case of ASCII letters; the columns' collation is C."""

    def visit_like_op_binary(self, binary: Any, operator: Any, **kw: Any) -> str:
        """ILIKE."""
        return str(self.visit_ilike_op_binary(binary, operator, **kw))

    def visit_not_like_op_binary(self, binary: Any, operator: Any, **kw: Any) -> str:
        """NOT ILIKE."""
        return str(self.visit_not_ilike_op_binary(binary, operator, **kw))


class TypeCompiler(PGTypeCompiler):
    """Whole numbers of 64 bits."""

    def visit_INTEGER(self, type_: Any, **kw: Any) -> str:
        """BIGINT."""
        return "BIGINT"


class ColumnCompiler(PGDDLCompiler):
    """Columns as they are created: collation "C" for text, bigint ids, deferrable references."""

    def get_column_specification(self, column: Column[Any], **kw: Any) -> str:
        """A column as it is created."""
        made: Any = super()
        text = str(made.get_column_specification(column, **kw)).replace(" SERIAL", " BIGSERIAL", 1)
        return f'{text} COLLATE "C"' if isinstance(column.type, String) else text

    def define_constraint_deferrability(self, constraint: Constraint) -> str:
        """When a constraint is checked: references at the end of a transaction, if that asks."""
        text = super().define_constraint_deferrability(constraint)
        is_reference = constraint.__visit_name__ == "foreign_key_constraint"
        return text or (" DEFERRABLE INITIALLY IMMEDIATE" if is_reference else "")


_TRIGGER = re.compile(
    r"CREATE TRIGGER (?P<name>\w+) (?P<moment>BEFORE|AFTER)"
    r" (?P<verb>INSERT|UPDATE|DELETE)(?P<columns> OF [\w, ]+)? ON (?P<table>\w+)\s+"
    r"(?:WHEN (?P<when>.*?)\s+)?BEGIN (?P<body>.*); END\s*",
    re.S,
)
_REFUSAL = re.compile(r"SELECT RAISE\(ABORT, '(?P<sentence>[^']*)'\)")
_DROP = re.compile(r"DROP TRIGGER (?P<name>\w+)\s*")
_NOTHING = "SELECT 1"
SCAN = "queue_scanned"
"""An index of 26 columns that SQLite's questions name; PostgreSQL chooses by itself, and would only
have to keep it up at every edit."""


def adapt_sqlite_statement(cursor: Any, statement: str, *, new: bool) -> str:
    """Carry out what only SQLite understands; returns the statement that is left to be executed.

    Args:
        cursor: Of the driver.
        statement: As the migration says it.
        new: The database was empty: no rows are there to be brought up to date.
    """
    if statement.startswith("PRAGMA "):
        return _NOTHING
    if new and statement.startswith("UPDATE ") and "alembic_version" not in statement:
        return _NOTHING
    if statement.startswith(f"CREATE INDEX {SCAN} "):
        return _NOTHING
    if found := _TRIGGER.fullmatch(statement):
        cursor.execute(build_trigger_statements(**found.groupdict()))
        return _NOTHING
    if found := _DROP.fullmatch(statement):
        # The trigger goes with its function.
        return f"DROP FUNCTION {found['name']} CASCADE"
    return statement


def build_trigger_statements(
    name: str,
    moment: str,
    verb: str,
    columns: str | None,
    table: str,
    when: str | None,
    body: str,
) -> str:
    """The statements that make a function and the trigger that calls it, for each row.

    A condition goes into the function: only there may it ask other tables. What must not be
    deleted must not be truncated either.
    """
    row = "OLD" if verb == "DELETE" else "NEW"
    if refusal := _REFUSAL.fullmatch(body):
        body = f"RAISE EXCEPTION '{refusal['sentence']}' USING ERRCODE = '23000'"
    elif body == "SELECT RAISE(IGNORE)":
        body = "RETURN NULL"
    if when is not None:
        body = f"IF {_translate_is_not_condition(when)} THEN {body}; END IF"
    made = (
        f"CREATE FUNCTION {name}() RETURNS trigger LANGUAGE plpgsql AS"
        f" $$ BEGIN {body}; RETURN {row}; END $$;"
        f" CREATE TRIGGER {name} {moment} {verb}{columns or ''} ON {table}"
        f" FOR EACH ROW EXECUTE FUNCTION {name}();"
    )
    if refusal and verb == "DELETE":
        name = f"{table}_refuses_truncate"
        made += (
            f" CREATE OR REPLACE FUNCTION {name}() RETURNS trigger LANGUAGE plpgsql AS"
            f" $$ BEGIN RAISE EXCEPTION '{refusal['sentence']}' USING ERRCODE = '23000'; END $$;"
            f" CREATE OR REPLACE TRIGGER {name} BEFORE TRUNCATE ON {table}"
            f" FOR EACH STATEMENT EXECUTE FUNCTION {name}();"
        )
    return made


def _translate_is_not_condition(condition: str) -> str:
    """SQLite's IS NOT between values."""
    return re.sub(r"IS NOT (?=NEW\.|OLD\.)", "IS DISTINCT FROM ", condition)


MIN_SERVER = 15
"""The oldest major version that the tests have seen."""
WRITE_LOCK = 0x746F756368
"""The advisory lock of the one writer; it is the database's, and ends with its transaction."""
KEEPALIVE = {"idle": 15, "interval": 5, "count": 3}
"""Seconds of silence, seconds between questions, and how many stay without an answer, until either end of a
connection takes the other for gone, with the write lock or the claims that it holds."""
GONE_SECONDS = 30
"""The same for what was sent and that nobody says has arrived."""
LOCK_SECONDS = 5
"""How long a writer waits for others, and a migration for a table."""
LOOK_SECONDS = 0.2
"""Between two looks whether a statement is still wanted."""

_FAILURES = {
    "53100": DatabaseFailure.FULL,
    "55P03": DatabaseFailure.BUSY,
    "40P01": DatabaseFailure.BUSY,
    "40001": DatabaseFailure.BUSY,
    "XX001": DatabaseFailure.DAMAGED,
    "XX002": DatabaseFailure.DAMAGED,
    "25006": DatabaseFailure.UNREADABLE,
    "42501": DatabaseFailure.UNREADABLE,
    "58030": DatabaseFailure.DISK,
    "22021": DatabaseFailure.TEXT,
    "22P05": DatabaseFailure.TEXT,
    "53300": DatabaseFailure.AWAY,
    "57P01": DatabaseFailure.AWAY,
    "57P02": DatabaseFailure.AWAY,
    "57P03": DatabaseFailure.AWAY,
}
"""By SQLSTATE (PostgreSQL, Appendix A)."""


class PostgreSQLDialect:
    """A database of a server; files of the home stay in the home."""

    name = "PostgreSQL"
    no_fault = "PostgreSQL looks after its own files, and lets no reference be lost"
    restoring = "Stop the server, and restore the database with pg_restore: docs/operations.md."
    is_file = False

    def make_engine(self, settings: Settings, *, lasting: bool = True) -> Engine:
        """See ``Dialect``."""
        try:
            engine = create_engine(
                _parse_psycopg_url(settings.database),
                # A server that was started again is found again.
                pool_pre_ping=True,
                # One at a time writes what need not last.
                pool_size=16 if lasting else 1,
                max_overflow=16 if lasting else 1,
                # What a statement carries may be somebody's password.
                hide_parameters=True,
            )
        except (ImportError, NoSuchModuleError) as error:
            raise InputError(
                "the PostgreSQL driver is not installed",
                hint="Run pip install 'touchline[postgres]', or leave TOUCHLINE_DATABASE_URL unset.",
            ) from error
        dialect: Any = engine.dialect
        dialect.statement_compiler = StatementCompiler
        dialect.ddl_compiler = ColumnCompiler
        dialect.type_compiler_instance = TypeCompiler(dialect)
        event.listen(engine, "connect", partial(_set_up_connection, lasting))
        event.listen(engine, "begin", _begin_transaction)
        _close_connections_after_disposal(engine)
        return engine

    def reading(self, engine: Engine) -> Engine:
        """See ``Dialect``."""
        return engine.execution_options(isolation_level="REPEATABLE READ", postgresql_readonly=True)

    def autocommit_engine(self, engine: Engine) -> Engine:
        """See ``Dialect``."""
        return engine.execution_options(**AUTOCOMMIT, isolation_level="AUTOCOMMIT")

    def nonblocking_engine(self, settings: Settings) -> None:
        """See ``Dialect``."""

    def sharing(self, engine: Engine, reported: Reported) -> ProcessCoordinator:
        """See ``Dialect``."""
        return PostgreSQLCoordinator(engine, reported)

    def require_supported_configuration(self, engine: Engine) -> None:
        """See ``Dialect``."""
        with engine.connect() as connection:
            show = connection.exec_driver_sql
            version = int(show("SHOW server_version_num").scalar_one()) // 10_000
            if version < MIN_SERVER:
                raise StorageError(
                    f"PostgreSQL {version} is too old", hint=f"Use version {MIN_SERVER} or newer."
                )
            if show("SHOW server_encoding").scalar_one() != "UTF8":
                raise StorageError(
                    "the encoding of the database is not UTF-8",
                    hint="Create it with ENCODING 'UTF8' TEMPLATE template0.",
                )

    def failure(self, error: DBAPIError) -> tuple[DatabaseFailure, str]:
        """See ``Dialect``."""
        state = str(getattr(error.orig, "sqlstate", None) or "")
        if error.connection_invalidated or state.startswith("08"):
            return DatabaseFailure.AWAY, state
        # Nobody answered, so nobody said why.
        if not state and isinstance(error, OperationalError):
            return DatabaseFailure.AWAY, state
        # The driver itself refuses U+0000, which no text of the server can hold.
        if not state and isinstance(error, DataError):
            return DatabaseFailure.TEXT, state
        # Who we are (28) and what there is (3D) is asked before anything else.
        if state.startswith(("28", "3D")):
            return DatabaseFailure.AWAY, state
        return _FAILURES.get(state, DatabaseFailure.OTHER), state

    @contextmanager
    def interrupt_when(self, session: Session, ends: Callable[[], bool]) -> Iterator[None]:
        """See ``Dialect``; a thread looks, for the driver waits for the server meanwhile."""
        driver: Any = session.connection.driver_connection
        done = threading.Event()

        def cancel_when_ended() -> None:
            while not done.wait(LOOK_SECONDS):
                if ends():
                    driver.cancel_safe()
                    return

        watcher = threading.Thread(target=cancel_when_ended, name="postgresql-watcher", daemon=True)
        watcher.start()
        try:
            yield
        except OperationalError:
            if not ends():
                raise
        finally:
            done.set()
            watcher.join()

    @contextmanager
    def migration_context(self, connection: Connection, *, new: bool) -> Iterator[None]:
        """See ``Dialect``: what is written for SQLite is said in PostgreSQL's words."""

        def translate(
            _connection: Any, cursor: Any, statement: str, parameters: Any, *_: Any
        ) -> tuple[str, Any]:
            return adapt_sqlite_statement(cursor, statement, new=new), parameters

        event.listen(connection, "before_cursor_execute", translate, retval=True)
        try:
            yield
        finally:
            event.remove(connection, "before_cursor_execute", translate)

    def settle(self, connection: Connection, tables: Sequence[Table], key: str) -> None:
        """See ``Dialect``."""
        for table in tables:
            if table.autoincrement_column is not None:
                name = table.name
                connection.exec_driver_sql(
                    f"SELECT setval(pg_get_serial_sequence('{name}', 'id'), coalesce(max(id), 1),"
                    f' max(id) IS NOT NULL) FROM "{name}"'
                )

    def find_file_faults(
        self, session: Session, most: int = 5, *, thorough: bool = False
    ) -> list[str]:
        """See ``Dialect``; a server looks after its own files."""
        return []

    def count_lost_references(self, session: Session) -> int:
        """See ``Dialect``; constraints are always checked here."""
        return 0


DIALECT = PostgreSQLDialect()


def _parse_psycopg_url(url: str) -> URL:
    """The URL for psycopg, with the promises of ``KEEPALIVE`` where it has none of its own.

    Raises:
        InputError: It is none; what it says is not repeated, for it holds a password.
    """
    try:
        parsed = make_url(url).set(drivername="postgresql+psycopg")
        promised = {f"keepalives_{name}": str(number) for name, number in KEEPALIVE.items()}
        promised["tcp_user_timeout"] = str(GONE_SECONDS * 1000)
        return parsed.set(query={**promised, **parsed.query})
    except (ArgumentError, ValueError) as error:
        # Without its cause, which repeats what it was given.
        del error
    raise InputError(
        "TOUCHLINE_DATABASE_URL is not a URL",
        hint="Write it as postgresql://USER:PASSWORD@HOST/DATABASE; characters such as @ and / in"
        " the password are written as %40 and %2F.",
    )


def _set_up_connection(lasting: bool, connection: Any, _record: object) -> None:
    from psycopg.types.numeric import FloatLoader

    # Sums of whole numbers are numeric, and Decimal in Python; SQLite's are int.
    class _NumericLoader(FloatLoader):
        def load(self, data: Any) -> Any:
            text = bytes(data)
            return int(text) if text.lstrip(b"-").isdigit() else float(text)

    connection.adapters.register_loader("numeric", _NumericLoader)
    was, connection.autocommit = connection.autocommit, True
    # With ``off`` a power cut loses acknowledged edits.
    connection.execute(f"SET synchronous_commit = {'on' if lasting else 'off'}")
    connection.execute(f"SET lock_timeout = '{LOCK_SECONDS}s'")
    connection.execute("SET TIME ZONE 'UTC'")
    # For the server's end of the connection; the URL says it for this one.
    for name, number in KEEPALIVE.items():
        connection.execute(f"SET tcp_keepalives_{name} = {number}")
    connection.execute(f"SET tcp_user_timeout = '{GONE_SECONDS}s'")
    connection.autocommit = was


def _close_connections_after_disposal(engine: Engine) -> None:
    """Close what a thread gives back after the engine was disposed of: no pool would."""
    disposals = 0

    def count_disposal(_engine: Engine) -> None:
        nonlocal disposals
        disposals += 1

    def tag_connection(_connection: Any, record: Any) -> None:
        record.info["disposals"] = disposals

    def invalidate_stale_connection(_connection: Any, record: Any) -> None:
        if record.info.get("disposals", disposals) != disposals:
            record.invalidate()

    event.listen(engine, "engine_disposed", count_disposal)
    event.listen(engine, "connect", tag_connection)
    event.listen(engine, "checkin", invalidate_stale_connection)


def _begin_transaction(connection: Connection) -> None:
    """Wait for the write lock: only then the first statement of a writer takes its snapshot."""
    if connection.get_execution_options().get("touchline_write", False):
        connection.exec_driver_sql(f"SELECT pg_advisory_xact_lock({WRITE_LOCK})")
