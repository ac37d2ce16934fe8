"""What the product asks of a database engine that SQLite and PostgreSQL do differently, its connections, and
what it refuses as a sentence.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import AbstractContextManager, contextmanager
from enum import Enum
from importlib import import_module
from typing import Any, Protocol, cast

from sqlalchemy import (
    Connection,
    Engine,
    Executable,
    Integer,
    LargeBinary,
    Select,
    String,
    Table,
    bindparam,
    select,
)
from sqlalchemy.dialects.postgresql import Insert
from sqlalchemy.dialects.postgresql import insert as _insert
from sqlalchemy.exc import DBAPIError, OperationalError
from sqlalchemy.ext.compiler import compiles
from sqlalchemy.sql.elements import ClauseElement
from sqlalchemy.sql.expression import TableValuedAlias
from sqlalchemy.sql.functions import FunctionElement

from app.config import Settings
from app.db.session import Session
from app.errors import EXAMINE, BusyError, DamagedError, InputError, StorageError
from app.json_text import json_text

Hearer = Callable[[str], None]
ALL_CHANGED = ""
"""The notification after a lost connection: anything may have changed meanwhile."""


class ProcessCoordinator(Protocol):
    """What a process knows of the others.

    Attributes:
        is_shared: Whether other processes may serve the same database.
    """

    is_shared: bool

    def claim(self, name: str) -> bool:
        """Claim something; False where another process, or this one, has it. Waits for nobody.

        Raises:
            StorageError: The database cannot be asked.
        """

    def holds(self, name: str) -> bool:
        """Whether a claim of this process still stands."""

    def release(self, name: str) -> None:
        """End a claim; one that is lost already is none."""

    def publish(self, session: Session, word: str) -> None:
        """Say a word to the others once a transaction is kept."""

    def subscribe(self, hearer: Hearer) -> None:
        """Call a function with what others say, once ``listen`` was called; it must be quick."""

    def listen(self) -> None:
        """Begin to listen, on a thread of its own."""

    def close(self) -> None:
        """End all claims, and stop listening."""


class SingleProcessCoordinator:
    """The one server of a database: everything is its own, and nobody listens."""

    is_shared = False

    def claim(self, name: str) -> bool:
        """See ``ProcessCoordinator``."""
        return True

    def holds(self, name: str) -> bool:
        """See ``ProcessCoordinator``."""
        return True

    def release(self, name: str) -> None:
        """See ``ProcessCoordinator``."""

    def publish(self, session: Session, word: str) -> None:
        """See ``ProcessCoordinator``."""

    def subscribe(self, hearer: Hearer) -> None:
        """See ``ProcessCoordinator``."""

    def listen(self) -> None:
        """See ``ProcessCoordinator``."""

    def close(self) -> None:
        """See ``ProcessCoordinator``."""


WRITE = {"touchline_write": True}
"""Options of an engine whose transactions take the write lock at their start."""
AUTOCOMMIT = {"touchline_glance": True}
"""Options of an engine that begins no transactions: each statement is one."""


def unstorable_text_error() -> InputError:
    """What is said of a text that one of the databases cannot keep; both refuse it."""
    return InputError(
        "a text contains a character that the database cannot store, such as U+0000",
        hint="Remove the character.",
    )


class DatabaseFailure(Enum):
    """Why a database did not do what it was asked."""

    FULL = "full"
    BUSY = "busy"
    DAMAGED = "damaged"
    UNREADABLE = "unreadable"
    DISK = "disk"
    AWAY = "away"
    TEXT = "text"
    OTHER = "other"


class Dialect(Protocol):
    """What each engine of databases does in its own way.

    Attributes:
        name: What people call it.
        no_fault: What is said of a database without a fault.
        restoring: How a copy is put into the place of a database, as a sentence.
        is_file: Whether the database is a file, which is looked at before it is opened and copied
            as a whole, and lies in the home.
    """

    name: str
    no_fault: str
    restoring: str
    is_file: bool

    def make_engine(self, settings: Settings, *, lasting: bool = True) -> Engine:
        """An engine whose connections keep our promises and begin transactions as told.

        Args:
            settings: Where the database is.
            lasting: False: what its transactions write may be lost in a power cut, as a whole.

        Raises:
            InputError: The URL is none, or the driver is not installed.
            StorageError: The library is too old.
        """

    def reading(self, engine: Engine) -> Engine:
        """The same engine for transactions that see one snapshot and keep nothing."""

    def autocommit_engine(self, engine: Engine) -> Engine:
        """The same engine without transactions: each statement is one, and sees one snapshot."""

    def nonblocking_engine(self, settings: Settings) -> Engine | None:
        """An engine without transactions whose one connection never waits; None where each statement
        has to, because the database is reached over a network."""

    def sharing(
        self, engine: Engine, reported: Callable[[], AbstractContextManager[None]]
    ) -> ProcessCoordinator:
        """What processes with this database say to each other; ``reported`` names what fails."""

    def require_supported_configuration(self, engine: Engine) -> None:
        """Raise StorageError where the database does not keep what we promise."""

    def failure(self, error: DBAPIError) -> tuple[DatabaseFailure, str]:
        """Why a statement failed, and the engine's name for it."""

    def interrupt_when(
        self, session: Session, ends: Callable[[], bool]
    ) -> AbstractContextManager[None]:
        """End what the database is at, and what is done here, once a function says so."""

    def migration_context(
        self, connection: Connection, *, new: bool
    ) -> AbstractContextManager[None]:
        """Run migrations; ``new``: of a database that is empty."""

    def settle(self, connection: Connection, tables: Sequence[Table], key: str) -> None:
        """Count ids on from rows that were copied, and belong to the installation of a key."""

    def find_file_faults(
        self, session: Session, most: int = 5, *, thorough: bool = False
    ) -> list[str]:
        """What is wrong with pages and indexes of the file, each a line; a server looks after its own.

        Args:
            session: Any.
            most: Lines; SQLite may fail altogether where it goes on after the first.
            thorough: Compare each index with its table, too, which takes several times as long.
        """

    def count_lost_references(self, session: Session) -> int:
        """How many rows refer to rows that are gone."""


