"""The databases that tests run on: a file of SQLite, and one of a private PostgreSQL."""

from __future__ import annotations

import os
import shutil
import subprocess
from collections.abc import Collection, Iterator
from contextlib import closing, contextmanager, nullcontext
from pathlib import Path
from typing import Any, Protocol

import pysqlite3.dbapi2 as sqlite
import pytest
from sqlalchemy import Connection, event, inspect, select

from app.config import Settings
from app.db.dialects.dialect import WRITE, get_dialect, get_session_dialect, make_engine
from app.db.idempotency import StoredResponseModel
from app.db.session import Session
from app.db.store import Store
from app.features.tables import Base
from tests.cluster import ADVICE, Cluster, find_programs, running_cluster
from tests.on_postgresql import shared_cluster

SQLITE, POSTGRESQL = "sqlite", "postgresql"
_KEPT = ("installation", "alembic_version")
"""Tables whose rows are there before anything is said."""


def databases_of(file: str, on_both: Collection[str], when_all: Collection[str]) -> list[str]:
    """Names of the databases that a file's tests run on.

    TOUCHLINE_TEST_DATABASES names others; ``all``: both, for files that do so when asked.
    """
    if shared_cluster() is not None:
        return [POSTGRESQL]
    named = os.environ.get("TOUCHLINE_TEST_DATABASES", "")
    if named not in ("", "all"):
        return named.split(",")
    return [SQLITE, POSTGRESQL] if file in (when_all if named else on_both) else [SQLITE]


class Databases(Protocol):
    """Makes databases of one kind, and puts back what was in them."""

    def settings(self, home: Path) -> Settings:
        """A home with an empty database; a server has one database, which is emptied."""

    def keep(self, store: Store) -> Any:
        """Remember what a database holds."""

    def put_back(self, store: Store, kept: Any) -> None:
        """Let it hold that again."""


class Files:
    """Databases of SQLite, each a file in its home."""

    def __init__(self, folder: Path):
        self._folder, self._count = folder, 0
        self._empty = folder / "touchline.db"

    def settings(self, home: Path) -> Settings:
        """See ``Databases``; copying a migrated file is faster than migrating for each test."""
        if not self._empty.exists():
            Store.open(Settings(home=self._folder)).close()
        home.mkdir()
        shutil.copy(self._empty, home / "touchline.db")
        return Settings(home=home)

    def keep(self, store: Store) -> Path:
        """See ``Databases``."""
        self._count += 1
        kept = self._folder / f"kept{self._count}.db"
        _copy(store.settings.database_file, kept)
        return kept

    def put_back(self, store: Store, kept: Path) -> None:
        """See ``Databases``."""
        # What the home knows of the database that was there before is not true of this one.
        store.settings.database_file.with_name("home.json").unlink(missing_ok=True)
        _copy(kept, store.settings.database_file)


def _copy(source: Path, target: Path) -> None:
    with closing(sqlite.connect(str(source))) as one, closing(sqlite.connect(str(target))) as two:
        one.backup(two)


class Server:
    """Databases of a PostgreSQL: one for each home at a time, emptied for the next."""

    def __init__(self, cluster: Cluster, folder: Path):
        self._cluster, self._count = cluster, 0
        url = cluster.create()
        Store.open(Settings(home=folder, database_url=url)).close()
        self._template = url
        # Asked once: who is connected to a database keeps it from being copied.
        with self._opened(url) as database:
            self._schema = database.execute(_SCHEMA).fetchall()
        self._urls: dict[str, str] = {}

    def settings(self, home: Path) -> Settings:
        """See ``Databases``."""
        url = self._urls.get(home.name)
        if url is None or not self._is_whole(url):
            url = self._urls[home.name] = self._cluster.create(like=self._template)
        with self._opened(url) as database:
            database.execute(_emptied(database))
        home.mkdir()
        return Settings(home=home, database_url=url)

    def new(self) -> str:
        """The URL of a database without tables."""
        return self._cluster.create()

    def keep(self, store: Store) -> str:
        """See ``Databases``."""
        self._count += 1
        name = f"kept{self._count}"
        with self._opened(store.settings.database) as database:
            made = [f"CREATE SCHEMA {name}"]
            for table in _tables(database):
                if database.execute(f"SELECT EXISTS (SELECT FROM {table})").fetchone()[0]:
                    made.append(f"CREATE TABLE {name}.{table} AS TABLE {table}")
            for (sequence,) in database.execute(_SEQUENCES):
                made.append(f"CREATE TABLE {name}.{sequence} AS TABLE {sequence}")
            database.execute("; ".join(made))
        return name

    def put_back(self, store: Store, kept: str) -> None:
        """See ``Databases``."""
        (store.settings.home / "home.json").unlink(missing_ok=True)
        with self._opened(store.settings.database) as database:
            put = [_emptied(database)]
            sequences = {name for (name,) in database.execute(_SEQUENCES)}
            for (table,) in database.execute(_OF_SCHEMA, [kept]):
                if table in sequences:
                    put.append(
                        f"SELECT setval('{table}', last_value, is_called) FROM {kept}.{table}"
                    )
                else:
                    put.append(f"INSERT INTO {table} TABLE {kept}.{table}")
            database.execute("; ".join(put))

    def _is_whole(self, url: str) -> bool:
        """Whether no test has changed triggers or said that the schema is another."""
        with self._opened(url) as database:
            return bool(database.execute(_SCHEMA).fetchall() == self._schema)

    @contextmanager
    def _opened(self, url: str) -> Iterator[Any]:
        import psycopg

        with psycopg.connect(url, autocommit=True) as database:
            # No trigger and no constraint: what was there before was right.
            database.execute("SET session_replication_role = replica")
            yield database


