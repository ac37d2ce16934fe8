"""What tests of every floor may need: the database's work, counted."""

from __future__ import annotations

import os
import sys
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import pytest
import structlog
from sqlalchemy import event

from app.cli import main
from app.store.session import Store
from tests.kept_child import USERS, KeptChild

# As the server logs. The default draws a traceback with all its variables, half a second each.
structlog.configure(
    processors=[
        structlog.contextvars.merge_contextvars,
        structlog.processors.add_log_level,
        structlog.processors.format_exc_info,
        structlog.processors.KeyValueRenderer(key_order=["level", "event"]),
    ]
)


@dataclass
class Cost:
    """What went to the database: transactions of either kind, commits of writes, statements."""

    reads: int = 0
    writes: int = 0
    commits: int = 0
    statements: int = 0


@pytest.fixture(scope="session", autouse=True)
def _children_are_kept() -> Iterator[None]:
    """Who asks a child for something gets one that an earlier test has left, if there is one."""
    with pytest.MonkeyPatch.context() as patch:
        for module in USERS:
            patch.setattr(f"{module}.Child", KeptChild)
        yield


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

        def execute(_connection: Any, _cursor: Any, statement: str, *_: Any) -> None:
            cost.reads += statement == "BEGIN"
            cost.writes += statement == "BEGIN IMMEDIATE"
            cost.statements += not statement.startswith("BEGIN")

        def commit(connection: Any) -> None:
            cost.commits += bool(connection.get_execution_options().get("touchline_write"))

        event.listen(engine, "before_cursor_execute", execute)
        event.listen(engine, "commit", commit)
        try:
            yield cost
        finally:
            event.remove(engine, "before_cursor_execute", execute)
            event.remove(engine, "commit", commit)

    return run
