"""What every test process does, whatever it tests."""

from __future__ import annotations

import gc
import sys

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

BROAD = (
    "[postgresql",
    "tests/e2e/test_access.py",
    "tests/e2e/test_access_states.py",
    "tests/e2e/test_broadcast.py",
    "tests/e2e/test_forms_",
    "tests/e2e/test_help.py::TestPractice",
    "tests/e2e/test_look.py",
    "tests/e2e/test_margins.py",
    "tests/e2e/test_phone.py",
    "tests/e2e/test_queue.py::TestFarJumps",
    "tests/e2e/test_team_sessions.py::TestSessions::test_every_page_before",
    "tests/evaluation/test_detector_loop.py::TestDetect",
    "tests/integration/test_cluster.py",
    "tests/integration/test_events.py::TestEvents::test_a_command_is_heard",
    "tests/integration/test_examples.py::TestPeoplesWork",
    "tests/integration/test_generated_clients.py",
    "tests/integration/test_installation.py",
    "tests/integration/test_interrupted.py",
    "tests/integration/test_openapi.py::TestOperations",
    "tests/integration/test_sample_recording.py",
    "tests/integration/test_stopping.py::TestIndexing",
    "tests/integration/test_torture.py",
    "tests/integration/test_tutorial.py",
    "tests/integration/test_web_processes.py::TestMetrics",
    "tests/real/test_ball_track.py",
    "tests/real/test_calibration.py::TestGoals",
    "tests/real/test_issia.py::TestPeople",
    "tests/real/test_link.py",
    "tests/real/test_matches.py",
    "tests/real/test_paint.py::test_accepted_proposals",
    "tests/real/test_rig.py",
    "tests/real/test_shots.py",
    "tests/real/test_track.py",
    "tests/real/test_versions.py",
    "tests/security/test_gold.py::TestGold",
    "tests/unit/db/test_migrate.py::TestOldHomes",
    "tests/unit/features/practice/test_recording.py::test_each_lesson",
    "tests/unit/features/integrity/test_upgrades.py",
    "tests/unit/http/test_web_processes.py::TestServeWith",
)
"""What `make test` leaves to `make test-all`, by parts of the names of tests: slow, broad, or the same once more on
another database."""
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
        broad = [item for item in items if any(part in item.nodeid for part in BROAD)]
        config.hook.pytest_deselected(items=broad)
        items[:] = [item for item in items if item not in set(broad)]
    for item in items if cluster is not None else ():
        if (mark := item.get_closest_marker(MARK)) is not None:
            item.add_marker(pytest.mark.skip(reason=f"of SQLite alone: {mark.args[0]}"))


def pytest_collection_finish() -> None:
    """Leave modules and tests out of the search for garbage: they stay until the end."""
    gc.collect()
    gc.freeze()
    gc.set_threshold(YOUNG)
    gc.enable()


def pytest_sessionfinish() -> None:
    """End the process that the servers and commands of tests are forked from."""
    end_nursery()
