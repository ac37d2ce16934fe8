"""Jobs: work that outlasts a request is asked for, waited for and cancelled; ``runner`` runs it."""

from __future__ import annotations

from collections.abc import Collection, Iterable
from contextlib import ExitStack, nullcontext, suppress
from dataclasses import replace

from app.db.json_columns import Json
from app.db.session import Session, now
from app.db.store import Store
from app.errors import ConflictError, NotFoundError, OverloadedError
from app.features.audit.service import log_job_request
from app.features.jobs.job_run import JobProgress, JobRun, Work
from app.features.jobs.queries import (
    CANCELLED,
    DONE,
    FAILED,
    OPEN,
    Job,
    NewJob,
    insert_job,
    read_job,
    update_job,
)
from app.features.jobs.records import Then, record_cancellation, require_job
from app.features.jobs.runner import CLOSE_SECONDS, JobRunner, Pool

CAPACITY = 32
"""Jobs that may wait; one more is told to come back."""
LEFT_TO_OTHERS = 4
"""One person leaves this part of the waiting places (one of so many) to others."""
WAIT_FOR_JOB = "Wait until it ends (page Jobs), then try again."


def require_not_over(job: Job) -> None:
    """Raise ConflictError where a job is done or failed."""
    if job.state in (DONE, FAILED):
        raise ConflictError(f"job {job.id} has already ended")


def is_same_request(job: Job, new: NewJob) -> bool:
    """Whether a job is its maker's and asks for the same as a new one."""
    return job.actor == new.actor and job.request == new.request


