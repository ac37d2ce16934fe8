"""Upgrades: homes of every released schema, with something in every table, killed while they migrate.

A migration that was killed has not happened; done again it ends where one that nobody killed does,
and keeps every value that the new schema has room for.
"""

from __future__ import annotations

import random
import shutil
import signal
import subprocess
import sys
import tempfile
from collections import Counter
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from alembic import command
from alembic.config import Config
from alembic.operations import Operations
from sqlalchemy import MetaData, func, select, text

from app.config import Settings
from app.db.dialects.dialect import WRITE, make_engine
from app.db.home import make_home
from app.db.json_columns import compress_json
from app.db.log import NewLogEntry, append_entries
from app.db.migrate import (
    KNOWN_REVISIONS,
    find_migrations_folder,
    migrate_database,
    read_schema_revision,
)
from app.db.restore import restore_database
from app.db.session import Session, now
from tests.e2e.service import ROOT
from tests.torture import populated

Rows = dict[str, list[dict[str, Any]]]
"""All rows of all tables."""
MIGRATE = (
    "import sys; from tests.torture.upgrades import migrate_by_steps; migrate_by_steps(sys.argv[1])"
)
STEP = "an operation\n"
"""What a migration says after each operation, before it waits to be told to go on."""
SAYS = {
    ("solution", "body"): compress_json({"ball": None}),
    ("solution", "calibrations"): "[]",
    ("calibration", "body"): compress_json({"camera": None}),
    ("view", "balls"): "[]",
}
"""What a migration reads must be there."""
RENEWED = {("alembic_version", "version_num"), ("solution", "summary")}
"""Columns that migrations fill anew."""
DRAWN = {"installation"}
"""Tables that a migration fills with what it draws at random."""


def make_old(settings: Settings, revision: str) -> None:
    """A home as an earlier version left it: its schema, and one row in each table."""
    make_home(settings)
    config = Config()
    config.set_main_option("script_location", str(find_migrations_folder()))
    engine = make_engine(settings).execution_options(**WRITE)
    with Session(engine) as session:
        config.attributes["connection"] = session
        command.upgrade(config, revision)
        _fill(session)
        session.commit()
    engine.dispose()


def _fill(connection: Session) -> None:
    """One row in each table, whose references lead to each other's."""
    schema = MetaData()
    schema.reflect(connection)
    append_entries(connection, [NewLogEntry("dataset", "ann", now(), {}, 1)])
    # What belongs to a version is filled before that is there, and not later.
    connection.execute(text("PRAGMA defer_foreign_keys = ON"))
    for table in sorted(schema.sorted_tables, key=lambda table: table.name != "version_group"):
        if connection.execute(select(func.count()).select_from(table)).scalar():
            continue
        values = {}
        for column in table.columns:
            kind = str(column.type).split("(")[0]
            # JSON that says nothing, wherever a migration reads what it finds.
            texts = {
                "VARCHAR": "{}",
                "TEXT": "{}",
                "BLOB": compress_json({}),
                "FLOAT": 1.0,
                "BOOLEAN": False,
            }
            known = SAYS.get((table.name, column.name))
            values[column.name] = texts.get(kind, 1) if known is None else known
        connection.execute(table.insert().values(values))


def rows(settings: Settings) -> Rows:
    """All that a database holds, in an order of its own."""
    engine = make_engine(settings)
    with engine.connect() as connection:
        schema = MetaData()
        schema.reflect(connection)
        found = {
            table.name: sorted(map(dict, connection.execute(select(table)).mappings()), key=repr)
            for table in schema.sorted_tables
        }
    engine.dispose()
    return found


def differences(one: Rows, other: Rows) -> list[str]:
    """Names of tables that one of the two has not, or with other rows."""
    names = {*one, *other} - DRAWN
    return sorted(name for name in names if one.get(name) != other.get(name))


def lost(before: Rows, after: Rows) -> list[str]:
    """Columns, of those that are still there, in which a value is gone."""
    found = []
    for table in before.keys() & after.keys():
        columns = {name for row in after[table] for name in row}
        if before[table] and not after[table]:
            found.append(table)
        for name in columns & {name for row in before[table] for name in row}:
            then, now = (Counter(repr(row[name]) for row in had[table]) for had in (before, after))
            if then - now and (table, name) not in RENEWED:
                found.append(f"{table}.{name}")
    return sorted(found)


def revision_of(settings: Settings) -> str | None:
    """The schema's revision of a home."""
    engine = make_engine(settings)
    found = read_schema_revision(engine)
    engine.dispose()
    return found