_MODULES = {"sqlite": "sqlite", "postgresql": "postgresql", "postgres": "postgresql"}


def get_dialect(settings: Settings) -> Dialect:
    """How the database of a home is spoken to.

    Raises:
        InputError: The URL is neither one of SQLite nor of PostgreSQL.
    """
    kind = settings.database.partition(":")[0].partition("+")[0]
    if kind not in _MODULES:
        raise InputError(
            "only SQLite and PostgreSQL databases are supported",
            hint="Set TOUCHLINE_DATABASE_URL to postgresql://USER:PASSWORD@HOST/DATABASE, or leave"
            " it unset.",
        )
    return _load_dialect(_MODULES[kind])


def get_session_dialect(session: Session) -> Dialect:
    """How the database of a session is spoken to."""
    return _load_dialect(session.dialect.name)


def _load_dialect(name: str) -> Dialect:
    # Only the one that is used is imported: a driver takes its time.
    return cast(Dialect, import_module(f"app.db.dialects.{name}").DIALECT)


def require_multiprocess_support(settings: Settings, count: int) -> None:
    """Refuse several processes where the database is a file of one.

    Raises:
        InputError: It is.
    """
    if count > 1 and get_dialect(settings).is_file:
        raise InputError(
            "several server processes need a PostgreSQL database, and this database is an"
            " SQLite file",
            hint="Leave out --workers (TOUCHLINE_WEB_WORKERS), or set TOUCHLINE_DATABASE_URL:"
            " docs/operations.md.",
        )


def make_engine(settings: Settings, *, lasting: bool = True) -> Engine:
    """An engine whose connections keep our promises and begin transactions as told.

    Args:
        settings: Where the database is.
        lasting: False: what its transactions write may be lost in a power cut.

    Raises:
        InputError: The URL is neither one of SQLite nor of PostgreSQL.
    """
    return get_dialect(settings).make_engine(settings, lasting=lasting)


