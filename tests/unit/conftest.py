"""What tests of every floor may need: the database's work, counted."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, contextmanager
from dataclasses import dataclass
from typing import Any

import pytest
import structlog
from sqlalchemy import event

from app.store.session import Store

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


@pytest.fixture(autouse=True)
def _usual_umask() -> Iterator[None]:
    """What a server or a restore takes from new files ends with its test."""
    before = os.umask(0o022)
    yield
    os.umask(before)


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
