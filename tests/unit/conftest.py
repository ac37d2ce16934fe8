"""What tests of every floor may need: the database's work, counted."""

from __future__ import annotations

import os
import sys
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, contextmanager
from dataclasses import dataclass
from functools import cache
from multiprocessing.context import SpawnProcess
from pathlib import Path
from shutil import copytree
from typing import Any

import pytest
import structlog
from sqlalchemy import event
from typer.main import get_command

from app.cli import main
from app.db import migrate
from app.db.store import Store
from tests.databases import SQLITE, Databases, databases_of, opened_databases
from tests.kept_worker import USERS, KeptWorker
from tests.schemas import copied_schemas, make_schema
from tests.spawning import ANEW
from tests.unit.applications import api as api
from tests.unit.applications import app as app
from tests.unit.applications import client_of as client_of
from tests.unit.applications import event_loop_of_all as event_loop_of_all
from tests.unit.applications import group as group
from tests.unit.applications import only_app as only_app
from tests.unit.applications import pages_client as pages_client
from tests.unit.applications import plain_app as plain_app
from tests.unit.applications import prepared_home as prepared_home
from tests.unit.applications import static_folder as static_folder
from tests.unit.applications import static_group as static_group
from tests.unit.applications import wherever as wherever
from tests.unit.own_stores import filled as filled
from tests.unit.own_stores import full_camera as full_camera
from tests.unit.own_stores import full_group as full_group
from tests.unit.own_stores import migrated as migrated
from tests.unit.own_stores import own_store as own_store
from tests.unit.own_stores import settings as settings
from tests.unit.stores import empty as empty
from tests.unit.stores import fill as fill
from tests.unit.stores import filled_before as filled_before
from tests.unit.stores import lock_watcher as lock_watcher
from tests.unit.stores import make_group as make_group
from tests.unit.stores import make_static as make_static
from tests.unit.stores import once as once
from tests.unit.stores import only_store as only_store
from tests.unit.stores import opposite as opposite
from tests.unit.stores import state as state
from tests.unit.stores import store as store
from tests.unit.stores import there as there
from tests.unit.stores import upgrade_solver as upgrade_solver

# As the server logs. The default draws a traceback with all its variables, half a second each.
structlog.configure(
    processors=[
        structlog.contextvars.merge_contextvars,
        structlog.processors.add_log_level,
        structlog.processors.format_exc_info,
        structlog.processors.KeyValueRenderer(key_order=["level", "event"]),
    ]
)


@pytest.fixture(scope="session", autouse=True)
def _no_setting_of_tests() -> None:
    """`touchline doctor` finds fault with what is no setting of the product."""
    os.environ.pop("TOUCHLINE_REAL_DATA", None)


ON_BOTH = frozenset(
    {
        "features/integrity/test_checks_database.py",
        "features/groups/test_submit.py",
        "features/verdicts/test_service_verdict.py",
        "features/integrity/test_records_versions.py",
        "features/versions/test_freeze.py",
        "db/test_idempotency.py",
        "features/queue/test_queries_conditions.py",
        "features/queue/test_queries_listing.py",
        "db/test_log.py",
        "features/datasets/test_queries_orphans.py",
        "features/groups/test_queries.py",
        "features/verdicts/test_queries_verdicts.py",
    }
)
"""Files whose tests always run on SQLite and on PostgreSQL: what the engines do differently, what finds
damage, and one way each of edits, verdicts, versions and answers through the store."""
WHEN_ALL = ON_BOTH | {
    "features/datasets/test_service_delete.py",
    "features/imports/test_ingest.py",
    "features/queue/test_service_listing.py",
    "features/versions/test_verify.py",
    "features/batches/test_work.py",
    "features/groups/test_revision_queries.py",
    "features/datasets/test_queries_datasets.py",
    "features/groups/test_revision_queries_etags.py",
    "features/jobs/test_queries.py",
    "features/groups/test_state_snapshot_queries.py",
    "features/datasets/test_queries_removal.py",
    "features/solutions/test_queries.py",
    "features/groups/test_view_queries_views.py",
}
"""Files that do with ``TOUCHLINE_TEST_DATABASES=all``."""


@dataclass
class Cost:
    """What went to the database: transactions of either kind, commits of writes, statements."""

    reads: int = 0
    writes: int = 0
    commits: int = 0
    statements: int = 0


@pytest.fixture(scope="session", autouse=True)
def _workers_are_kept() -> Iterator[None]:
    """Who asks a worker for something gets one that an earlier test has left, if there is one."""
    with pytest.MonkeyPatch.context() as patch:
        for module in USERS:
            patch.setattr(f"{module}.WorkerProcess", KeptWorker)
        yield


