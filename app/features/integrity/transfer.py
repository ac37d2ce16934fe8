"""A whole database copied into another one, of either engine, and compared with it."""

from __future__ import annotations

import hashlib
import re
import shutil
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import ExitStack, closing
from dataclasses import dataclass
from itertools import islice
from pathlib import Path
from typing import Any

from sqlalchemy import (
    Connection,
    Engine,
    LargeBinary,
    String,
    Table,
    cast,
    func,
    insert,
    inspect,
    literal,
    select,
    text,
)

from app.config import Settings
from app.db.dialects.dialect import (
    WRITE,
    Dialect,
    get_dialect,
    get_session_dialect,
    make_engine,
    translate_storage_errors,
)
from app.db.home import create_private_file
from app.db.locks import hold_exclusive_database_lock, hold_server_lock
from app.db.log import verify_chain
from app.db.migrate import UNFINISHED, apply_missing_migrations, read_schema_revision
from app.db.recovery.anchor import compute_anchor_from_database
from app.db.recovery.preopen_check import require_database
from app.db.session import Session
from app.db.store import Store
from app.durable import read_private_file
from app.errors import DamagedError, InputError
from app.features.tables import Base
from app.wording import plural

_PASSWORD = re.compile(r"://[^:/@]*:[^@]*@|[?&]password=")
"""In the address of a database, as its driver reads it."""


def make_settings_of_both_databases(
    source: str, target: str, settings: Settings
) -> tuple[Settings, Settings]:
    """Settings of the database that is copied, and of the one that it is copied to.

    Args:
        source: A home folder, the address of a database, or a file that holds one.
        target: The same.
        settings: Everything else.

    Raises:
        InputError: An address has a password that everybody could read, others than its owner may
            use a file, or it holds no address.
    """
    begin = _database_settings(source, "FROM", settings)
    # The files of a home that goes into a database stay in that home.
    into = settings if _resolve_database_url(target, "TO") is None else begin
    return begin, _database_settings(target, "TO", into)


def _database_settings(place: str, name: str, settings: Settings) -> Settings:
    address = _resolve_database_url(place, name)
    if address is not None:
        return settings.model_copy(update={"database_url": address})
    return settings.model_copy(update={"home": Path(place).absolute(), "database_url": None})


def _resolve_database_url(place: str, name: str) -> str | None:
    """The address that an argument is, or that the file holds which it names; None: it is a home."""
    if "://" in place:
        if _PASSWORD.search(place):
            raise InputError(
                f"everybody on this machine can read the password in {name} while this runs",
                hint="Write the address into a file, chmod 600 it, and name that file instead.",
            )
        return place
    file = Path(place)
    if not file.is_file():
        return None
    address = read_private_file(file, name)
    if "://" not in address:
        raise InputError(
            f"{file} contains no address of a database",
            hint="Write postgresql://USER:PASSWORD@HOST/DATABASE into it, or name a home folder.",
        )
    return address


NULL_CHARACTER, REPLACEMENT = "\0", "\ufffd"


@dataclass(frozen=True)
class TextWithNullCharacter:
    """A text of the database that holds U+0000.

    Attributes:
        table: Name of the table.
        key: Primary key of the row, by column.
        column: Name of the column.
        text: What stands there.
    """

    table: str
    key: Mapping[str, Any]
    column: str
    text: str

    def __str__(self) -> str:
        key = " ".join(f"{name}={value}" for name, value in self.key.items())
        return f"{self.table} {key} column {self.column}"


def find_null_characters(session: Session) -> list[TextWithNullCharacter]:
    """Every text of the database that holds U+0000, by table and column; none on PostgreSQL."""
    if not get_session_dialect(session).is_file:
        return []
    found = []
    for table in Base.metadata.sorted_tables:
        keys = list(table.primary_key.columns)
        for column in table.columns:
            if not isinstance(column.type, String):
                continue
            # Functions of SQLite on text end at U+0000; those on bytes do not.
            has_it = func.instr(cast(column, LargeBinary), literal(b"\0", LargeBinary)) > 0
            for row in session.execute(select(*keys, column.label("text_")).where(has_it)):
                values = dict(row._mapping)
                text = values.pop("text_")
                key = {name: values.get(name, text) for name in (item.name for item in keys)}
                found.append(TextWithNullCharacter(table.name, key, column.name, str(text)))
    return found


