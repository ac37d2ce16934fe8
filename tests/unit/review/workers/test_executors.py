"""Where batches are solved, as the settings say."""

from __future__ import annotations

from concurrent.futures import Executor
from contextlib import contextmanager
from pathlib import Path

import pytest

from app.config import Settings
from app.errors import InputError
from app.review.workers import executors
from app.review.workers.executors import executor_of, server_pool


@pytest.fixture
def opened(monkeypatch: pytest.MonkeyPatch) -> list[int]:
    """How many processes each pool that was opened has; none is started."""
    counts: list[int] = []

    @contextmanager
    def pretend(workers: int):
        counts.append(workers)
        with Executor() as pool:
            yield pool

    monkeypatch.setattr(executors, "process_pool", pretend)
    return counts


@pytest.mark.parametrize(
    ("own", "asked", "expected"),
    [(3, None, [3]), (3, 2, [2]), (3, 1, []), (1, None, []), (1, 4, [4])],
)
def test_a_command_has_as_many_processes_as_it_asks_for_else_as_the_settings_say(
    tmp_path: Path, opened: list[int], own: int, asked: int | None, expected: list[int]
) -> None:
    with executor_of(Settings(home=tmp_path, workers=own), asked) as executor:
        assert (executor is None) == (not expected)
    assert opened == expected


@pytest.mark.parametrize(("own", "left"), [(8, 7), (2, 1), (1, 1)])
def test_a_server_leaves_one_processor_for_requests_and_opens_nothing_before_there_is_a_job(
    tmp_path: Path, opened: list[int], own: int, left: int
) -> None:
    pool = server_pool(Settings(home=tmp_path, workers=own))
    assert opened == []
    with pool():
        assert opened == [left]


def test_where_a_cluster_is_named_it_solves_and_no_process_of_this_machine(
    tmp_path: Path, opened: list[int]
) -> None:
    settings = Settings(home=tmp_path, workers=3, cluster="nonsense")
    with pytest.raises(InputError, match="nonsense"), executor_of(settings, 2):
        pass
    with pytest.raises(InputError, match="nonsense"), server_pool(settings)():
        pass
    assert opened == []