_OF_SCHEMA = "SELECT tablename FROM pg_tables WHERE schemaname = %s"
_SCHEMA = (
    "SELECT tgname, tgenabled::text FROM pg_trigger WHERE NOT tgisinternal"
    " UNION SELECT version_num, '' FROM alembic_version ORDER BY 1"
)
_OFF = (
    "SELECT DISTINCT tgrelid::regclass::text FROM pg_trigger"
    " WHERE NOT tgisinternal AND tgenabled = 'D'"
)
_SEQUENCES = "SELECT sequencename FROM pg_sequences WHERE schemaname = 'public'"


def _tables(database: Any) -> list[str]:
    found = [name for (name,) in database.execute(_OF_SCHEMA, ["public"])]
    return [name for name in found if name not in _KEPT]


def _emptied(database: Any) -> str:
    # What a test forbids ends with it.
    gone = ["DROP FUNCTION IF EXISTS spoils CASCADE"]
    gone += [f"ALTER TABLE {table} ENABLE TRIGGER USER" for (table,) in database.execute(_OFF)]
    gone += [f"DELETE FROM {table}" for table in _tables(database)]
    again = [
        f"SELECT setval('{name}', 1, false)" for (name,) in database.execute(_SEQUENCES).fetchall()
    ]
    return "; ".join((*gone, *again))


def count_rows(home: Path, *tables: str) -> dict[str, int]:
    """How many rows these tables of a home's database have, or all, beside whoever works in it."""
    engine = make_engine(Settings(home=home))
    try:
        with engine.connect() as connection:
            return {
                name: int(connection.exec_driver_sql(f'SELECT count(*) FROM "{name}"').scalar_one())
                for name in tables or inspect(connection).get_table_names()
            }
    finally:
        engine.dispose()


def all_that_is_kept(home: Path, *, but: Path | None = None) -> bytes:
    """The files of a home but one, and every row of its database where that is a server's.

    Another process reads them. A process that closes a file of a database ends its own locks on it: the
    next one that opens the database would cut off the memory that is shared here.
    """
    files = [path for path in home.iterdir() if path.is_file() and path != but]
    kept = [subprocess.run(["cat", *files], check=True, capture_output=True).stdout]
    settings = Settings(home=home)
    if not get_dialect(settings).is_file:
        engine = make_engine(settings)
        with engine.connect() as connection:
            for name in inspect(connection).get_table_names():
                rows = connection.exec_driver_sql(f'SELECT x::text FROM "{name}" AS x').scalars()
                kept += [str(row).encode() for row in rows]
        engine.dispose()
    return b"".join(kept)


@contextmanager
def holding_the_write_lock(home: Path) -> Iterator[Connection]:
    """A connection that writes to a home's database, and keeps everybody else from it."""
    engine = make_engine(Settings(home=home))
    try:
        with engine.execution_options(**WRITE).connect() as connection:
            connection.begin()
            yield connection
            connection.rollback()
    finally:
        engine.dispose()


@contextmanager
def said_for_sqlite(session: Session) -> Iterator[None]:
    """Statements of tests that are written for SQLite, where a database is another.

    A trigger that is dropped is off until the database is emptied.
    """
    dialect = get_session_dialect(session)
    if dialect.is_file:
        yield
        return
    event.listen(session, "before_cursor_execute", _translated, retval=True)
    try:
        with dialect.migration_context(session, new=False):
            yield
    finally:
        event.remove(session, "before_cursor_execute", _translated)


def _translated(
    _connection: Any, cursor: Any, statement: str, parameters: Any, *_: Any
) -> tuple[str, Any]:
    if statement.startswith("DROP TRIGGER "):
        name = statement.split()[-1]
        table = "SELECT tgrelid::regclass::text FROM pg_trigger WHERE tgname = %s"
        (found,) = cursor.execute(table, [name]).fetchone()
        statement = f"ALTER TABLE {found} DISABLE TRIGGER {name}"
    if statement == "PRAGMA defer_foreign_keys = ON":
        statement = "SET CONSTRAINTS ALL DEFERRED"
    statement = statement.replace("INSERT OR REPLACE ", "INSERT ")
    return statement.replace("x'00'", r"'\x00'::bytea"), parameters


@contextmanager
def opened_databases(kind: str, folder: Path) -> Iterator[Databases]:
    """The databases of a kind, for as long as the tests of a process run."""
    if kind == SQLITE:
        yield Files(folder)
        return
    if find_programs() is None:
        pytest.skip(ADVICE)
    shared = shared_cluster()
    with nullcontext(shared) if shared else running_cluster() as cluster:
        yield Server(cluster, folder)


def content(store: Store) -> dict[str, list[str]]:
    """Every row of the database but for the answers to requests."""
    tables = [
        table for table in Base.metadata.sorted_tables if table is not StoredResponseModel.__table__
    ]
    with store.read() as session:
        return {table.name: sorted(map(repr, session.execute(select(table)))) for table in tables}