def replace_null_characters(row: Mapping[str, Any]) -> dict[str, Any]:
    """A row whose texts have U+FFFD, the replacement character, where they had U+0000."""
    return {
        name: value.replace(NULL_CHARACTER, REPLACEMENT) if isinstance(value, str) else value
        for name, value in row.items()
    }


def format_null_characters(found: Sequence[TextWithNullCharacter], most: int = 5) -> str:
    """Rows and columns as a sentence lists them."""
    return ", ".join(map(str, found[:most])) + (" and others" if len(found) > most else "")


_BATCH = 500
_INSTALLATION, _VERSION, _MARKS = "installation", "version", "group_change"
_REVISION = text("UPDATE alembic_version SET version_num = :revision")


@dataclass(frozen=True)
class TransferResult:
    """What a transfer came to.

    Attributes:
        rows: Rows by table, in both.
        copied: How many of them this run has copied; the others an earlier one had.
        entries: Length of the log, whose hash chain was followed in the target.
        versions: Hash of each frozen version, by dataset and name.
    """

    rows: dict[str, int]
    copied: int
    entries: int
    versions: dict[str, str]


def transfer_database(
    source: Settings,
    target: Settings,
    tell: Callable[[str, int], None] = lambda *_: None,
    *,
    replace_null: bool = False,
) -> TransferResult:
    """Copy a database into an empty one, or go on with a copy that was stopped.

    Args:
        source: What is copied; no server may run on its home.
        target: Where to.
        tell: Told the name of each table, and how many rows of it have been copied.
        replace_null: Write U+FFFD where texts of the source hold U+0000.

    Raises:
        InputError: They are the same, the source has no database, the target holds something else, or texts of the source
            hold U+0000 and are not to be replaced.
        StorageError: A server runs, or one of them cannot be read or written.
        DamagedError: The source is damaged, or the copy is not equal to it.
    """
    if source.database == target.database:
        raise InputError(
            "source and target are the same database", hint="Name a target other than the source."
        )
    if get_dialect(source).is_file:
        require_database(source, "Name the home folder of an installation as FROM.")
    dialect = get_dialect(target)
    with ExitStack() as held:
        held.enter_context(hold_server_lock(source))
        if target.home != source.home:
            held.enter_context(hold_server_lock(target))
        store = held.enter_context(closing(Store.open(source)))
        if dialect.is_file:
            held.enter_context(
                hold_exclusive_database_lock(target, "nothing can be copied into it")
            )
            create_private_file(target.database_file)
        engine = make_engine(target)
        held.callback(engine.dispose)
        held.enter_context(translate_storage_errors(target))
        # Before the source is read: what goes wrong in there is told as the source's.
        dialect.require_supported_configuration(engine)
        with store.read() as session:
            writer = engine.execution_options(**WRITE)
            if not replace_null and (found := find_null_characters(session)):
                raise _null_character_error(found)
            return _copy_all_tables(session, writer, dialect, target.yields, tell)


def _null_character_error(found: Sequence[TextWithNullCharacter]) -> InputError:
    count = plural(len(found), "text holds", "texts hold")
    return InputError(
        f"{count} the character U+0000, which this version of Touchline no longer stores:"
        f" {format_null_characters(found)}",
        hint="Run touchline transfer with --replace-null: it replaces the character with U+FFFD.",
    )


def _copy_all_tables(
    session: Session,
    target: Engine,
    dialect: Dialect,
    yields: Path,
    tell: Callable[[str, int], None],
) -> TransferResult:
    anchor = compute_anchor_from_database(session)
    if anchor is None:
        raise InputError(
            "the source database has no complete Touchline schema",
            hint="Run touchline migrate on the source, or name another source.",
        )
    _prepare_target(target, dialect, anchor.installation)
    copied = 0
    for tables in _group_tables_by_transaction():
        copied += _copy_tables(session, target, tables, tell)
    with Session(target) as copy:
        rows = _require_equal_rows(session, copy)
        entries = _require_same_log_chain(copy, anchor.entries, anchor.hash)
        dialect.settle(copy, _tables_to_copy(), anchor.installation)
        # Their marks are those of the changes of another database.
        shutil.rmtree(yields, ignore_errors=True)
        copy.execute(_REVISION, {"revision": anchor.schema})
        versions = _version_hashes(copy)
        copy.commit()
    return TransferResult(rows, copied, entries, versions)


