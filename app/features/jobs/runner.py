"""Job runner: runs jobs beside the requests, one after the other, each with progress and a record.

One runs at a time, and beside it one that changes nothing of its dataset (``BESIDE``) where no earlier job of its dataset
is left. Those who wait have their turns person by person.

The record of a job is a row of the database; the work itself is a function of this process. A
server that stops leaves its jobs where they are, and the next one takes up again those whose kind
knows how (``JobRunner.register_resume``) and marks the others failed.
"""

from __future__ import annotations

import threading
from collections.abc import Callable, Iterator
from concurrent.futures import Executor
from contextlib import AbstractContextManager, contextmanager, nullcontext, suppress
from dataclasses import replace
from time import monotonic
from typing import Any

import structlog

from app.db.session import Session, now
from app.db.store import Store
from app.errors import DamagedError, NotFoundError, StorageError
from app.features.jobs.job_run import JobProgress, JobRun, RunQueue, Work
from app.features.jobs.queries import (
    CANCELLED,
    FAILED,
    OPEN,
    RUNNING,
    WAITING,
    Job,
    delete_oldest_jobs,
    find_end_time,
    read_jobs,
    update_job,
)
from app.features.jobs.records import JobRecords, notify_of_end

log = structlog.get_logger("touchline.jobs")

CLOSE_SECONDS = 10.0
"""How long a server that stops waits for the running job's next step."""
BESIDE = frozenset({"export", "freeze"})
"""Kinds that change nothing of their dataset and that somebody waits for; long work elsewhere does not keep them waiting."""
PROMPT = frozenset({"solve"})
"""Kinds that go before the others: somebody looks at the numbers and waits."""
KEPT = {"solve": 200, "bulk": 200, "verify": 200}
"""How many finished jobs of a kind are remembered; kinds that are not named keep all."""

END_TRIES = 5
"""So many times, a second apart, a worker tries to write how its job ended before it goes on."""
LOOK_SECONDS = 5.0
"""Between two looks of a worker that has nothing to do for ends that could not be written."""
MOST_TRIES = 2
"""So many times a server may die at a job before it is left alone."""

Pool = Callable[[], AbstractContextManager[Executor | None]]
"""Makes an executor for the length of one large job, so that requests keep their processor;
``nullcontext`` makes none, and the work stays in this process."""


