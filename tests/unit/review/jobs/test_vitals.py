"""Vitals: what an operator watches."""

from __future__ import annotations

from datetime import datetime, timedelta

import pytest

from app.review.datasets.dataset import get_dataset
from app.review.jobs import vitals
from app.review.jobs.jobs import Jobs
from app.review.jobs.solve import request_solve
from app.review.jobs.vitals import read_home
from app.store.session import Store


def test_groups_that_wait_are_counted_and_the_oldest_is_timed(
    store: Store, fill, make_group, monkeypatch: pytest.MonkeyPatch
) -> None:
    fill(make_group(7), make_group(8, shift=300.0), solved=False)
    found = read_home(store)
    assert (found.vitals.groups, found.vitals.unsolved) == (2, 2)

    class Later(datetime):
        @classmethod
        def now(cls, tz=None):
            return datetime.now(tz) + timedelta(hours=1)

    monkeypatch.setattr(vitals, "datetime", Later)
    assert 3600 <= read_home(store).oldest_unsolved_seconds < 7200


def test_nothing_waits_once_all_is_solved(store: Store, fill, make_group) -> None:
    fill(make_group(7))
    found = read_home(store)
    assert (found.vitals.unsolved, found.oldest_unsolved_seconds) == (0, 0.0)
    assert found.vitals.entries >= 2
    assert found.file_bytes["database"] > 0
    assert found.free_bytes > 0


def test_jobs_are_counted_by_kind_and_state(store: Store, fill, make_group) -> None:
    fill(make_group(7))
    assert read_home(store).vitals.jobs == {}
    jobs = Jobs(store)
    job = request_solve(jobs, store, get_dataset(store, "demo").id, actor="ann")
    jobs.wait(job.id, 30)
    jobs.close()
    assert read_home(store).vitals.jobs == {("solve", "done"): 1}
