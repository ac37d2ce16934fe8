"""What every test process does, whatever it tests."""

from __future__ import annotations

import gc
import sys
from collections.abc import Iterable
from pathlib import Path

import pytest
from httpx._config import DEFAULT_TIMEOUT_CONFIG
from sqlalchemy import Engine, event

from tests.made_once import make_once
from tests.on_postgresql import MARK, install, shared_cluster
from tests.spawning import start_loaded
from tests.starting import end_nursery, nursery
from tests.waiting import SECONDS

make_once()
if sys.platform == "linux":
    start_loaded(lambda: nursery().children)

BROAD = Path(__file__).with_name("broad.txt")
"""What `make test` leaves to `make test-all`, by parts of the names of tests."""
YOUNG = 50_000
"""New objects before the collector looks at them: seventy times as many as by default."""


if (cluster := shared_cluster()) is not None:
    # Before any module of the tests has taken what this changes by its name.
    install(cluster)


@event.listens_for(Engine, "before_execute")
def _require_alike(
    _connection: object, _clause: object, rows: list[dict[str, object]], *_: object
) -> None:
    """What only later rows of a statement have is dropped without a word."""
    assert all(row.keys() == rows[0].keys() for row in rows), "rows of one statement are not alike"


def broad_lines() -> list[str]:
    """The lines of `BROAD` that name tests."""
    lines = BROAD.read_text().splitlines()
    return [line for line in lines if line and not line.startswith("#")]


def broad_tests(tests: Iterable[str]) -> set[str]:
    """Those tests that a line of `BROAD` names: each of its parts is in the name."""
    lines = [line.split(" * ") for line in broad_lines()]
    of_file: dict[str, list[list[str]]] = {}
    found = set()
    for test in tests:
        file = test.partition("::")[0]
        if file not in of_file:
            # Few lines speak of a file, and there are thousands of tests.
            of_file[file] = [
                parts
                for parts in lines
                if not parts[0].startswith("tests/") or parts[0].partition("::")[0] in file
            ]
        if any(all(part in test for part in parts) for parts in of_file[file]):
            found.add(test)
    return found


def pytest_addoption(parser: pytest.Parser) -> None:
    """`--quick`: without what is slow and broad."""
    parser.addoption("--quick", action="store_true", help="leave out what `make test-all` adds")


def pytest_configure() -> None:
    """Look for no garbage while modules and tests are collected: none of them is."""
    gc.disable()
    # Five seconds, which tests that say nothing else would wait, a busy machine takes for little.
    for part in ("connect", "read", "write", "pool"):
        setattr(DEFAULT_TIMEOUT_CONFIG, part, SECONDS)


def pytest_collection_modifyitems(config: pytest.Config, items: list[pytest.Item]) -> None:
    """Leave out what is broad where that is asked for, and what is about the file of SQLite where there is none."""
    if config.getoption("--quick"):
        broad = broad_tests(item.nodeid for item in items)
        config.hook.pytest_deselected(items=[item for item in items if item.nodeid in broad])
        items[:] = [item for item in items if item.nodeid not in broad]
    for item in items if cluster is not None else ():
        if (mark := item.get_closest_marker(MARK)) is not None:
            item.add_marker(pytest.mark.skip(reason=f"of SQLite alone: {mark.args[0]}"))


def pytest_collection_finish() -> None:
    """Leave modules and tests out of the search for garbage: they stay until the end."""
    gc.freeze()
    gc.set_threshold(YOUNG)
    gc.enable()


def pytest_sessionfinish() -> None:
    """End the process that the servers and commands of tests are forked from."""
    end_nursery()