@contextmanager
def translate_storage_errors(settings: Settings, *, committing: bool = False) -> Iterator[None]:
    """Turn what the disk or the database refuses into a ``StorageError`` with a sentence.

    A text that no database of its kind can hold is the caller's: an ``InputError``. ``committing``: the
    database may have kept a change before it could no longer be reached.
    """
    try:
        yield
    except DBAPIError as error:
        kind, name = get_dialect(settings).failure(error)
        if committing and kind is DatabaseFailure.AWAY:
            raise StorageError(
                f"the connection to {settings.database_name} was lost while a change was being saved:"
                " it is not known whether it was",
                hint="Load the current state, and make the change again if it is not there.",
            ) from error
        if kind is DatabaseFailure.TEXT:
            raise unstorable_text_error() from error
        if kind is not DatabaseFailure.OTHER or isinstance(error, OperationalError):
            raise _storage_error(error, kind, name, settings) from error
        raise StorageError(
            "the database could not carry out the request", hint="Nothing was saved. Try again."
        ) from error


def _storage_error(
    error: DBAPIError, kind: DatabaseFailure, name: str, settings: Settings
) -> StorageError:
    file = settings.database_name
    if kind is DatabaseFailure.FULL:
        return StorageError(
            "the disk is full: the change was not saved, everything before it is safe",
            hint="Free some space and send the change again.",
        )
    if kind is DatabaseFailure.BUSY:
        return BusyError(
            "another process is writing; the change was not saved", hint="Try again in a moment."
        )
    if kind is DatabaseFailure.DAMAGED:
        return DamagedError(f"{file} is damaged or not a database", hint=EXAMINE)
    if kind is DatabaseFailure.UNREADABLE:
        return StorageError(
            f"{file} cannot be read and written ({name})",
            hint="Make the home folder and its files writable, or set TOUCHLINE_HOME to another.",
        )
    if kind is DatabaseFailure.DISK:
        return StorageError(
            f"the disk does not read or write {file} ({name})",
            hint="Free space on the disk; touchline doctor reports how much is left.",
        )
    if kind is DatabaseFailure.AWAY:
        return StorageError(
            f"{file} cannot be reached" + (f" ({name})" if name else ""),
            hint="Is the server of the database running, and are TOUCHLINE_DATABASE_URL's host,"
            " database, user and password right? Nothing was saved.",
        )
    return StorageError(f"the database rejected a statement ({name or type(error).__name__})")


def insert(model: Any) -> Insert:
    """An INSERT that can say ON CONFLICT; both engines write it alike."""
    return _insert(model)


def insert_or_replace(model: Any) -> Insert:
    """An INSERT of rows in the place of those with the same key."""
    table = cast(Table, getattr(model, "__table__", model))
    statement = _insert(model)
    keys = list(table.primary_key.columns)
    changed = {item.name: statement.excluded[item.name] for item in table.c if item not in keys}
    return statement.on_conflict_do_update(index_elements=keys, set_=changed)


def select_from_number_list(ids: Iterable[int]) -> Select[Any]:
    """Some numbers as a question: one parameter, however many there are, for a statement takes a
    limited number of them."""
    return _select_from_json_numbers(json_text(list(ids)))


def select_from_number_parameter(name: str) -> Select[Any]:
    """As ``select_from_number_list``, in a statement that is made once: a parameter that is a JSON array."""
    return _select_from_json_numbers(bindparam(name, type_=String()))


def _select_from_json_numbers(array: Any) -> Select[Any]:
    listed = _JsonNumberRows(array).table_valued("value")
    return select(listed.c.value)


def select_from_text_list(values: Iterable[str]) -> Select[Any]:
    """Some texts as a question."""
    listed = select_json_array_items(json_text(list(values)))
    return select(listed.c.value)


def select_json_array_items(array: Any) -> TableValuedAlias:
    """Rows (key, value) of a JSON array of texts in a text; keys count from 0."""
    return _JsonArrayRows(array).table_valued("key", "value")


def select_json_object_values(mapping: Any) -> TableValuedAlias:
    """Rows (value) of a JSON object whose values are texts, in a text."""
    return _JsonObjectValueRows(mapping).table_valued("value")


class _JsonNumberRows(FunctionElement[Any]):
    inherit_cache = True
    type = Integer()


class _JsonArrayRows(FunctionElement[Any]):
    inherit_cache = True


