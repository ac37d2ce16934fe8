"""Sharing positions as a job: where it is computed, and what follows when it ends early."""

from __future__ import annotations

from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace

import pytest

from app.db.store import Store
from app.features.imports.ingest import import_groups
from app.features.jobs.service import Jobs
from app.features.match_estimates import positions as editing
from app.features.match_estimates.jobs import POSITIONS
from app.features.match_estimates.positions import get_main_camera_positions
from app.features.policies.service import change_policy
from tests.unit.features.jobs.steps import Held
from tests.unit.features.match_estimates.test_positions import SHARING, match
from tests.waiting import SECONDS


@pytest.fixture
def two(store: Store) -> Store:
    """Two matches, and a policy that uses what they share."""
    groups = [replace(group, match=f"{place % 2}") for place, group in enumerate(match())]
    import_groups(store, "demo", groups, source="files", actor="ann")
    change_policy(store, "demo", SHARING, if_match=None, actor="ann")
    return store


def test_matches_are_worked_on_in_processes_of_their_own(two: Store) -> None:
    pools: list[ThreadPoolExecutor] = []

    def pool() -> ThreadPoolExecutor:
        pools.append(ThreadPoolExecutor(1))
        return pools[-1]

    jobs = Jobs(two, pool=pool)
    job = POSITIONS.request(jobs, two, "demo", None, actor="ann")
    assert jobs.wait(job.id, SECONDS).state == "done"
    assert len(pools) == 1
    jobs.close()


def test_what_was_written_before_it_failed_is_solved(
    two: Store, monkeypatch: pytest.MonkeyPatch
) -> None:
    whole = editing._run_position_task

    def estimate(task):
        if task.match == "1":
            raise ValueError("odd")
        return whole(task)

    monkeypatch.setattr(editing, "_run_position_task", estimate)
    jobs = Jobs(two)
    job = POSITIONS.request(jobs, two, "demo", None, actor="ann")
    assert jobs.wait(job.id, SECONDS).state == "failed"
    assert [item.kind for item in jobs.find()] == ["solve", "positions"]
    jobs.close()


@pytest.mark.parametrize(
    ("match", "shared"), [("0", [None, None]), ("1", [True, None])], ids=["given", "next"]
)
def test_a_share_that_is_taken_back_while_it_runs_gives_nothing_more(
    two: Store, monkeypatch: pytest.MonkeyPatch, match: str, shared: list[bool | None]
) -> None:
    jobs, estimated = Jobs(two), Held(editing._run_position_task, calls=2)
    monkeypatch.setattr(editing, "_run_position_task", estimated)
    job = POSITIONS.request(jobs, two, "demo", None, actor="ann")
    estimated.wait()
    POSITIONS.undo_last_job(jobs, two, "demo", match, actor="ann")
    estimated.go_on.set()
    assert jobs.wait(job.id, SECONDS).state == "cancelled"
    assert [item.current for item in get_main_camera_positions(two, "demo").items] == shared
    jobs.close()
