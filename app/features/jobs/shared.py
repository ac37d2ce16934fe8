"""Jobs of several processes over one database: any of them is asked, one of them carries them out.

Who carries out holds a claim, which ends with its process; the next one takes up what it was at. What
waits, what runs and what shall end is read from the rows alone: a row is begun by whoever changes it
from waiting to running, within the write lock.
"""

from __future__ import annotations

import threading
import time
from collections.abc import Callable, Collection, Iterator
from contextlib import contextmanager, nullcontext
from typing import Any

import structlog

from app.db.session import Session, now
from app.db.store import Store
from app.errors import ConflictError, JobCancelled, ReviewError, StorageError
from app.features.jobs.job_run import JobProgress, JobRun, Work
from app.features.jobs.queries import (
    CANCELLED,
    OPEN,
    RUNNING,
    WAITING,
    Job,
    NewJob,
    delete_oldest_jobs,
    is_cancellation_requested,
    list_job_ids_of_dataset,
    read_job,
    read_jobs,
    update_job,
)
from app.features.jobs.records import record_cancellation, require_job
from app.features.jobs.runner import CLOSE_SECONDS, KEPT, Pool
from app.features.jobs.service import WAIT_FOR_JOB, Jobs, is_same_request, require_not_over

log = structlog.get_logger("touchline.jobs")

CLAIM = "jobs"
LOOK_SECONDS = 1.0
"""Between two looks for what no word came of, and whether whoever carries out jobs still lives."""
POLL_SECONDS = 0.05
MOST = 10_000
_WORD = "job"


class SharedProgress(JobProgress):
    """A progress of which another process may say that its work shall end."""

    def __init__(self, job: Job, closing: threading.Event, store: Store):
        super().__init__(job, closing)
        self._store = store

    def require_not_cancelled(self) -> None:
        """See ``JobProgress``. In a write transaction the answer stays true to its end."""
        super().require_not_cancelled()
        if self._closing.is_set():
            # Another process may carry it out by now.
            raise JobCancelled
        with self._store.read_for_one_statement() as session:
            if is_cancellation_requested(session, self.job_id):
                self.cancelled.set()
        super().require_not_cancelled()


