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
from typing import Any

import pytest
import structlog
from sqlalchemy import event
from typer.main import get_command

from app.cli import main
from app.store import migrate
from app.store.store import Store
from tests.databases import SQLITE, Databases, databases_of, opened_databases
from tests.kept_worker import USERS, KeptWorker
from tests.schemas import copied_schemas, make_schema
from tests.spawning import ANEW

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
        "review/doctor/test_database.py",
        "review/editing/test_submit.py",
        "review/verdicts/test_verdict.py",
        "review/versions/test_check.py",
        "review/versions/test_freeze.py",
        "store/test_idempotency.py",
        "store/test_conditions.py",
        "store/test_listing.py",
        "store/test_log.py",
        "store/test_orphans.py",
        "store/test_spare.py",
        "store/test_verdicts.py",
    }
)
"""Files whose tests always run on SQLite and on PostgreSQL: what the engines do differently, what finds
damage, and one way each of edits, verdicts, versions and answers through the store."""
WHEN_ALL = ON_BOTH | {
    "review/test_idempotency.py",
    "review/datasets/test_delete.py",
    "review/importing/test_ingest.py",
    "review/queue/test_listing.py",
    "review/versions/test_verify.py",
    "review/work/test_work.py",
    "store/test_changes.py",
    "store/test_datasets.py",
    "store/test_heads.py",
    "store/test_jobs.py",
    "store/test_projection.py",
    "store/test_removal.py",
    "store/test_solutions.py",
    "store/test_views.py",
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
    monkeypatch.setattr(migrate, "make_schema", make_schema)


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
def home(tmp_path: Path) -> Path:
    """Where the home of a test is; nothing is there yet."""
    return tmp_path / "home"


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
