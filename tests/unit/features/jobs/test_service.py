"""Jobs: one at a time, with progress, cancel and a record that survives the server."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from typing import Any

import pytest
from structlog.testing import capture_logs

from app.db.json_columns import Json
from app.db.session import Session
from app.db.store import Store
from app.errors import (
    ConflictError,
    InputError,
    JobCancelled,
    NotFoundError,
    OverloadedError,
    StorageError,
)
from app.features.imports.ingest import ensure_dataset
from app.features.jobs import runner as module
from app.features.jobs.job_run import JobProgress, JobRun
from app.features.jobs.queries import Job, NewJob, insert_job, update_job
from app.features.jobs.service import Jobs
from app.features.people.roles import Role
from app.features.people.service import invite
from app.features.people.visibility_queries import EVERYTHING, Visibility
from tests.unit.features.jobs.steps import Gate, list_sentences_told, submit
from tests.waiting import SECONDS


@pytest.fixture(autouse=True)
def _quick(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("app.features.jobs.records.TICK", 0.01)


@pytest.fixture
def jobs(store: Store) -> Iterator[Jobs]:
    jobs = Jobs(store, capacity=3)
    yield jobs
    jobs.close()


def until(happens: Callable[[], Any]) -> Any:
    """What a function returns, once that is something."""
    end = time.monotonic() + SECONDS
    while time.monotonic() < end:
        if found := happens():
            return found
        time.sleep(0.005)
    raise AssertionError("it did not happen")


class TestSubmit:
    def test_the_job_keeps_what_its_work_returns_as_the_result(
        self, jobs: Jobs, store: Store
    ) -> None:
        found = ensure_dataset(store, "demo", "ann")
        job = submit(jobs, lambda progress: {"n": 3}, dataset_id=found, request={"a": 1})
        assert (job.state, job.dataset, job.request) == ("waiting", "demo", {"a": 1})
        done = jobs.wait(job.id, SECONDS)
        assert (done.state, done.result, done.problem) == ("done", {"n": 3}, None)
        assert done.created <= done.started <= done.ended

    def test_when_too_many_wait_the_next_is_told_to_come_back(self, jobs: Jobs) -> None:
        first = Gate()
        submit(jobs, first)
        assert first.started.wait(SECONDS)
        for _ in range(3):
            submit(jobs, lambda _: None)
        with pytest.raises(OverloadedError):
            submit(jobs, lambda _: None)
        assert len(jobs.find()) == 4
        assert submit(jobs, lambda _: None, kind="solve", once=True).state == "waiting"
        first.finish.set()

    def test_a_waiting_job_is_not_queued_twice_but_a_running_one_is(
        self, jobs: Jobs, store: Store
    ) -> None:
        one, other = ensure_dataset(store, "one", "ann"), ensure_dataset(store, "other", "ann")
        first = Gate()
        running = submit(jobs, first, kind="solve", dataset_id=one, once=True)
        assert first.started.wait(SECONDS)
        second = submit(jobs, lambda _: None, kind="solve", dataset_id=one, once=True)
        third = submit(jobs, lambda _: None, kind="solve", dataset_id=one, once=True)
        fourth = submit(jobs, lambda _: None, kind="solve", dataset_id=other, once=True)
        assert second.id == third.id
        assert len({running.id, second.id, fourth.id}) == 3
        first.finish.set()

    def test_what_has_no_dataset_is_once_for_each_person(self, jobs: Jobs) -> None:
        first = Gate()
        submit(jobs, first)
        assert first.started.wait(SECONDS)
        ids = [
            jobs.submit("practice", "Practise", lambda _: None, actor=actor, once=True).id
            for actor in ("ann", "ben", "ann", "ben")
        ]
        assert (ids[0], ids[1]) == (ids[2], ids[3])
        assert ids[0] != ids[1]
        first.finish.set()

    def test_what_has_no_dataset_is_once_for_each_request(self, jobs: Jobs) -> None:
        first = Gate()
        submit(jobs, first)
        assert first.started.wait(SECONDS)
        one, other, again = (
            submit(jobs, lambda _: None, kind="practice", request={"again": wanted}, once=True)
            for wanted in (False, True, False)
        )
        assert (one.id, other.request) == (again.id, {"again": True})
        first.finish.set()


class Slow:
    """What belongs to a job and is written slowly."""

    def __init__(self) -> None:
        self.started, self.finish = threading.Event(), threading.Event()

    def __call__(self, _session: Session, _job: Job) -> None:
        self.started.set()
        assert self.finish.wait(SECONDS)


class TestSubmitting:
    """A request whose record is being written."""

    def test_keeps_nobody_waiting_who_only_looks(self, jobs: Jobs) -> None:
        gate, slow = Gate(), Slow()
        running = submit(jobs, gate, kind="export")
        assert gate.started.wait(SECONDS)
        with ThreadPoolExecutor(2) as threads:
            writes = threads.submit(submit, jobs, lambda _: 7, then=slow)
            assert slow.started.wait(SECONDS)
            looks = threads.submit(
                lambda: (
                    jobs.is_open(running.id, "export"),
                    jobs.is_idle(),
                    jobs.cancel(running.id).id,
                )
            )
            try:
                assert looks.result(SECONDS) == (True, False, running.id)
                assert not writes.done()
            finally:
                slow.finish.set()
            assert jobs.wait(writes.result(SECONDS).id, SECONDS).result == 7

    def test_of_two_that_are_wanted_once_one_is_queued(self, jobs: Jobs, store: Store) -> None:
        dataset, gate = ensure_dataset(store, "one", "ann"), Gate()
        submit(jobs, gate)
        assert gate.started.wait(SECONDS)
        with ThreadPoolExecutor(4) as threads:
            both = threads.map(
                lambda n: submit(jobs, lambda _: n, kind="solve", dataset_id=dataset, once=True),
                range(4),
            )
            assert len({job.id for job in both}) == 1
        assert len(jobs.find(kinds=["solve"])) == 1
        gate.finish.set()

    def test_a_job_whose_record_cannot_be_kept_is_not_begun(self, jobs: Jobs) -> None:
        def full() -> None:
            # Another one that entered wakes the worker, which would begin it by now.
            with jobs._changed:
                jobs._changed.notify_all()
            time.sleep(0.1)
            raise StorageError("the disk is full")

        def then(session: Session, _job: Job) -> None:
            setattr(session, "commit", full)  # noqa: B010

        began: list[int] = []
        jobs.wait(submit(jobs, lambda _: None).id, SECONDS)
        with pytest.raises(StorageError):
            submit(jobs, lambda _: began.append(1), then=then)
        assert jobs.wait(submit(jobs, lambda _: 7).id, SECONDS).result == 7
        assert (began, len(jobs.find())) == ([], 2)


class TestStart:
    def test_that_cannot_be_written_is_tried_again(
        self, jobs: Jobs, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        whole, refused = jobs._record_start, []

        def refuse_once(run: JobRun) -> bool:
            if not refused:
                refused.append(run)
                raise StorageError("another process is writing")
            return whole(run)

        monkeypatch.setattr(jobs, "_record_start", refuse_once)
        job = submit(jobs, lambda _: 7)
        until(lambda: refused)
        assert jobs.get(job.id).state == "waiting"
        assert not jobs.is_idle()
        assert jobs.wait(job.id, SECONDS).result == 7
        until(jobs.is_idle)

    def test_that_cannot_be_written_is_left_to_the_next_server(
        self, store: Store, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        jobs = Jobs(store)

        def refuse(_run: JobRun) -> bool:
            jobs.stop()
            raise StorageError("another process is writing")

        monkeypatch.setattr(jobs, "_record_start", refuse)
        job = submit(jobs, lambda _: 7)
        until(jobs.is_idle)
        jobs.close()
        assert jobs.get(job.id).state == "waiting"


class TestProgress:
    def test_is_written_while_the_work_runs(self, jobs: Jobs) -> None:
        gate = Gate()
        job = submit(jobs, gate)
        seen = until(lambda: (found := jobs.get(job.id)).total and found)
        assert (seen.done, seen.total, seen.sentence) == (1, 2, "Half of it.")
        assert seen.state == "running"
        gate.finish.set()

    def test_may_be_told_inside_of_a_transaction(self, jobs: Jobs, store: Store) -> None:
        def work(progress: JobProgress) -> Json:
            with store.write():
                for done in range(50):
                    progress(done, 50)
                    time.sleep(0.001)
            return "written"

        assert jobs.wait(submit(jobs, work).id, SECONDS).result == "written"

    def test_is_written_a_few_times_a_second_however_often_it_is_told(
        self, jobs: Jobs, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        monkeypatch.setattr("app.features.jobs.records.TICK", 0.05)
        heard: list[Job] = []
        jobs.listen(heard.append)

        def work(progress: JobProgress) -> Json:
            began, told = time.monotonic(), 0
            while told < 5000 or time.monotonic() < began + 0.3:
                told += 1
                progress(told)
            return [told, time.monotonic() - began]

        done = jobs.wait(submit(jobs, work).id, SECONDS)
        told, took = done.result
        # Waiting, running, done, and at most one each tick between.
        assert 3 <= len(heard) <= 3 + 1 + took / 0.05
        assert done.done == told


class TestFailure:
    def test_is_told_with_its_hint(self, jobs: Jobs) -> None:
        def work(progress: JobProgress) -> Json:
            raise InputError("nothing to export", hint="Accept a group.", pointer="/all")

        failed = jobs.wait(submit(jobs, work).id, SECONDS)
        assert (failed.state, failed.sentence) == ("failed", "nothing to export")
        assert failed.problem == {
            "detail": "nothing to export",
            "hint": "Accept a group.",
            "pointer": "/all",
        }

    def test_a_bug_in_a_job_shows_no_internals_and_the_next_job_runs(self, jobs: Jobs) -> None:
        def work(progress: JobProgress) -> Json:
            raise ZeroDivisionError("secret")

        with capture_logs() as logs:
            failed = jobs.wait(submit(jobs, work).id, SECONDS)
        assert [entry["event"] for entry in logs] == ["job failed"]
        assert failed.state == "failed"
        assert "secret" not in str(failed)
        assert jobs.wait(submit(jobs, lambda _: 1).id, SECONDS).result == 1


class TestCancel:
    def test_a_cancelled_job_that_waits_never_runs(self, jobs: Jobs) -> None:
        gate, ran = Gate(), []
        submit(jobs, gate)
        assert gate.started.wait(SECONDS)
        waiting = submit(jobs, ran.append)
        assert jobs.cancel(waiting.id).state == "cancelled"
        gate.finish.set()
        assert jobs.wait(submit(jobs, lambda _: None).id, SECONDS).state == "done"
        assert ran == []

    def test_a_cancelled_job_that_runs_ends_at_its_next_step(self, jobs: Jobs) -> None:
        gate = Gate()
        job = submit(jobs, gate)
        assert gate.started.wait(SECONDS)
        jobs.cancel(job.id)
        ended = jobs.wait(job.id, SECONDS)
        assert (ended.state, ended.done, ended.problem) == ("cancelled", 1, None)
        assert jobs.cancel(job.id).state == "cancelled"

    def test_a_finished_job_cannot_be_cancelled(self, jobs: Jobs) -> None:
        job = submit(jobs, lambda _: None)
        jobs.wait(job.id, SECONDS)
        with pytest.raises(ConflictError):
            jobs.cancel(job.id)
        with pytest.raises(NotFoundError):
            jobs.cancel(job.id + 1)

    def test_of_one_that_runs_is_kept_where_the_server_dies_before_its_next_step(
        self, store: Store
    ) -> None:
        dying, later = Jobs(store), Jobs(store)
        started, finish = threading.Event(), threading.Event()

        def take_no_step(_progress: JobProgress) -> Json:
            started.set()
            assert finish.wait(SECONDS)

        job = submit(dying, take_no_step, kind="import")
        assert started.wait(SECONDS)
        dying.cancel(job.id, by="ann")
        later.register_resume("import", lambda _: 7)
        later.start()
        assert later.wait(job.id, SECONDS).state == "cancelled"
        assert later.is_idle()
        finish.set()
        dying.close()

    def test_of_what_ends_with_other_work_is_kept_with_it(self, store: Store) -> None:
        dying, later = Jobs(store), Jobs(store)
        started, finish = threading.Event(), threading.Event()

        def take_no_step(_progress: JobProgress) -> Json:
            started.set()
            assert finish.wait(SECONDS)

        running = submit(dying, take_no_step, kind="import")
        assert started.wait(SECONDS)
        waiting = submit(dying, lambda _: 7, kind="import")
        with store.write() as session:
            dying.cancel_on_commit(session, [running.id, waiting.id])
        later.register_resume("import", lambda _: 7)
        later.start()
        assert [later.get(job.id).state for job in (running, waiting)] == ["cancelled"] * 2
        finish.set()
        dying.close()

    def test_a_record_that_nobody_works_on_is_ended_at_once(self, jobs: Jobs, store: Store) -> None:
        with store.write() as session:
            job = insert_job(session, NewJob("import", "Import", "ann"))
            update_job(session, job, state="running")
        assert jobs.cancel(job, by="ann").state == "cancelled"
        assert jobs.get(job).ended is not None

    def test_all_of_a_dataset_are_ended_and_no_others(self, jobs: Jobs, store: Store) -> None:
        one, other = ensure_dataset(store, "one", "ann"), ensure_dataset(store, "other", "ann")
        gate = Gate()
        running = submit(jobs, gate, dataset_id=one)
        assert gate.started.wait(SECONDS)
        waiting = submit(jobs, lambda _: None, dataset_id=one)
        kept = submit(jobs, lambda _: 7, dataset_id=other)
        jobs.cancel_all(one)
        assert [jobs.get(job.id).state for job in (running, waiting)] == ["cancelled"] * 2
        assert jobs.wait(kept.id, SECONDS).result == 7


class TestEnd:
    @pytest.fixture
    def missed(self, jobs: Jobs, monkeypatch: pytest.MonkeyPatch) -> tuple[Job, Callable[[], None]]:
        """A job that is over and of which that cannot be written, until the function is called."""
        monkeypatch.setattr(module, "END_TRIES", 1)
        monkeypatch.setattr(module, "LOOK_SECONDS", 0.05)
        whole = jobs._save_end

        def fail(*_arguments: Any, **_values: Any) -> Job | None:
            raise StorageError("the disk is full")

        monkeypatch.setattr(jobs, "_save_end", fail)
        job = submit(jobs, lambda _: 7)
        jobs.wait(job.id, SECONDS)
        until(jobs.is_idle)
        assert jobs.get(job.id).state == "running"
        return job, lambda: monkeypatch.setattr(jobs, "_save_end", whole)

    def test_that_cannot_be_written_is_written_later(
        self, jobs: Jobs, missed: tuple[Job, Callable[[], None]]
    ) -> None:
        job, mend = missed
        mend()
        until(lambda: jobs.get(job.id).state == "done")
        assert jobs.get(job.id).result == 7

    def test_that_was_not_written_yet_is_no_job_to_cancel(
        self, jobs: Jobs, missed: tuple[Job, Callable[[], None]]
    ) -> None:
        job, mend = missed
        mend()
        with pytest.raises(ConflictError):
            jobs.cancel(job.id, by="ann")
        assert jobs.get(job.id).state == "done"


def job_that_servers_died_at(store: Store, deaths: int) -> int:
    """A job as servers leave it that end in its midst."""
    with store.write() as session:
        job = insert_job(session, NewJob("import", "Import", "ann"))
    for _ in range(deaths):
        jobs, gate = Jobs(store), Gate()
        jobs.register_resume("import", gate)
        jobs.start()
        assert gate.started.wait(SECONDS)
        # What a server says that is killed: nothing any more.
        jobs._save_columns = lambda *_, **__: None  # type: ignore[method-assign]
        jobs.close()
    return job


class TestRestart:
    def test_a_job_under_way_when_the_server_stopped_fails_with_a_sentence(
        self, store: Store
    ) -> None:
        first, gate = Jobs(store), Gate()
        running = submit(first, gate)
        assert gate.started.wait(SECONDS)
        waiting = submit(first, lambda _: None)
        first.close()
        assert first.get(running.id).state == "running"
        second = Jobs(store)
        second.start()
        for job in (running, waiting):
            found = second.get(job.id)
            assert (found.state, found.ended is not None) == ("failed", True)
            assert found.problem["detail"].startswith("The server stopped")

    def test_who_asked_for_a_job_is_told_that_it_failed_with_the_server(self, store: Store) -> None:
        invite(store, "ann", Role.REVIEWER, actor="local")
        first, gate = Jobs(store), Gate()
        submit(first, gate)
        assert gate.started.wait(SECONDS)
        submit(first, lambda _: None, kind="import")
        first.close()
        second = Jobs(store)
        second.register_resume("import", lambda _: None)
        second._start_workers = lambda: None  # type: ignore[method-assign]
        second.start()
        assert list_sentences_told(store, "ann") == ["Some work: it failed"]

    def test_a_kind_that_knows_how_starts_again_from_what_was_asked_for(self, store: Store) -> None:
        first, gate = Jobs(store), Gate()
        job = submit(first, gate, kind="import", request={"source": 5})
        assert gate.started.wait(SECONDS)
        first.close()
        second = Jobs(store)
        second.register_resume("import", lambda progress: progress.job.request["source"] + 1)
        second.start()
        done = second.wait(job.id, SECONDS)
        assert (done.state, done.result, second.find()) == ("done", 6, [done])
        second.close()

    @pytest.mark.parametrize(("deaths", "state"), [(1, "done"), (2, "failed")])
    def test_a_job_at_which_servers_died_twice_is_left_alone(
        self, store: Store, deaths: int, state: str
    ) -> None:
        job = job_that_servers_died_at(store, deaths)
        later = Jobs(store)
        later.register_resume("import", lambda progress: 7)
        later.start()
        found = later.wait(job, SECONDS)
        assert found.state == state
        if state == "failed":
            assert found.problem["detail"] == (
                "The server crashed 2 times during this job, so it is not started again."
            )
        later.close()

    def test_servers_that_stop_in_good_order_do_not_count(self, store: Store) -> None:
        first, gate = Jobs(store), Gate()
        job = submit(first, gate, kind="import")
        for _ in range(3):
            assert gate.started.wait(SECONDS)
            first.close()
            assert first.get(job.id).tries == 0
            first, gate = Jobs(store), Gate(9)
            first.register_resume("import", gate)
            first.start()
        gate.finish.set()
        assert first.wait(job.id, SECONDS).result == 9
        first.close()

    def test_a_stop_in_good_order_does_not_count_where_the_job_takes_no_step(
        self, store: Store
    ) -> None:
        started, finish = threading.Event(), threading.Event()

        def stuck(progress: JobProgress) -> Json:
            started.set()
            assert finish.wait(SECONDS)
            progress(1)
            return None

        jobs = Jobs(store)
        job = submit(jobs, stuck, kind="import")
        assert started.wait(SECONDS)
        with capture_logs() as logs:
            jobs.close(0.05)
        assert [entry["event"] for entry in logs] == ["a job did not end in time"]
        assert jobs.get(job.id).tries == 0
        finish.set()
        until(jobs.is_idle)
        assert jobs.get(job.id).tries == 0

    def test_finished_jobs_stay_as_they_were_after_a_restart(
        self, jobs: Jobs, store: Store
    ) -> None:
        done = jobs.wait(submit(jobs, lambda _: 1).id, SECONDS)
        second = Jobs(store)
        second.start()
        assert second.get(done.id) == done

    def test_old_ones_are_forgotten_only_where_they_are_many(
        self, jobs: Jobs, store: Store, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        monkeypatch.setattr(module, "KEPT", {"solve": 2})
        kinds = ["solve", "export", "solve", "solve", "export"]
        for kind in kinds:
            jobs.wait(submit(jobs, lambda _: None, kind=kind).id, SECONDS)
        Jobs(store).start()
        assert [job.kind for job in jobs.find()] == ["export", "solve", "solve", "export"]


class TestClose:
    def test_ends_a_long_run_at_its_next_step(self, store: Store) -> None:
        jobs, ended = Jobs(store), threading.Event()

        def endless(progress: JobProgress) -> Json:
            try:
                while True:
                    progress(1)
            except JobCancelled:
                ended.set()
                raise

        job = submit(jobs, endless)
        until(lambda: jobs.get(job.id).state == "running")
        jobs.close()
        assert ended.is_set()


class TestFind:
    def test_gives_the_newest_first_page_by_page(self, jobs: Jobs, store: Store) -> None:
        one = ensure_dataset(store, "one", "ann")
        made = [submit(jobs, lambda _: None, dataset_id=one).id for _ in range(2)]
        last = submit(jobs, lambda _: None, kind="export")
        jobs.wait(last.id, SECONDS)
        assert [job.id for job in jobs.find()] == [last.id, *made[::-1]]
        assert [job.id for job in jobs.find(dataset_id=one, limit=1)] == [made[1]]
        assert [job.id for job in jobs.find(before=made[1])] == [made[0]]
        assert [job.id for job in jobs.find(kinds=["export"])] == [last.id]
        assert jobs.find(states=["failed"]) == []


class TestUnderWay:
    def test_gives_the_oldest_first_of_those_that_are_not_over(
        self, jobs: Jobs, store: Store
    ) -> None:
        one, other = (ensure_dataset(store, name, "ann") for name in ("one", "other"))
        jobs.wait(submit(jobs, lambda _: None, dataset_id=one).id, SECONDS)
        held = threading.Event()
        try:
            made = [submit(jobs, lambda _: held.wait(SECONDS), dataset_id=one).id for _ in "ab"]
            last = submit(jobs, lambda _: None, dataset_id=other).id
            assert [job.id for job in jobs.open_jobs(None, EVERYTHING)] == [*made, last]
            assert [job.id for job in jobs.open_jobs(one, EVERYTHING)] == made
            assert jobs.open_jobs(None, Visibility(all_but=False)) == []
        finally:
            held.set()
