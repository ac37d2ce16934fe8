"""Jobs as rows."""

from __future__ import annotations

from app.store.jobs import NewJob, insert_job, read_job, read_jobs, trim_jobs, update_job
from app.store.store import Store


def insert(store: Store, kind: str = "solve", **options) -> int:
    with store.write() as session:
        return insert_job(session, NewJob(kind, "Work", "ann", **options))


def update(store: Store, job: int, **values) -> None:
    with store.write() as session:
        update_job(session, job, **values)


class TestReadJob:
    def test_gives_back_what_was_written(self, store: Store) -> None:
        job = insert(store, dataset_id=77, request={"a": [1, None]})
        update(store, job, state="failed", done=2, total=9, problem={"detail": "é"})
        with store.read() as session:
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
    def test_keeps_the_newest_and_those_that_are_not_over(self, store: Store) -> None:
        ids = [insert(store) for _ in range(4)]
        other = insert(store, "export")
        for job in (*ids[1:], other):
            update(store, job, state="done")
        with store.write() as session:
            trim_jobs(session, "solve", 1)
        with store.read() as session:
            left = [job.id for job in read_jobs(session)]
        assert left == [other, ids[3], ids[0]]