class Jobs(JobRunner):
    """The jobs of one server, as other features ask for them."""

    def __init__(self, store: Store, *, capacity: int = CAPACITY, pool: Pool = nullcontext):
        super().__init__(store, pool)
        self._capacity = capacity

    def submit(
        self,
        kind: str,
        title: str,
        work: Work,
        *,
        dataset_id: int | None = None,
        actor: str,
        request: Json = None,
        once: bool = False,
        follows: bool = False,
        then: Then = Session.respond,
    ) -> Job:
        """Queue work; not to be called inside a transaction.

        Args:
            kind: What it is, for programs.
            title: What it is, for people.
            work: Does it.
            dataset_id: The dataset that it belongs to.
            actor: Who wants it.
            request: What was asked for; a kind that is resumed finds its way from it.
            once: Where a job of this kind waits for this dataset already, answer that one; without
                a dataset one's own that was asked for the same, for nobody sees another person's.
            follows: It goes on with a job that ends now, whose place it takes: it needs no room.
            then: Ends the transaction; default: the request is answered with the job.

        Raises:
            OverloadedError: Too many jobs wait.
        """
        new = NewJob(kind, title, actor, dataset_id, request)
        with ExitStack() as entry, self._store.write() as session:
            # Others that enter wait for the write lock, so that none of them is counted twice.
            enter = entry.enter_context(self._hold_start_until_recorded())
            known = self._find_waiting_job(session, new) if once else None
            if not once and not follows:
                self._require_queue_room(session, actor)
            job = require_job(session, insert_job(session, new) if known is None else known)
            if known is None:
                log_job_request(session, actor, job.id, kind, title, dataset_id)
            then(session, job)
            if known is None:
                enter(JobRun(work, JobProgress(job, self._closing)))
        if known is not None:
            return job
        self._announce_job_change(job)
        return job

    def cancel(self, job_id: int, *, by: str | None = None) -> Job:
        """End a job: one that runs at its next step, any other at once.

        Args:
            job_id: Which.
            by: Who asks for it, as the log says; the request is answered with the job. None: it
                ends with other work.

        Raises:
            NotFoundError: There is none of that id.
            ConflictError: It is done or failed already.
        """
        self._write_missed_ends()
        job = self.get(job_id)
        require_not_over(job)
        with self._changed:
            run = next((item for item in self._queue.waiting if item.job.id == job_id), None)
            running = self._queue.find_running(job_id)
            if run is not None:
                self._queue = self._queue.without_run(run)
            elif running is not None:
                running.progress.cancelled.set()
        if run is not None:
            sentence = "Cancelled before it began."
            return self._record_end(run, by, state=CANCELLED, sentence=sentence) or self.get(job_id)
        if by is None and (running is not None or job.state not in OPEN):
            return self.get(job_id)
        with self._store.write() as session:
            job = require_job(session, job_id)
            require_not_over(job)
            if job.state in OPEN:
                # The next server ends it where this one dies before the next step.
                ended = {"state": CANCELLED, "ended": now(), "sentence": "Cancelled."}
                update_job(session, job_id, **(ended if running is None else {"ending": True}))
            job = record_cancellation(session, require_job(session, job_id), by)
        self._announce_job_change(job)
        return job

    def set_dataset(self, job_id: int, dataset_id: int) -> None:
        """Note whose a running job is, where its dataset came to be while it ran."""
        self._save_columns(job_id, dataset_id=dataset_id)
        running = self._queue.find_running(job_id)
        if running is not None:
            running.progress.job = replace(running.job, dataset_id=dataset_id)

    def list_open_job_ids(self, dataset_id: int, *kinds: str) -> list[int]:
        """Ids of a dataset's jobs that wait or run here, of some kinds or, without any, of all.

        Within a write transaction that stays true to its end. A record that is open and that
        nobody works on is none.
        """
        return [
            run.job.id
            for run in self._queue.all_runs
            if run.job.dataset_id == dataset_id and (not kinds or run.job.kind in kinds)
        ]

    def cancel_on_commit(self, session: Session, ids: Collection[int]) -> None:
        """Let jobs write nothing more, nor begin, once a transaction is kept."""
        for number in ids:
            job = read_job(session, number)
            if job is not None and job.state in OPEN:
                update_job(session, number, ending=True)
        session.call_after_commit(lambda: self.signal_cancel(ids))

    def signal_cancel(self, ids: Collection[int]) -> None:
        """Let jobs write nothing more, nor begin: without asking the database, so that it can be
        called when a transaction is kept (``Session.call_after_commit``)."""
        for run in self._queue.all_runs:
            if run.job.id in ids:
                run.progress.cancelled.set()

    def cancel_each(self, ids: Iterable[int]) -> None:
        """End jobs as far as they are not over, and wait for nothing."""
        for number in ids:
            with suppress(ConflictError, NotFoundError):
                self.cancel(number)

    def cancel_kind(self, dataset_id: int, *kinds: str) -> None:
        """End a dataset's jobs of some kinds, or of all where none is named, and wait for nothing.

        Work that asks ``JobProgress.require_not_cancelled`` in its transactions writes nothing in any
        that begins after this.
        """
        self.cancel_each(self.list_open_job_ids(dataset_id, *kinds))

    def cancel_all(self, dataset_id: int) -> None:
        """End all jobs of a dataset and wait until none of them runs any more.

        Raises:
            ConflictError: One that runs has not ended in time.
        """
        self.cancel_kind(dataset_id)
        for run in self._queue.running:
            if run.job.dataset_id == dataset_id and not run.over.wait(CLOSE_SECONDS):
                raise ConflictError(
                    f"job {run.job.id} of this dataset did not stop in time", hint=WAIT_FOR_JOB
                )

    def wait(self, job_id: int, seconds: float) -> Job:
        """A job once it is over, or as it stands after some seconds."""
        run = next((item for item in self._queue.all_runs if item.job.id == job_id), None)
        if run is not None:
            run.over.wait(seconds)
        return self.get(job_id)

    def is_open(self, job_id: int, kind: str) -> bool:
        """Whether a job of a kind waits or runs here; waits for nothing."""
        return any((run.job.id, run.job.kind) == (job_id, kind) for run in self._queue.all_runs)

    def _find_waiting_job(self, session: Session, new: NewJob) -> int | None:
        """Id of the waiting job of a kind and dataset; without a dataset see ``is_same_request``."""
        for run in self._queue.waiting:
            if (run.job.kind, run.job.dataset_id) == (new.kind, new.dataset_id) and (
                new.dataset_id is not None or is_same_request(require_job(session, run.job.id), new)
            ):
                return run.job.id
        return None

    def _require_queue_room(self, session: Session, actor: str) -> None:
        waiting = self._list_actors_of_waiting_jobs(session)
        own = waiting.count(actor)
        if len(waiting) >= self._capacity:
            raise OverloadedError(
                f"{len(waiting)} jobs wait already", hint="Send it again in a while."
            )
        if own >= self._capacity - self._capacity // LEFT_TO_OTHERS:
            raise OverloadedError(
                f"{own} of your jobs are already waiting",
                hint="Send it again when some of them are done.",
            )

    def _list_actors_of_waiting_jobs(self, _session: Session) -> list[str]:
        """The person who requested each waiting job."""
        return [run.job.actor for run in self._queue.waiting]
