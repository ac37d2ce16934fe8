"""Jobs of several processes: what a row says counts, whoever wrote it, and a claim that is lost ends them."""

from __future__ import annotations

import threading
from collections.abc import Callable, Iterator

import pytest

from app.db.store import Store
from app.errors import ConflictError, JobCancelled
from app.features.jobs.job_run import JobProgress
from app.features.jobs.queries import Job, NewJob, insert_job, update_job
from app.features.jobs.shared import SharedJobs
from app.features.people.roles import Role
from app.features.people.service import invite
from tests.unit.features.jobs.steps import list_sentences_told
from tests.waiting import SECONDS


class Claims:
    """Claims as several processes have them; here a test says who has which."""

    is_shared = True

    def __init__(self) -> None:
        self.free = True
        self.words: list[str] = []

    def claim(self, name: str) -> bool:
        return self.free

    def holds(self, name: str) -> bool:
        return self.free

    def release(self, name: str) -> None:
        """It is free."""

    def publish(self, session: object, word: str) -> None:
        self.words.append(word)

    def subscribe(self, hearer: Callable[[str], None]) -> None:
        """Nobody says anything: what a row says must be enough."""

    def listen(self) -> None:
        """See ``hear``."""

    def close(self) -> None:
        """Nothing is open."""


class Work:
    """Work that waits in its step until it is let go, and counts how often it was begun."""

    def __init__(self, *, looks: bool = True) -> None:
        self._looks = looks
        self.begun, self.go_on = threading.Semaphore(0), threading.Semaphore(0)
        self.times = 0

    def __call__(self, progress: JobProgress) -> str:
        self.times += 1
        self.begun.release()
        assert self.go_on.acquire(timeout=SECONDS)
        if self._looks:
            progress.require_not_cancelled()
            progress(1, 1)
        return "done"


@pytest.fixture
def claims(store: Store, monkeypatch: pytest.MonkeyPatch) -> Claims:
    claims = Claims()
    monkeypatch.setattr(store, "sharing", claims)
    monkeypatch.setattr("app.features.jobs.shared.LOOK_SECONDS", 0.05)
    return claims


@pytest.fixture
def work() -> Work:
    return Work()


Open = Callable[..., SharedJobs]


@pytest.fixture
def opened(store: Store, claims: Claims, work: Work) -> Iterator[Open]:
    """The jobs of another process each time."""
    opened: list[SharedJobs] = []

    def make(own: Work = work) -> SharedJobs:
        jobs = SharedJobs(store)
        # As if it had been started when another one led.
        jobs._alone = False
        jobs.register_resume("solve", own)
        opened.append(jobs)
        return jobs

    yield make
    for _ in range(10):
        work.go_on.release()
    for jobs in opened:
        jobs.close()


def ask(jobs: SharedJobs) -> Job:
    return jobs.submit("solve", "Solve", lambda _progress: "never called", actor="ann")