class SharedJobs(Jobs):
    """The jobs of a database that several processes serve."""

    def __init__(self, store: Store, *, pool: Pool = nullcontext):
        super().__init__(store, pool=pool)
        self._makers: dict[str, Work] = {}
        self._look, self._ended = threading.Event(), threading.Event()
        self._lost: threading.Event | None = None
        """Set once the claim is lost; None: it is another's."""
        self._leader: threading.Thread | None = None
        self._alone = True
        """Before the start no other process knows of this one: what it is asked for it does itself."""

    def register_work(self, kind: str, work: Work) -> None:
        """See ``Jobs``."""
        self._makers[kind] = work

    def register_resume(self, kind: str, work: Work) -> None:
        """See ``Jobs``."""
        super().register_resume(kind, work)
        self.register_work(kind, work)

    def is_leader(self) -> bool:
        """See ``Jobs``."""
        return self._lost is not None

    def start(self) -> None:
        """Carry out jobs from when no other process does."""
        self._alone = False
        self._store.sharing.subscribe(self._receive_notification)
        self._try_to_lead()
        self._leader = threading.Thread(target=self._watch_jobs, name="leader", daemon=True)
        self._leader.start()

    def stop(self) -> None:
        """See ``Jobs``."""
        self._ended.set()
        self._look.set()
        if self._lost is not None:
            self._lost.set()
        super().stop()

    def close(self, seconds: float = CLOSE_SECONDS) -> None:
        """See ``Jobs``; another process goes on."""
        until = time.monotonic() + seconds
        self.stop()
        if self._leader is not None:
            self._leader.join(seconds)
        super().close(max(until - time.monotonic(), 0.0))
        self._store.sharing.release(CLAIM)

    def cancel(self, job_id: int, *, by: str | None = None) -> Job:
        """See ``Jobs``."""
        with self._store.write() as session:
            require_not_over(require_job(session, job_id))
            self._request_cancellation(session, [job_id])
            job = record_cancellation(session, require_job(session, job_id), by)
        self._announce_job_change(job)
        return job

    def list_open_job_ids(self, dataset_id: int, *kinds: str) -> list[int]:
        """See ``Jobs``; whichever process works on them."""
        with self._store.read_for_one_statement() as session:
            return list_job_ids_of_dataset(session, dataset_id, kinds, OPEN)

    def cancel_on_commit(self, session: Session, ids: Collection[int]) -> None:
        """See ``Jobs``."""
        self._request_cancellation(session, ids)

    def signal_cancel(self, ids: Collection[int]) -> None:
        """See ``Jobs``."""
        self.cancel_each(ids)

    def cancel_all(self, dataset_id: int) -> None:
        """See ``Jobs``."""
        self.cancel_kind(dataset_id)
        until = time.monotonic() + CLOSE_SECONDS
        while left := self._list_running_job_ids(dataset_id):
            if time.monotonic() > until:
                raise ConflictError(
                    f"job {left[0]} of this dataset did not stop in time", hint=WAIT_FOR_JOB
                )
            time.sleep(POLL_SECONDS)

    def wait(self, job_id: int, seconds: float) -> Job:
        """See ``Jobs``."""
        until = time.monotonic() + seconds
        while (job := self.get(job_id)).state in OPEN and time.monotonic() < until:
            time.sleep(POLL_SECONDS)
        return job

    def is_open(self, job_id: int, kind: str) -> bool:
        """See ``Jobs``; asks the database."""
        with self._store.read_for_one_statement() as session:
            job = read_job(session, job_id)
        return job is not None and job.kind == kind and job.state in OPEN

    def _list_running_job_ids(self, dataset_id: int) -> list[int]:
        with self._store.read_for_one_statement() as session:
            return list_job_ids_of_dataset(session, dataset_id, (), (RUNNING,))

    def _request_cancellation(self, session: Session, ids: Collection[int]) -> None:
        """End what waits, and let what runs see that it shall end."""
        for number in ids:
            job = read_job(session, number)
            if job is not None and job.state == WAITING:
                sentence = "Cancelled before it began."
                update_job(session, number, state=CANCELLED, ended=now(), sentence=sentence)
            elif job is not None and job.state == RUNNING:
                update_job(session, number, ending=True)

    # What a row says is told to all, and heard from all.

    def _announce_job_change(self, job: Job) -> None:
        super()._announce_job_change(job)
        self._apply_job_row(job)
        try:
            self._store.publish(f"{_WORD} {job.id}")
        except StorageError as error:
            log.warning(
                "other processes were not notified of a job", job=job.id, error=error.message
            )

    def _receive_notification(self, word: str) -> None:
        kind, _, number = word.partition(" ")
        if kind != _WORD:
            return
        with self._store.read_for_one_statement() as session:
            job = read_job(session, int(number))
        if job is not None:
            super()._announce_job_change(job)
            self._apply_job_row(job)

    def _apply_job_row(self, job: Job) -> None:
        """Do what the row of a job asks for."""
        self._apply_cancellation(job)
        if job.state == WAITING:
            self._look.set()

    # Who carries out.

    def _watch_jobs(self) -> None:
        while not self._ended.is_set():
            self._look.wait(LOOK_SECONDS)
            self._look.clear()
            if not self._ended.is_set():
                self._try_to_lead()

    def _try_to_lead(self) -> None:
        try:
            self._claim_leadership()
        except ReviewError as error:
            log.warning("jobs could not be looked after", error=error.message)
        except Exception:
            log.exception("jobs could not be looked after")

    def _claim_leadership(self) -> None:
        sharing = self._store.sharing
        if self._lost is None:
            if not sharing.claim(CLAIM):
                return
            try:
                self._take_over_open_jobs()
            except BaseException:
                sharing.release(CLAIM)
                raise
            self._lost = threading.Event()
            log.info("this process carries out jobs")
            for begin in self._beginners:
                begin()
        if not sharing.holds(CLAIM):
            self._give_up_leadership()
            return
        self._enqueue_waiting_jobs()

    def _give_up_leadership(self) -> None:
        """Let another process go on: the connection that held the claim is gone."""
        log.warning("this process no longer carries out jobs")
        lost, self._lost = self._lost, None
        with self._changed:
            for run in self._queue.waiting:
                self._queue = self._queue.without_run(run)
            self._unwritten = {}
            if lost is not None:
                lost.set()

    def _take_over_open_jobs(self) -> None:
        """Settle what a process that died was at; what waits is begun as its turn comes."""
        with self._store.write() as session:
            for kind, keep in KEPT.items():
                delete_oldest_jobs(session, kind, keep)
            for job in read_jobs(session, states=(RUNNING,), limit=MOST):
                self._recover_job(session, job)

    def _enqueue_waiting_jobs(self) -> None:
        with self._store.read_for_one_statement() as session:
            rows = read_jobs(session, states=OPEN, limit=MOST)
        for job in reversed(rows):
            self._apply_cancellation(job)
            if job.state == RUNNING and self._queue.find_running(job.id) is None:
                self._settle_job_without_run(job.id)
            if job.state == WAITING and all(run.job.id != job.id for run in self._queue.all_runs):
                self._enqueue_job(job)

    def _settle_job_without_run(self, job_id: int) -> None:
        """Settle a job that runs by its row alone: its start was kept though the answer to it was lost,
        or its end could not be written."""
        with self._writing_ends:
            if job_id in self._unwritten:
                return
            with self._store.write() as session:
                job = read_job(session, job_id)
                if (
                    job is None
                    or job.state != RUNNING
                    or self._queue.find_running(job_id) is not None
                ):
                    return
                self._recover_job(session, job)
                job = require_job(session, job_id)
        self._announce_job_change(job)

    def _apply_cancellation(self, job: Job) -> None:
        run = self._queue.find_running(job.id)
        if job.ending and run is not None:
            run.progress.cancelled.set()

    def _enqueue_job(self, job: Job) -> None:
        lost = self._lost
        work = self._makers.get(job.kind)
        if lost is None or work is None:
            return
        run = JobRun(work, SharedProgress(job, lost, self._store))
        with self._changed:
            self._queue = self._queue.with_waiting_runs(run)
            self._start_workers()

    @contextmanager
    def _hold_start_until_recorded(self) -> Iterator[Callable[[JobRun], None]]:
        """Lets a job in by its row alone."""
        if self._alone:
            with super()._hold_start_until_recorded() as enter:
                yield enter
            return
        yield self._require_known_work
        self._look.set()

    def _require_known_work(self, run: JobRun) -> None:
        if run.job.kind not in self._makers:
            raise RuntimeError(f"no process can run jobs of the kind {run.job.kind}")

    def _find_waiting_job(self, session: Session, new: NewJob) -> int | None:
        """See ``Jobs``."""
        for job in reversed(read_jobs(session, kinds=[new.kind], states=(WAITING,), limit=MOST)):
            same = new.dataset_id is not None or is_same_request(job, new)
            if job.dataset_id == new.dataset_id and same:
                return job.id
        return None

    def _list_actors_of_waiting_jobs(self, session: Session) -> list[str]:
        """See ``Jobs``."""
        return [job.actor for job in read_jobs(session, states=(WAITING,), limit=MOST)]

    def _record_start(self, run: JobRun) -> bool:
        """See ``Jobs``: another process may have ended or begun it."""
        with self._store.write() as session:
            job = read_job(session, run.job.id)
            if job is None or job.state != WAITING or not (self._alone or self.is_leader()):
                return False
            update_job(session, run.job.id, state=RUNNING, started=now(), begun=1)
            job = require_job(session, run.job.id)
        self._announce_job_change(job)
        return True

    def _write_missed_ends(self) -> None:
        """See ``Jobs``."""
        if self._alone or self.is_leader():
            super()._write_missed_ends()

    def _record_end(self, run: JobRun, by: str | None = None, **values: Any) -> Job | None:
        if self._alone or self.is_leader():
            return super()._record_end(run, by, **values)
        # Whoever carries out jobs now begins it again.
        run.over.set()
        return None
