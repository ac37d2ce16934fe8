"""Whose job is next, and where it runs: small work here, other work in a worker process.

Solving goes first, then person by person; an export or a freeze runs beside another dataset's job.
"""

from __future__ import annotations

import os
import signal
import threading
from collections.abc import Iterator
from typing import Any

import pytest

from app.db.database_worker import ServerProxy
from app.db.store import Store
from app.errors import InputError, JobCancelled, OverloadedError
from app.features.datasets.service import dataset_id
from app.features.imports.ingest import ensure_dataset
from app.features.jobs import job_run as module
from app.features.jobs.job_run import JobProgress, run_job_in_worker
from app.features.jobs.service import Jobs
from tests.unit.features.jobs.steps import Gate, a_job, submit
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

    @pytest.mark.parametrize("kind", ["export", "freeze"])
    def test_exports_and_freezing_wait_for_nothing_of_another_dataset(
        self, jobs: Jobs, store: Store, kind: str
    ) -> None:
        demo, other = (ensure_dataset(store, name, "ann") for name in ("demo", "other"))
        long, order = Gate(), list[str]()
        one = submit(jobs, long, dataset_id=demo, kind="import")
        assert long.started.wait(SECONDS)
        own = submit(jobs, lambda _: order.append("own"), dataset_id=demo, kind=kind)
        free = submit(jobs, lambda _: order.append("free"), dataset_id=other, kind=kind)
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
        with pytest.raises(OverloadedError, match="6 of your jobs are already waiting"):
            submit(jobs, lambda _: None)
        jobs.submit("bulk", "Some work", lambda _: None, actor="bob")
        first.finish.set()
        jobs.close()


def number_of_process(_store: Store, caller: ServerProxy) -> int:
    caller(1, 2, "counting")
    caller(2)
    return os.getpid()


def ask(_store: Store, question: str, caller: ServerProxy) -> Any:
    return caller.ask(question)


def step_for_ever(_store: Store, caller: ServerProxy) -> None:
    for number in range(10_000_000):
        caller(number)


def be_refused(_store: Store, _caller: ServerProxy) -> None:
    raise InputError("there is nothing to count")


def break_down(*_: object) -> None:
    os.abort()


def be_told_to_end(*_: object) -> None:
    os.kill(os.getpid(), signal.SIGTERM)


def have_no_process(*_: object) -> None:
    raise OverloadedError("no process could be started for this")


@pytest.fixture
def own(store: Store, fill: Any, make_group: Any) -> int:
    """Id of a dataset with two groups."""
    fill(make_group(7), make_group(8), solved=False)
    return dataset_id(store, "demo")


@pytest.fixture
def large(monkeypatch: pytest.MonkeyPatch) -> None:
    """Every dataset with a group is large."""
    monkeypatch.setattr(module, "SMALL", 0)


def progress() -> JobProgress:
    return JobProgress(a_job(), threading.Event())


def run_job(store: Store, work: Any, *arguments: Any, **options: Any) -> Any:
    told = {"progress": progress(), **options}
    return run_job_in_worker(store, "exports", "the export", work, *arguments, **told)


class TestRunJobInWorker:
    def test_what_is_small_is_done_here(self, store: Store, own: int) -> None:
        told = progress()
        done = run_job(store, number_of_process, dataset_id=own, progress=told)
        assert done == os.getpid()
        assert told.place == (2, 2, "counting")

    @pytest.mark.usefixtures("large")
    def test_what_is_large_is_done_by_another_process(self, store: Store, own: int) -> None:
        told = progress()
        done = run_job(store, number_of_process, dataset_id=own, progress=told)
        assert done != os.getpid()
        assert told.place == (2, 2, "counting")

    def test_so_is_what_is_of_no_dataset(self, store: Store) -> None:
        assert run_job(store, number_of_process, dataset_id=None) != os.getpid()

    @pytest.mark.parametrize("small", [True, False])
    def test_questions_are_answered_by_this_process(
        self, store: Store, own: int, small: bool
    ) -> None:
        def answer(question: str) -> tuple[str, int]:
            return question, os.getpid()

        answered = run_job(store, ask, "who", dataset_id=own if small else None, answer=answer)
        assert answered == ("who", os.getpid())

    @pytest.mark.parametrize("small", [True, False])
    def test_what_it_refuses_is_the_jobs_failure(self, store: Store, own: int, small: bool) -> None:
        with pytest.raises(InputError, match="nothing to count"):
            run_job(store, be_refused, dataset_id=own if small else None)

    @pytest.mark.parametrize("small", [True, False])
    def test_who_cancels_it_ends_it(self, store: Store, own: int, small: bool) -> None:
        told = progress()
        ended: list[BaseException] = []

        def run() -> None:
            try:
                place = own if small else None
                run_job(store, step_for_ever, dataset_id=place, progress=told)
            except JobCancelled as error:
                ended.append(error)

        running = threading.Thread(target=run)
        running.start()
        told.cancelled.set()
        running.join(SECONDS)
        assert len(ended) == 1

    def test_one_that_breaks_down_is_a_sentence(self, store: Store) -> None:
        with pytest.raises(OverloadedError, match=r"^the process of the export crashed$"):
            run_job(store, break_down, dataset_id=None)

    @pytest.mark.parametrize("end", [break_down, be_told_to_end, have_no_process])
    def test_one_that_ends_before_its_server_is_told_to_stop_goes_on_with_the_next(
        self, store: Store, end: Any
    ) -> None:
        closing = threading.Event()
        threading.Timer(0.5, closing.set).start()
        with pytest.raises(JobCancelled):
            run_job(store, end, dataset_id=None, progress=JobProgress(a_job(), closing))

    def test_one_that_was_told_to_end_is_a_sentence_that_says_so(
        self, store: Store, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        monkeypatch.setattr(module, "STOP_SECONDS", 0.0)
        with pytest.raises(OverloadedError, match=r"^the process of the export was stopped$"):
            run_job(store, be_told_to_end, dataset_id=None)