class _JsonObjectValueRows(FunctionElement[Any]):
    inherit_cache = True


class json_member(FunctionElement[str]):  # noqa: N801 - written like SQLAlchemy's functions
    """The text under a name in a JSON object in a text: ``member(column, "name")``."""

    inherit_cache = True
    type = String()

    def __init__(self, column: Any, name: str):
        super().__init__(column, f"$.{name}")


class larger_of(FunctionElement[Any]):  # noqa: N801 - written like SQLAlchemy's functions
    """The larger of two values that are there."""

    inherit_cache = True
    type = Integer()


class any_value_of(FunctionElement[bytes]):  # noqa: N801 - written like SQLAlchemy's functions
    """One of the bytes of each group of rows, which have all the same."""

    inherit_cache = True
    type = LargeBinary()


class json_pairs_of(FunctionElement[str]):  # noqa: N801 - written like SQLAlchemy's functions
    """The pairs of two columns of all rows, as a JSON array of arrays in a text."""

    inherit_cache = True
    type = String()


class DeferReferences(Executable, ClauseElement):
    """Until the transaction ends, rows may refer to rows that are not there yet."""

    inherit_cache = True


@compiles(_JsonNumberRows)
@compiles(_JsonArrayRows)
@compiles(_JsonObjectValueRows)
def _compile_json_each(element: Any, compiler: Any, **kw: Any) -> str:
    return f"json_each({compiler.process(element.clauses, **kw)})"


@compiles(_JsonNumberRows, "postgresql")
def _compile_json_numbers(element: Any, compiler: Any, **kw: Any) -> str:
    json = compiler.process(element.clauses, **kw)
    return (
        "(SELECT CAST(item AS BIGINT) AS value"
        f" FROM jsonb_array_elements_text(CAST({json} AS JSONB)) AS item)"
    )


@compiles(_JsonArrayRows, "postgresql")
def _compile_json_array(element: Any, compiler: Any, **kw: Any) -> str:
    json = compiler.process(element.clauses, **kw)
    return (
        "LATERAL (SELECT place - 1 AS key, item AS value"
        f" FROM jsonb_array_elements_text(CAST({json} AS JSONB))"
        " WITH ORDINALITY AS listed(item, place))"
    )


@compiles(_JsonObjectValueRows, "postgresql")
def _compile_json_object_values(element: Any, compiler: Any, **kw: Any) -> str:
    json = compiler.process(element.clauses, **kw)
    return f"LATERAL (SELECT pair.value FROM jsonb_each_text(CAST({json} AS JSONB)) AS pair)"


@compiles(json_member, "postgresql")
def _compile_json_member(element: Any, compiler: Any, **kw: Any) -> str:
    column, path = element.clauses
    column, path = compiler.process(column, **kw), compiler.process(path, **kw)
    return f"(CAST({column} AS JSONB) ->> substr({path}, 3))"


def _register_sql_template(kind: type[ClauseElement], form: str, *engine: str) -> None:
    """Have an element written in a form, whose ``{}`` are its arguments."""

    @compiles(kind, *engine)
    def compile_from_template(element: Any, compiler: Any, **kw: Any) -> str:
        return form.format(compiler.process(element.clauses, **kw))


_register_sql_template(json_member, "json_extract({})")
_register_sql_template(larger_of, "max({})")
_register_sql_template(larger_of, "greatest({})", "postgresql")
_register_sql_template(any_value_of, "min({})")
_register_sql_template(any_value_of, "(array_agg({}))[1]", "postgresql")
_register_sql_template(json_pairs_of, "json_group_array(json_array({}))")
_register_sql_template(
    json_pairs_of, "CAST(coalesce(json_agg(json_build_array({})), '[]') AS TEXT)", "postgresql"
)


@compiles(DeferReferences)
def _compile_deferral_for_sqlite(_element: Any, _compiler: Any, **_: Any) -> str:
    return "PRAGMA defer_foreign_keys = ON"


@compiles(DeferReferences, "postgresql")
def _compile_deferral_for_postgresql(_element: Any, _compiler: Any, **_: Any) -> str:
    return "SET CONSTRAINTS ALL DEFERRED"
