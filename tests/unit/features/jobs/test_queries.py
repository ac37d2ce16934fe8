"""Jobs as rows."""

from __future__ import annotations

from app.db.store import Store
from app.features.jobs.queries import (
    NewJob,
    delete_oldest_jobs,
    insert_job,
    read_job,
    read_jobs,
    update_job,
)


def insert(own_store: Store, kind: str = "solve", **options) -> int:
    with own_store.write() as session:
        return insert_job(session, NewJob(kind, "Work", "ann", **options))


def update(own_store: Store, job: int, **values) -> None:
    with own_store.write() as session:
        update_job(session, job, **values)


class TestReadJob:
    def test_gives_back_what_was_written(self, own_store: Store) -> None:
        job = insert(own_store, dataset_id=77, request={"a": [1, None]})
        update(own_store, job, state="failed", done=2, total=9, problem={"detail": "é"})
        with own_store.read() as session:
            found = read_job(session, job)
            assert read_job(session, job + 1) is None
        assert (found.request, found.problem, found.result) == (
            {"a": [1, None]},
            {"detail": "é"},
            None,
        )
        assert (found.state, found.done, found.total) == ("failed", 2, 9)
        # Its dataset is gone.
        assert (found.dataset_id, found.dataset) == (77, None)


class TestTrimJobs:
    def test_keeps_the_newest_and_those_that_are_not_over(self, own_store: Store) -> None:
        ids = [insert(own_store) for _ in range(4)]
        other = insert(own_store, "export")
        for job in (*ids[1:], other):
            update(own_store, job, state="done")
        with own_store.write() as session:
            delete_oldest_jobs(session, "solve", 1)
        with own_store.read() as session:
            left = [job.id for job in read_jobs(session)]
        assert left == [other, ids[3], ids[0]]
