"""Where batches are solved, as the settings say, and processes that solve."""

from __future__ import annotations

import os
import sys
import time
from concurrent.futures import Executor
from contextlib import contextmanager
from multiprocessing import active_children
from pathlib import Path

import pytest

from app.config import Settings
from app.errors import InputError
from app.workers import executors
from app.workers.executors import make_server_pool_opener, open_executor, open_process_pool
from tests.starting import run
from tests.waiting import SECONDS

POOL_IN_A_CLOSED_FOLDER = """
import os, sys
from app.errors import InputError
from app.workers.executors import open_process_pool

os.chdir(sys.argv[1])
os.chmod(".", 0)
if os.getuid() == 0:
    os.setuid(65534)
try:
    with open_process_pool(2):
        pass
except InputError as refused:
    print(refused.message, refused.hint)
"""


@pytest.fixture
def opened(monkeypatch: pytest.MonkeyPatch) -> list[int]:
    """How many processes each pool that was opened has; none is started."""
    counts: list[int] = []

    @contextmanager
    def pretend(workers: int):
        counts.append(workers)
        with Executor() as pool:
            yield pool

    monkeypatch.setattr(executors, "open_process_pool", pretend)
    return counts


@pytest.mark.parametrize(
    ("own", "asked", "expected"),
    [(3, None, [3]), (3, 2, [2]), (3, 1, []), (1, None, []), (1, 4, [4])],
)
def test_a_command_has_as_many_processes_as_it_asks_for_else_as_the_settings_say(
    tmp_path: Path, opened: list[int], own: int, asked: int | None, expected: list[int]
) -> None:
    with open_executor(Settings(home=tmp_path, workers=own), asked) as executor:
        assert (executor is None) == (not expected)
    assert opened == expected


@pytest.mark.parametrize(("own", "left"), [(8, 7), (2, 1), (1, 1)])
def test_a_server_leaves_one_processor_for_requests_and_opens_nothing_before_there_is_a_job(
    tmp_path: Path, opened: list[int], own: int, left: int
) -> None:
    pool = make_server_pool_opener(Settings(home=tmp_path, workers=own))
    assert opened == []
    with pool():
        assert opened == [left]


def test_where_a_cluster_is_named_it_solves_and_no_process_of_this_machine(
    tmp_path: Path, opened: list[int]
) -> None:
    settings = Settings(home=tmp_path, workers=3, cluster="nonsense")
    with pytest.raises(InputError, match="nonsense"), open_executor(settings, 2):
        pass
    with pytest.raises(InputError, match="nonsense"), make_server_pool_opener(settings)():
        pass
    assert opened == []


class TestProcessPool:
    def test_who_stands_in_a_folder_that_they_may_not_enter_is_told_before_processes_start(
        self, tmp_path: Path
    ) -> None:
        """As with sudo from somebody else's home: each process would end with a traceback."""
        (tmp_path / "closed").mkdir()
        command = [sys.executable, "-c", POOL_IN_A_CLOSED_FOLDER, str(tmp_path / "closed")]
        told = run(command, timeout=SECONDS)
        assert told.stderr == ""
        assert "has no access to the current folder" in told.stdout
        assert "cd /" in told.stdout

    def test_processes_end_with_the_work_that_fails_however_much_they_have_to_do(self) -> None:
        end = time.monotonic() + SECONDS
        with pytest.raises(LookupError), open_process_pool(1) as pool:
            pid = pool.submit(os.getpid).result()
            pool.submit(time.sleep, 3 * SECONDS)
            pool.submit(time.sleep, 3 * SECONDS)
            raise LookupError
        while pid in {child.pid for child in active_children()}:
            time.sleep(0.01)
        assert time.monotonic() < end