@pytest.fixture(scope="session", autouse=True)
def _commands_are_built_once() -> Iterator[None]:
    """Who runs a command gets the tree of all commands that an earlier test has built."""
    build = cache(get_command)
    with pytest.MonkeyPatch.context() as patch:
        for user in ("typer.main.get_command", "typer.testing._get_command"):
            patch.setattr(user, build)
        yield


@pytest.fixture(scope="session", autouse=True)
def _schemas_are_copied() -> Iterator[None]:
    """An empty home is migrated once in a process."""
    with copied_schemas():
        yield


@pytest.fixture
def workers_start_anew(monkeypatch: pytest.MonkeyPatch) -> None:
    """Workers start as the product starts them: for tests of that, and of what they may use."""
    monkeypatch.setattr(SpawnProcess, "_Popen", staticmethod(ANEW))


@pytest.fixture
def every_migration(monkeypatch: pytest.MonkeyPatch) -> None:
    """An empty home is migrated as the product does it: for tests of that."""
    monkeypatch.setattr(migrate, "apply_missing_migrations", make_schema)


def pytest_generate_tests(metafunc: pytest.Metafunc) -> None:
    """Run tests of a database on both, where ``ON_BOTH`` names their file."""
    if "databases" in metafunc.fixturenames:
        file = Path(metafunc.module.__file__).relative_to(Path(__file__).parent)
        own = getattr(metafunc.module, "DATABASES", None)
        names = own or databases_of(file.as_posix(), ON_BOTH, WHEN_ALL)
        if names != [SQLITE]:
            metafunc.parametrize("databases", names, indirect=True, scope="session")


@pytest.fixture(scope="session")
def databases(
    request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory
) -> Iterator[Databases]:
    """The databases that tests run on."""
    kind = getattr(request, "param", SQLITE)
    with opened_databases(kind, tmp_path_factory.mktemp(kind)) as opened:
        yield opened


@pytest.fixture(autouse=True)
def _usual_umask() -> Iterator[None]:
    """What a server or a restore takes from new files ends with its test."""
    before = os.umask(0o022)
    yield
    os.umask(before)


@pytest.fixture
def home(filled_home: Path | None, tmp_path: Path) -> Path:
    """The home of a test, its own to change; nothing is there, or what ``filled_home`` holds."""
    home = tmp_path / "home"
    return home if filled_home is None else Path(copytree(filled_home, home))


@pytest.fixture(scope="module")
def filled_home() -> Path | None:
    """The home that each test of a module begins with; None: it begins with nothing."""
    return None


@pytest.fixture
def touchline(
    monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str], home: Path
) -> Callable[..., tuple[int, str, str]]:
    """Runs a command in the ``home`` of the test: exit code, stdout, stderr."""
    for name in [name for name in os.environ if name.startswith("TOUCHLINE_")]:
        monkeypatch.delenv(name)
    monkeypatch.setenv("TOUCHLINE_HOME", str(home))

    def command(*arguments: object) -> tuple[int, str, str]:
        monkeypatch.setattr(sys, "argv", ["touchline", *map(str, arguments)])
        with pytest.raises(SystemExit) as ended:
            main()
        out, err = capfd.readouterr()
        return int(ended.value.code or 0), out, err

    return command


@pytest.fixture
def counted() -> Callable[[Store], AbstractContextManager[Cost]]:
    """Counts what goes to a database: ``with counted(store) as cost``."""

    @contextmanager
    def run(store: Store) -> Iterator[Cost]:
        cost, engine = Cost(), store._engine

        def claims(connection: Any) -> bool:
            """Whether it is the one by which processes leave work to each other."""
            options = connection.get_execution_options()
            return options.get("isolation_level") == "AUTOCOMMIT" and not options.get(
                "touchline_glance"
            )

        def execute(connection: Any, _cursor: Any, statement: str, *_: Any) -> None:
            locks = ("BEGIN", "SELECT pg_advisory", "SELECT pg_notify")
            cost.statements += not (statement.startswith(locks) or claims(connection))

        def begin(connection: Any) -> None:
            options = connection.get_execution_options()
            write = bool(options.get("touchline_write"))
            cost.writes += write
            cost.reads += not (write or options.get("touchline_glance") or claims(connection))

        def commit(connection: Any) -> None:
            cost.commits += bool(connection.get_execution_options().get("touchline_write"))

        event.listen(engine, "before_cursor_execute", execute)
        event.listen(engine, "begin", begin)
        event.listen(engine, "commit", commit)
        try:
            yield cost
        finally:
            event.remove(engine, "before_cursor_execute", execute)
            event.remove(engine, "begin", begin)
            event.remove(engine, "commit", commit)

    return run
