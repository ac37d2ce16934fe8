"""Whose job is next: solving, then person by person; an export runs beside another dataset's job."""

from __future__ import annotations

from collections.abc import Iterator

import pytest

from app.errors import OverloadedError
from app.review.importing.ingest import ensure_dataset
from app.review.jobs.jobs import Jobs
from app.store.store import Store
from tests.unit.review.jobs.steps import Gate, submit
from tests.waiting import SECONDS


@pytest.fixture
def jobs(store: Store) -> Iterator[Jobs]:
    jobs = Jobs(store)
    yield jobs
    jobs.close()


class TestRunQueue:
    def test_one_runs_at_a_time_in_the_order_asked_for(self, jobs: Jobs) -> None:
        first, order = Gate(), []
        one = submit(jobs, first)
        others = [submit(jobs, lambda _, n=n: order.append(n)) for n in range(2)]
        assert first.started.wait(SECONDS)
        assert [jobs.get(job.id).state for job in others] == ["waiting", "waiting"]
        first.finish.set()
        for job in (one, *others):
            assert jobs.wait(job.id, SECONDS).state == "done"
        assert order == [0, 1]

    def test_solving_goes_before_what_nobody_waits_for(self, jobs: Jobs) -> None:
        first, order = Gate(), []
        submit(jobs, first)
        assert first.started.wait(SECONDS)
        verify = submit(jobs, lambda _: order.append("verify"), kind="verify")
        submit(jobs, lambda _: order.append("solve"), kind="solve")
        first.finish.set()
        jobs.wait(verify.id, SECONDS)
        assert order == ["solve", "verify"]

    def test_an_export_waits_for_nothing_of_another_dataset(self, jobs: Jobs, store: Store) -> None:
        demo, other = (ensure_dataset(store, name, "ann") for name in ("demo", "other"))
        long, order = Gate(), list[str]()
        one = submit(jobs, long, dataset_id=demo, kind="import")
        assert long.started.wait(SECONDS)
        own = submit(jobs, lambda _: order.append("own"), dataset_id=demo, kind="export")
        free = submit(jobs, lambda _: order.append("free"), dataset_id=other, kind="export")
        assert jobs.wait(free.id, SECONDS).state == "done"
        assert jobs.get(own.id).state == "waiting"
        long.finish.set()
        for job in (one, own):
            assert jobs.wait(job.id, SECONDS).state == "done"
        assert order == ["free", "own"]

    def test_an_export_is_not_begun_before_what_its_dataset_was_asked_for_earlier(
        self, jobs: Jobs, store: Store
    ) -> None:
        demo, other = (ensure_dataset(store, name, "ann") for name in ("demo", "other"))
        long, order = Gate(), list[str]()
        submit(jobs, long, dataset_id=other)
        assert long.started.wait(SECONDS)
        submit(jobs, lambda _: order.append("import"), dataset_id=demo, kind="import")
        export = submit(jobs, lambda _: order.append("export"), dataset_id=demo, kind="export")
        third = submit(jobs, lambda _: None, dataset_id=None, kind="export")
        assert jobs.wait(third.id, SECONDS).state == "done"
        assert jobs.get(export.id).state == "waiting"
        long.finish.set()
        assert jobs.wait(export.id, SECONDS).state == "done"
        assert order == ["import", "export"]

    def test_people_have_their_turns_one_after_the_other(self, jobs: Jobs) -> None:
        first, order = Gate(), list[str]()
        jobs.submit("bulk", "Some work", first, actor="ann")
        assert first.started.wait(SECONDS)
        asked = ["ann", "ann", "ann", "bob", "bob", "eve"]
        ids = [
            jobs.submit("bulk", "Some work", lambda _, who=who: order.append(who), actor=who).id
            for who in asked
        ]
        first.finish.set()
        for job in ids:
            jobs.wait(job, SECONDS)
        assert order == ["bob", "eve", "ann", "bob", "ann", "ann"]

    def test_nobody_fills_all_places(self, store: Store) -> None:
        jobs, first = Jobs(store, capacity=8), Gate()
        submit(jobs, first)
        assert first.started.wait(SECONDS)
        for _ in range(6):
            submit(jobs, lambda _: None)
        with pytest.raises(OverloadedError, match="6 jobs that you asked for wait already"):
            submit(jobs, lambda _: None)
        jobs.submit("bulk", "Some work", lambda _: None, actor="bob")
        first.finish.set()
        jobs.close()