def _prepare_target(target: Engine, dialect: Dialect, installation: str) -> None:
    """Make an empty schema that says that it is unfinished; or see that it is one of ours.

    Raises:
        InputError: The target is in use.
    """
    revision = read_schema_revision(target)
    if revision is None:
        with target.connect() as connection:
            if inspect(connection).get_table_names():
                raise InputError(
                    "the target database contains tables of another program", hint=_EMPTY
                )
        apply_missing_migrations(target, dialect, new=True)
        with target.begin() as connection:
            connection.execute(text("DELETE FROM installation"))
            connection.execute(_REVISION, {"revision": UNFINISHED})
        return
    with target.connect() as connection:
        keys = list(connection.execute(text("SELECT key FROM installation")).scalars())
    if revision != UNFINISHED or keys not in ([], [installation]):
        raise InputError("Touchline already uses the target database", hint=_EMPTY)


_EMPTY = "Name a database without tables, or a home that does not exist yet."


def _tables_to_copy() -> list[Table]:
    """What is copied; marks of changes are made by the target's own triggers."""
    return [table for table in Base.metadata.sorted_tables if table.name != _MARKS]


def _group_tables_by_transaction() -> Iterator[list[Table]]:
    """Tables after those that they refer to; the groups of versions with these, which seal them."""
    together = [
        table for table in _tables_to_copy() if table.name in (f"{_VERSION}_group", _VERSION)
    ]
    together.sort(key=lambda table: table.name == _VERSION)
    # Whose it is first: then a target of another installation is known.
    yield [Base.metadata.tables[_INSTALLATION]]
    for table in _tables_to_copy():
        if table.name == _VERSION:
            yield together
        elif table not in together and table.name != _INSTALLATION:
            yield [table]


def _copy_tables(
    session: Session, target: Engine, tables: Sequence[Table], tell: Callable[[str, int], None]
) -> int:
    """Copy what is missing of tables; several go over in one transaction."""
    copied = 0
    with ExitStack() as held:
        connection = held.enter_context(target.connect())
        for table in tables:
            # Rows went over in this order: so many of the first ones are there.
            present = connection.execute(select(func.count()).select_from(table)).scalar_one()
            rows = iter(_read_rows(session, table, present))
            while batch := list(islice(rows, _BATCH)):
                connection.execute(insert(table), batch)
                copied += len(batch)
                if len(tables) == 1:
                    connection.commit()
                tell(table.name, present + copied)
        connection.commit()
    return copied


def _read_rows(connection: Connection, table: Table, after: int = 0) -> Iterator[dict[str, Any]]:
    """The rows of a table by key, a few at a time; by the keys of its columns, as ``insert`` takes them."""
    statement = select(table).order_by(*table.primary_key.columns).offset(after)
    found = connection.execute(statement, execution_options={"yield_per": _BATCH})
    for row in found:
        yield replace_null_characters(dict(zip(table.columns.keys(), row, strict=True)))


def _require_equal_rows(session: Session, connection: Connection) -> dict[str, int]:
    """Rows by table, where every row of the copy is that of the source."""
    counts = {}
    for table in _tables_to_copy():
        ours, theirs = _digest_rows(connection, table), _digest_rows(session, table)
        if ours != theirs:
            raise DamagedError(
                f"table {table.name} of the copy differs from the source: it has {ours[0]:,} rows,"
                f" the source {theirs[0]:,}",
                hint="Empty the target and run touchline transfer again.",
            )
        counts[table.name] = ours[0]
    return counts


def _digest_rows(connection: Connection, table: Table) -> tuple[int, str]:
    """How many rows there are, and a digest of their values in order."""
    count, digest = 0, hashlib.sha256()
    for row in _read_rows(connection, table):
        count += 1
        digest.update(repr(list(row.values())).encode())
    return count, digest.hexdigest()


def _require_same_log_chain(session: Session, entries: int, last: str) -> int:
    count = verify_chain(session)
    found = session.execute(text("SELECT hash FROM log WHERE id = :id"), {"id": entries})
    if count != entries or (found.scalar() or "") != last:
        raise DamagedError(
            "the copied log differs from the log of the source: in the number of entries, or in the last one"
        )
    return count


def _version_hashes(connection: Connection) -> dict[str, str]:
    statement = text(
        "SELECT dataset.name AS dataset, version.name AS name, version.hash AS hash FROM version"
        " JOIN dataset ON dataset.id = version.dataset_id ORDER BY version.id"
    )
    return {f"{row.dataset}/{row.name}": row.hash for row in connection.execute(statement)}
