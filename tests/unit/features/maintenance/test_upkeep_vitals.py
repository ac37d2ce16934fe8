"""Vitals: what an operator watches."""

from __future__ import annotations

from datetime import datetime, timedelta
from pathlib import Path

import pytest
from sqlalchemy import update

from app.config import Settings
from app.db.dialects.dialect import get_dialect
from app.db.session import now
from app.db.store import Store
from app.features.datasets.service import get_dataset
from app.features.datasets.tables import GroupModel
from app.features.jobs.service import Jobs
from app.features.maintenance import upkeep as vitals
from app.features.maintenance.upkeep import read_database_file_sizes, read_home_report
from app.features.policies.service import change_policy
from app.features.queue.tables import QueueModel
from app.features.solve.jobs import request_solve_job
from app.soccer.policy import STRICT
from tests.waiting import SECONDS


def test_groups_that_wait_are_counted_and_the_oldest_is_timed(
    store: Store, fill, make_group, monkeypatch: pytest.MonkeyPatch
) -> None:
    fill(make_group(7), make_group(8, shift=300.0), solved=False)
    found = read_home_report(store)
    assert (found.groups, found.unsolved) == (2, 2)

    class Later(datetime):
        @classmethod
        def now(cls, tz=None):
            return datetime.now(tz) + timedelta(hours=1)

    monkeypatch.setattr(vitals, "datetime", Later)
    assert 3600 <= read_home_report(store).oldest_unsolved_seconds < 7200


def test_groups_that_wait_for_a_new_policy_wait_since_it_came(
    store: Store, fill, make_group
) -> None:
    fill(make_group(7))
    with store.write() as session:
        long_ago = "2020-01-01T00:00:00.000000+00:00"
        session.execute(update(GroupModel).values(changed=long_ago))
        session.execute(update(QueueModel).values(changed=long_ago))
    before = now()
    change_policy(store, "demo", STRICT, if_match=None, actor="ann")
    found = read_home_report(store)
    assert found.unsolved == 1
    assert found.oldest_unsolved is not None
    assert before <= found.oldest_unsolved <= now()


def test_groups_that_an_earlier_solver_solved_wait(
    store: Store, fill, make_group, upgrade_solver
) -> None:
    fill(make_group(7), make_group(8))
    upgrade_solver()
    found = read_home_report(store)
    assert (found.groups, found.unsolved) == (2, 2)
    assert found.oldest_unsolved is not None


def test_files_are_those_of_the_database_wherever_it_lies(tmp_path: Path) -> None:
    settings = Settings(home=tmp_path, database_url=f"sqlite:///{tmp_path}/elsewhere.db")
    assert read_database_file_sizes(settings) == {}
    settings.database_file.write_bytes(b"123")
    assert read_database_file_sizes(settings) == {"database": 3}


def test_nothing_waits_once_all_is_solved(store: Store, fill, make_group) -> None:
    fill(make_group(7))
    found = read_home_report(store)
    assert (found.unsolved, found.oldest_unsolved_seconds) == (0, 0.0)
    assert found.entries >= 2
    assert (found.file_bytes.get("database", 0) > 0) == get_dialect(store.settings).is_file
    assert found.free_bytes > 0


def test_jobs_are_counted_by_kind_and_state(store: Store, fill, make_group) -> None:
    fill(make_group(7))
    assert read_home_report(store).jobs == {}
    jobs = Jobs(store)
    job = request_solve_job(jobs, store, get_dataset(store, "demo").id, actor="ann")
    jobs.wait(job.id, SECONDS)
    jobs.close()
    assert read_home_report(store).jobs == {("solve", "done"): 1}