class TestSharedJobs:
    def test_work_is_made_from_the_row_by_who_leads(self, opened: Open, work: Work) -> None:
        asked, leads = opened(), opened()
        job = ask(asked)
        leads.start()
        work.go_on.release()
        assert (asked.wait(job.id, SECONDS).result, asked.is_leader()) == ("done", False)
        # Whoever has read it when it waited may not begin it again.
        leads._enqueue_job(job)
        work.go_on.release()
        work.go_on.release()
        assert leads.wait(ask(asked).id, SECONDS).state == "done"
        assert work.times == 2

    def test_what_waits_ends_at_once_whoever_was_asked(self, opened: Open, work: Work) -> None:
        asked, leads = opened(), opened()
        job = asked.cancel(ask(asked).id)
        assert job.state == "cancelled"
        leads.start()
        second = ask(asked)
        work.go_on.release()
        assert leads.wait(second.id, SECONDS).state == "done"
        assert work.times == 1

    def test_a_record_that_nobody_works_on_is_ended_by_who_leads(
        self, opened: Open, work: Work, store: Store
    ) -> None:
        asked, leads = opened(), opened()
        leads.start()
        with store.write() as session:
            job = insert_job(session, NewJob("solve", "Solve", "ann"))
            update_job(session, job, state="running")
        asked.cancel(job, by="ann")
        assert leads.wait(job, SECONDS).state == "cancelled"

    def test_a_job_whose_start_was_kept_though_its_answer_was_lost_is_begun_again_by_who_leads(
        self, opened: Open, work: Work, store: Store
    ) -> None:
        leads = opened()
        leads.start()
        with store.write() as session:
            job = insert_job(session, NewJob("solve", "Solve", "ann"))
            update_job(session, job, state="running", begun=1)
        assert work.begun.acquire(timeout=SECONDS)
        work.go_on.release()
        assert leads.wait(job, SECONDS).state == "done"

    def test_what_runs_writes_nothing_after_it_was_told_to_end_elsewhere(
        self, store: Store, opened: Open, work: Work
    ) -> None:
        asked, leads = opened(), opened()
        leads.start()
        job = ask(asked)
        assert work.begun.acquire(timeout=SECONDS)
        with store.write() as session:
            asked.cancel_on_commit(session, [job.id])
        # The row alone says so: no look has passed, and no word was heard.
        work.go_on.release()
        assert asked.wait(job.id, SECONDS).state == "cancelled"
        with pytest.raises(ConflictError):
            update_and_cancel(store, asked, job.id)

    def test_who_lost_the_claim_ends_and_the_next_one_begins_it_again(
        self, claims: Claims, opened: Open, work: Work
    ) -> None:
        unaware = Work(looks=False)
        first, second = opened(unaware), opened()
        first.start()
        job = ask(first)
        assert unaware.begun.acquire(timeout=SECONDS)
        claims.free = False
        first._try_to_lead()
        assert not first.is_leader()
        first._ended.set()
        claims.free = True
        second.start()
        assert work.begun.acquire(timeout=SECONDS)
        # Both are at it; what the first comes to is not kept.
        (run,) = first._queue.all_runs
        unaware.go_on.release()
        assert run.over.wait(SECONDS)
        assert second.get(job.id).state == "running"
        work.go_on.release()
        assert second.wait(job.id, SECONDS).state == "done"

    def test_who_lost_the_claim_ends_at_its_next_step_and_counts_for_no_death(
        self, claims: Claims, opened: Open, work: Work
    ) -> None:
        jobs = opened()
        jobs.start()
        job = ask(jobs)
        assert work.begun.acquire(timeout=SECONDS)
        (run,) = jobs._queue.all_runs
        claims.free = False
        jobs._try_to_lead()
        work.go_on.release()
        assert run.over.wait(SECONDS)
        assert (jobs.get(job.id).state, jobs.get(job.id).tries) == ("running", 0)

    def test_one_that_waits_is_answered_again_by_any_process(self, opened: Open) -> None:
        one, other = opened(), opened()
        first = one.submit("solve", "Solve", lambda _: None, actor="ann", once=True)
        again = other.submit("solve", "Solve", lambda _: None, actor="ann", once=True)
        elses = other.submit("solve", "Solve", lambda _: None, actor="ben", once=True)
        assert (again.id, elses.id == first.id) == (first.id, False)

    def test_one_is_answered_only_where_it_was_asked_for_the_same(self, opened: Open) -> None:
        one, other = opened(), opened()
        first, second, again = (
            jobs.submit(
                "solve", "Solve", lambda _: None, actor="ann", request={"again": wanted}, once=True
            )
            for jobs, wanted in ((one, False), (other, True), (other, False))
        )
        assert (first.id, second.request) == (again.id, {"again": True})

    def test_who_asked_for_a_job_of_a_process_that_died_is_told_that_it_failed(
        self, opened: Open, store: Store
    ) -> None:
        invite(store, "ann", Role.REVIEWER, actor="local")
        with store.write() as session:
            job = insert_job(session, NewJob("bulk", "Accept", "ann"))
            update_job(session, job, state="running")
        jobs = opened()
        jobs.start()
        assert jobs.get(job).state == "failed"
        assert list_sentences_told(store, "ann") == ["Accept: it failed"]

    def test_a_row_that_no_work_can_be_made_of_holds_up_nothing(
        self, opened: Open, work: Work
    ) -> None:
        jobs = opened()
        jobs.register_work("bulk", lambda progress: progress.job.request["nothing of the kind"])
        spoiled = jobs.submit("bulk", "Accept", lambda _: None, actor="ann")
        jobs.start()
        work.go_on.release()
        assert jobs.wait(ask(jobs).id, SECONDS).state == "done"
        assert jobs.get(spoiled.id).state == "failed"


def update_and_cancel(store: Store, jobs: SharedJobs, number: int) -> None:
    with store.write() as session:
        update_job(session, number, state="done")
    jobs.cancel(number)


def test_a_progress_whose_claim_is_lost_wants_nothing(store: Store, opened: Open) -> None:
    from app.features.jobs.shared import SharedProgress

    lost = threading.Event()
    progress = SharedProgress(ask(opened()), lost, store)
    progress.require_not_cancelled()
    lost.set()
    with pytest.raises(JobCancelled):
        progress.require_not_cancelled()