class JobRunner(JobRecords):
    """Runs the jobs of one server on threads beside the requests.

    Attributes:
        pool: For work that is worth processes of its own; without one it stays in this process.
    """

    def __init__(self, store: Store, pool: Pool = nullcontext):
        super().__init__(store)
        self.pool = pool
        # Replaced as a whole and only under ``_changed``, so that it is read without.
        self._queue = RunQueue()
        self._entering = 0
        # Never held while the database is asked: requests and the event loop wait for it.
        self._changed = threading.Condition()
        self._closing = threading.Event()
        self._workers: list[threading.Thread] = []
        self._unwritten: dict[int, dict[str, Any]] = {}
        """How jobs ended whose records could not be written yet, by their ids."""
        self._writing_ends = threading.Lock()
        """Held while these are written, so that nobody takes such a job for one that nobody works on."""
        self._turns: dict[str, int] = {}
        """When each person had a turn last, by the number of the turn."""
        self._resumers: dict[str, Work] = {}
        self._beginners: list[Callable[[], None]] = []

    def register_resume(self, kind: str, work: Work) -> None:
        """Start jobs of a kind again after a restart; to be told before ``start``.

        Args:
            kind: The kind.
            work: Finds what it is asked for in the job's record (``progress.job.request``).
        """
        self._resumers[kind] = work

    def register_work(self, kind: str, work: Work) -> None:
        """How the work of a kind is done where a process carries out what another one was asked for;
        it is not begun again after a death."""

    def is_leader(self) -> bool:
        """Whether this process carries out jobs and what else is one process's."""
        return True

    def call_on_leadership(self, begin: Callable[[], None]) -> None:
        """Call a function once this process leads, on whichever thread finds that out."""
        self._beginners.append(begin)

    def start(self) -> None:
        """Take up what an earlier server left behind, or say that it is lost; then lead."""
        self._take_over_open_jobs()
        for begin in self._beginners:
            begin()

    def _take_over_open_jobs(self) -> None:
        with self._store.write() as session:
            for kind, keep in KEPT.items():
                delete_oldest_jobs(session, kind, keep)
            left = read_jobs(session, states=OPEN, limit=10_000)[::-1]
            for job in left:
                self._recover_job(session, job)
        with self._changed:
            resumed = [self._make_resumed_run(job) for job in left if self._is_resumable(job)]
            self._queue = self._queue.with_waiting_runs(*resumed)
            self._start_workers()

    def is_idle(self) -> bool:
        """Whether none waits or runs."""
        return not self._queue.all_runs

    def stop(self) -> None:
        """Tell the jobs that run to stop after their next step; none begins any more."""
        with self._changed:
            self._closing.set()
            self._changed.notify_all()

    def close(self, seconds: float = CLOSE_SECONDS) -> None:
        """Stop, and wait so long for it; the records of the jobs say where they were.

        A job that takes no step for long is left to itself.
        """
        self.stop()
        until = monotonic() + seconds
        for worker in self._workers:
            worker.join(max(until - monotonic(), 0.0))
        self._write_missed_ends()
        if any(worker.is_alive() for worker in self._workers):
            for run in self._queue.running:
                log.warning("a job did not end in time", job=run.job.id)
                self._undo_start_count(run)

    @contextmanager
    def _hold_start_until_recorded(self) -> Iterator[Callable[[JobRun], None]]:
        """Lets a job in while its record is written; none begins before that is kept.

        What is let in is out again where the record could not be written.
        """
        entered: list[JobRun] = []

        def enqueue_run(run: JobRun) -> None:
            with self._changed:
                entered.append(run)
                self._queue = self._queue.with_waiting_runs(run)

        with self._changed:
            self._entering += 1
        try:
            yield enqueue_run
        except BaseException:
            with self._changed:
                for run in entered:
                    self._queue = self._queue.without_run(run)
            raise
        finally:
            with self._changed:
                self._entering -= 1
                self._start_workers()

    def _recover_job(self, session: Session, job: Job) -> None:
        """Let an earlier server's job become what it shall, and tell who asked for it of its end."""
        columns = self._build_recovered_columns(job)
        if columns["state"] not in OPEN:
            columns["ended"] = find_end_time(session)
        update_job(session, job.id, **columns)
        notify_of_end(session, replace(job, state=columns["state"]))

    def _build_recovered_columns(self, job: Job) -> dict[str, Any]:
        """What an earlier server's job becomes."""
        if job.ending:
            return {"state": CANCELLED, "sentence": "Cancelled."}
        if self._is_resumable(job):
            return {"state": WAITING, "started": None, "sentence": "Started again."}
        sentence = "The server stopped before this was done. Start it again."
        if job.kind in self._resumers:
            sentence = (
                f"The server crashed {job.tries} times during this job, so it is not started again."
            )
        problem = {"detail": sentence, "hint": None, "pointer": None}
        return {"state": FAILED, "sentence": sentence, "problem": problem}

    def _is_resumable(self, job: Job) -> bool:
        return job.kind in self._resumers and job.tries < MOST_TRIES and not job.ending

    def _make_resumed_run(self, job: Job) -> JobRun:
        return JobRun(self._resumers[job.kind], JobProgress(job, self._closing))

    def _start_workers(self) -> None:
        if not self._workers and self._queue.waiting:
            for ready in (
                lambda: self._queue.ready_runs,
                lambda: self._queue.list_independent_ready_runs(BESIDE),
            ):
                # Daemons: a job that does not come to its next step must not hold the process.
                worker = threading.Thread(
                    target=self._run_ready_jobs, args=(ready,), name="jobs", daemon=True
                )
                self._workers.append(worker)
                worker.start()
        self._changed.notify_all()

    def _run_ready_jobs(self, ready: Callable[[], list[JobRun]]) -> None:
        while not self._closing.is_set():
            self._write_missed_ends()
            if (run := self._wait_for_next_run(ready)) is None:
                continue
            try:
                self._execute_run(run)
            except StorageError as error:
                log.warning(
                    "the start of a job could not be written", job=run.job.id, error=str(error)
                )
                # A damaged database stays so until somebody mends it.
                self._leave_queue(run, again=not (run.counted or isinstance(error, DamagedError)))
                self._closing.wait(1.0)
            except Exception:
                log.exception("the record of a job could not be written", job=run.job.id)
                self._leave_queue(run)
            else:
                self._leave_queue(run)

    def _leave_queue(self, run: JobRun, *, again: bool = False) -> None:
        """Let a job that ran be over; ``again``: it did not begin, and waits as before."""
        with self._changed:
            again = again and not run.progress.is_stopping
            self._queue = self._queue.without_run(run)
            if again:
                self._queue = self._queue.with_waiting_runs(run)
            # What was of its dataset may run beside another now.
            self._changed.notify_all()
        if not again:
            run.over.set()

    def _wait_for_next_run(self, ready: Callable[[], list[JobRun]]) -> JobRun | None:
        """The next job to run, of those that may; None when the server stops, or none came for a
        while."""
        with self._changed:
            found = self._changed.wait_for(
                lambda: self._closing.is_set() or (not self._entering and ready()), LOOK_SECONDS
            )
            if self._closing.is_set() or not found:
                return None
            run = min(ready(), key=self._priority)
            self._turns[run.job.actor] = max(self._turns.values(), default=0) + 1
            self._queue = self._queue.with_started_run(run)
            return run

    def _priority(self, run: JobRun) -> tuple[bool, int, int]:
        """Its place among those that may run: the smallest is the next."""
        return run.job.kind not in PROMPT, self._turns.get(run.job.actor, 0), run.job.id

    def _execute_run(self, run: JobRun) -> None:
        if not self._record_start(run):
            return
        run.counted = True
        ended = threading.Event()
        ticker = threading.Thread(
            target=self._save_progress_until_ended, args=(run, ended), daemon=True
        )
        ticker.start()
        try:
            values = run.run_to_end()
        finally:
            ended.set()
            ticker.join()
        if values is not None:
            self._record_end(run, **values)
        else:
            self._undo_start_count(run)

    def _record_start(self, run: JobRun) -> bool:
        """Write that a job is begun; False where it shall not be."""
        self._save_columns(run.job.id, state=RUNNING, started=now(), begun=1)
        return True

    def _undo_start_count(self, run: JobRun) -> None:
        """Let a server that stops in good order count for no death: it is none of this job's doing."""
        with self._changed:
            counted, run.counted = run.counted, False
        if counted:
            with suppress(StorageError):
                self._save_columns(run.job.id, begun=-1)

    def _record_end(self, run: JobRun, by: str | None = None, **values: Any) -> Job | None:
        """Save how a job ended; ``by``: see ``cancel``. None where it cannot be written yet."""
        columns, job = {**run.columns, **values}, None
        # Where the disk is full for a moment, the record waits for it.
        for _ in range(END_TRIES):
            try:
                job = self._save_end(run.job.id, by, **columns)
            except StorageError as error:
                log.warning("the record of a job could not be written", error=str(error))
                self._closing.wait(1.0)
            else:
                break
        else:
            with self._changed:
                self._unwritten[run.job.id] = columns
        run.over.set()
        return job

    def _write_missed_ends(self) -> None:
        """Write how jobs ended where that could not be written before."""
        with self._writing_ends:
            with self._changed:
                unwritten, self._unwritten = self._unwritten, {}
            for job_id, columns in unwritten.items():
                try:
                    if self.get(job_id).state in OPEN:
                        self._save_end(job_id, **columns)
                except NotFoundError:
                    pass
                except StorageError:
                    with self._changed:
                        self._unwritten[job_id] = columns
                except Exception:
                    log.exception("the record of a job could not be written", job=job_id)