def migrate_by_steps(home: str) -> None:
    """Migrate; after each operation say so and wait for a line, so that a kill meets it midway."""

    def wait() -> None:
        sys.stdout.write(STEP)
        sys.stdout.flush()
        sys.stdin.readline()

    with _after_each_operation(wait):
        migrate_database(Settings(home=Path(home)))


@contextmanager
def _after_each_operation(do: Callable[[], None]) -> Iterator[None]:
    execute = Operations.invoke

    def watched(self: Operations, operation: object) -> object:
        result = execute(self, operation)  # type: ignore[arg-type]
        do()
        return result

    Operations.invoke = watched  # type: ignore[method-assign, assignment]
    try:
        yield
    finally:
        Operations.invoke = execute  # type: ignore[method-assign]


def rehearse(home: Path) -> tuple[int, Rows]:
    """How many operations it takes to migrate a home, and what is there then; done to a copy of it."""
    steps: list[None] = []
    with tempfile.TemporaryDirectory(prefix="touchline-copy-") as name:
        copy = Settings(home=shutil.copytree(home, Path(name, "home")))
        with _after_each_operation(lambda: steps.append(None)):
            migrate_database(copy)
        return len(steps), rows(copy)


def torture(
    folder: Path,
    *,
    kills: int,
    seed: int,
    revisions: tuple[str, ...] = KNOWN_REVISIONS[:-1],
    tell: Callable[[str], None] = lambda _sentence: None,
) -> list[str]:
    """Migrate a home of each revision, killed that often before; what was not in order."""
    chance, faults = random.Random(seed), []
    for revision in revisions:
        settings = Settings(home=folder / revision)
        make_old(settings, revision)
        faults += [
            f"schema {revision}: {fault}" for fault in _upgrade(settings, revision, kills, chance)
        ]
        tell(f"schema {revision}: {kills} kills, migrated and taken back")
    return faults


def _upgrade(settings: Settings, revision: str, kills: int, chance: random.Random) -> list[str]:
    """Migrate a home, killed that often before, and take it back."""
    before = rows(settings)
    steps, wanted = rehearse(settings.home)
    if steps == 0:
        return ["its migration has no operation to be killed at"]
    for _ in range(kills):
        step = chance.randint(1, steps)
        fault = _kill_at(settings, step)
        if not fault and (revision_of(settings), rows(settings)) != (revision, before):
            fault = "something had happened"
        if fault:
            return [f"killed at operation {step} of {steps}: {fault}"]
    migrated = migrate_database(settings)
    after = rows(settings)
    faults = [f"killed and migrated again, {name} differs" for name in differences(wanted, after)]
    faults += [f"values are gone of {name}" for name in lost(before, after)]
    if revision_of(settings) != KNOWN_REVISIONS[-1]:
        faults.append(f"it is migrated to {revision_of(settings)}")
    if migrated.copy is None:
        return [*faults, "it is migrated without a backup"]
    restore_database(settings, migrated.copy)
    if (revision_of(settings), rows(settings)) != (revision, before):
        faults.append("its backup is not what it was")
    return faults


def carry(home: Path, folder: Path, revision: str = KNOWN_REVISIONS[-2]) -> list[str]:
    """Bring what people said into an earlier schema, migrate that, and read it with the product.

    Args:
        home: A home that ``kills.prepare`` has made; people work in it.
        folder: Where the home of the earlier schema goes.
        revision: Its schema; the one before the newest.
    """
    settings, old = Settings(home=home), Settings(home=folder / revision)
    populated.people_work(settings)
    wanted = populated.said(settings)
    make_old(old, revision)
    populated.carry_back(home, old)
    migrate_database(old)
    found = populated.said(old)
    return [
        f"carried from schema {revision}: {name} are not what was said"
        for name in wanted
        if found[name] != wanted[name]
    ]


def _kill_at(settings: Settings, step: int) -> str:
    """Kill a migration after its operation of that number; what was wrong with that, if anything."""
    process = subprocess.Popen(
        [sys.executable, "-c", MIGRATE, str(settings.home)],
        cwd=ROOT,
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        text=True,
    )
    assert process.stdin is not None and process.stdout is not None
    try:
        for number in range(step):
            if number:
                process.stdin.write("go on\n")
                process.stdin.flush()
            if process.stdout.readline() != STEP:
                return "it had ended before"
        return ""
    finally:
        process.send_signal(signal.SIGKILL)
        process.communicate()
