"""Upgrades: homes of every released schema, with something in every table, killed while they migrate.

A migration that was killed has not happened; done again it keeps every row that the new schema
has room for.
"""

from __future__ import annotations

import random
import shutil
import signal
import subprocess
import sys
import tempfile
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

from alembic import command
from alembic.config import Config
from alembic.operations import Operations
from sqlalchemy import MetaData, func, select
from sqlalchemy.exc import IntegrityError

from app.config import Settings
from app.store.clock import now
from app.store.codecs import pack
from app.store.engine import WRITE, make_engine
from app.store.home import make_home
from app.store.log import Entry, append
from app.store.migrate import KNOWN_REVISIONS, migrate, migrations_folder, schema_revision
from app.store.restore import restore
from app.store.session import Session
from tests.e2e.service import ROOT

MIGRATE = (
    "import sys; from tests.torture.upgrades import migrate_by_steps; migrate_by_steps(sys.argv[1])"
)
STEP = "an operation\n"
"""What a migration says after each operation, before it waits to be told to go on."""
SAYS = {
    ("solution", "body"): pack({"ball": None}),
    ("solution", "calibrations"): "[]",
    ("calibration", "body"): pack({"camera": None}),
    ("view", "balls"): "[]",
}
"""What a migration reads must be there."""


def make_old(settings: Settings, revision: str) -> None:
    """A home as an earlier version left it: its schema, and one row in each table."""
    make_home(settings)
    config = Config()
    config.set_main_option("script_location", str(migrations_folder()))
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
    append(connection, [Entry("dataset", "ann", now(), {}, 1)])
    for table in schema.sorted_tables:
        if connection.execute(select(func.count()).select_from(table)).scalar():
            continue
        values = {}
        for column in table.columns:
            kind = str(column.type).split("(")[0]
            # JSON that says nothing, wherever a migration reads what it finds.
            texts = {
                "VARCHAR": "{}",
                "TEXT": "{}",
                "BLOB": pack({}),
                "FLOAT": 1.0,
                "BOOLEAN": False,
            }
            known = SAYS.get((table.name, column.name))
            values[column.name] = texts.get(kind, 1) if known is None else known
        # What belongs to a version is filled while that is being frozen, and not later.
        with suppress(IntegrityError), connection.begin_nested():
            connection.execute(table.insert().values(values))


def rows(settings: Settings) -> dict[str, int]:
    """How many rows each table has."""
    engine = make_engine(settings)
    with engine.connect() as connection:
        schema = MetaData()
        schema.reflect(connection)
        found = {
            table.name: connection.execute(select(func.count()).select_from(table)).scalar_one()
            for table in schema.sorted_tables
        }
    engine.dispose()
    return found


def revision_of(settings: Settings) -> str | None:
    """The schema's revision of a home."""
    engine = make_engine(settings)
    found = schema_revision(engine)
    engine.dispose()
    return found


def migrate_by_steps(home: str) -> None:
    """Migrate; after each operation say so and wait for a line, so that a kill meets it midway."""

    def wait() -> None:
        sys.stdout.write(STEP)
        sys.stdout.flush()
        sys.stdin.readline()

    with _after_each_operation(wait):
        migrate(Settings(home=Path(home)))


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


def operations(home: Path) -> int:
    """How many operations it takes to migrate a home; done to a copy of it."""
    steps: list[None] = []
    with tempfile.TemporaryDirectory(prefix="touchline-copy-") as name:
        copy = shutil.copytree(home, Path(name, "home"))
        with _after_each_operation(lambda: steps.append(None)):
            migrate(Settings(home=copy))
    return len(steps)


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
        before, steps = rows(settings), operations(settings.home)
        if steps == 0:
            faults.append(f"schema {revision}: its migration has no operation to be killed at")
        for _ in range(kills if steps else 0):
            step = chance.randint(1, steps)
            fault = _kill_at(settings, step)
            if (revision_of(settings), rows(settings)) != (revision, before):
                fault = fault or "something had happened"
            if fault:
                faults.append(f"schema {revision}: killed at operation {step} of {steps}: {fault}")
                break
        migrated = migrate(settings)
        after = rows(settings)
        lost = [name for name, count in before.items() if after.get(name, count) < count]
        if lost or revision_of(settings) != KNOWN_REVISIONS[-1]:
            faults.append(f"schema {revision}: migrated, and rows are gone of {', '.join(lost)}")
        if migrated.copy is None:
            faults.append(f"schema {revision}: migrated without a backup")
            continue
        restore(settings, migrated.copy)
        if (revision_of(settings), rows(settings)) != (revision, before):
            faults.append(f"schema {revision}: its backup is not what it was")
        tell(
            f"schema {revision}: {len(before)} tables, {kills} kills among {steps} operations, migrated and taken back"
        )
    return faults


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
