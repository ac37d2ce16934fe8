"""The work of one job, in this process or one of its own: how far it is, and how it ends."""

from __future__ import annotations

import threading
from collections.abc import Callable, Collection, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field, replace
from typing import Any, TypeVar

import structlog

from app.db.database_worker import (
    ignore_question,
    make_stop_with_grace_period,
    run_in_this_thread,
    run_in_worker,
)
from app.db.json_columns import Json
from app.db.store import Store
from app.errors import JobCancelled, OverloadedError, ReviewError, TooLargeError
from app.features.datasets.queries import has_more_groups
from app.features.jobs.queries import CANCELLED, DONE, FAILED, Job
from app.features.jobs.result_sentences import describe_result
from app.progress import ReportProgress
from app.worker_process import EndReason, WorkerEnded

log = structlog.get_logger("touchline.jobs")

Work = Callable[["JobProgress"], Json]
"""What a job does; returns its result. It must be safe to start again from the beginning."""
Result = TypeVar("Result")

SMALL = 100
"""Work on a dataset of at most so many groups is done here: to start a process takes longer."""
STOP_SECONDS = 2.0
"""A server may be told to stop so long after its worker processes."""
_AGAIN = "Start it again."
_MEMORY = f"{_AGAIN} Where it happens often, give more memory."
_ENDS: dict[EndReason, tuple[str, str]] = {
    "memory": ("needs more memory than the machine has free", _MEMORY),
    "killed": ("was killed, most likely because the machine ran out of memory", _MEMORY),
    "terminated": ("was stopped", _AGAIN),
    "crash": ("crashed", f"{_AGAIN} Where it crashes again, report it."),
    "processor": ("took too much processor time", _AGAIN),
    "silence": ("made no progress for too long", f"{_AGAIN} The disk or a store may not answer."),
}
"""How a process ended, and what to do about it."""


class FailedWithReportError(ReviewError):
    """A job that failed, and what it has to tell all the same.

    Args:
        message: One sentence that says what is wrong.
        hint: What to do about it.
        result: The job's result.
    """

    def __init__(self, message: str, hint: str | None, result: Json):
        super().__init__(message, hint=hint)
        self.result = result


def make_counts_reporter(progress: JobProgress, what: str) -> ReportProgress:
    """A progress that says its numbers in words, too: ``1,200 of 12,764 groups solved``.

    Where the work says a sentence, it is that one.
    """

    def report_counts(done: int, total: int | None = None, sentence: str = "") -> None:
        of = "" if total is None else f" of {total:,}"
        progress(done, total, sentence or f"{done:,}{of} {what}")

    return report_counts


class JobProgress:
    """How far a job is; its work calls it often, and it costs next to nothing.

    Attributes:
        job: The job as it was when it was asked for, or taken up: its ``request`` above all, which is
            all that its work needs to know.
    """

    def __init__(self, job: Job, closing: threading.Event):
        self.job = job
        self.place: tuple[int, int | None, str] = (0, None, "")
        self.cancelled = threading.Event()
        self._closing = closing

    def __call__(self, done: int, total: int | None = None, sentence: str = "") -> None:
        """Note how much is done; what is not said stays as it was.

        Raises:
            JobCancelled: The work shall end here.
        """
        _, last_total, last_sentence = self.place
        self.place = (done, last_total if total is None else total, sentence or last_sentence)
        self.check()

    @property
    def job_id(self) -> int:
        """The job's id, for what its work writes under that name."""
        return self.job.id

    @property
    def dataset_id(self) -> int:
        """The job's dataset; 0, which none is, where it has none."""
        return self.job.dataset_id or 0

    @property
    def was_begun_before(self) -> bool:
        """Whether an earlier server was at it, which may have done some of it."""
        return self.job.tries > 0 or self.job.done > 0

    @property
    def is_stopping(self) -> bool:
        """Whether this process shall carry it out no more."""
        return self._closing.is_set()

    def require_not_cancelled(self) -> None:
        """Raise ``JobCancelled`` where somebody cancelled it; a server that stops did not."""
        if self.cancelled.is_set():
            raise JobCancelled

    def wait_and_require_not_stopped(self, seconds: float) -> None:
        """``check``, once the server stops or this time is over."""
        self._closing.wait(seconds)
        self.check()

    def check(self) -> None:
        """Raise ``JobCancelled`` where the work shall end here."""
        if self.cancelled.is_set() or self._closing.is_set():
            raise JobCancelled


@dataclass(eq=False)
class JobRun:
    """A job of this process that waits or runs."""

    work: Work
    progress: JobProgress
    over: threading.Event = field(default_factory=threading.Event)
    counted: bool = False
    """Whether its record says that it was begun here."""

    @property
    def job(self) -> Job:
        """The job."""
        return self.progress.job

    @property
    def columns(self) -> dict[str, Any]:
        """How far it is, as columns of its record."""
        return dict(zip(("done", "total", "sentence"), self.progress.place, strict=True))

    def run_to_end(self) -> dict[str, Any] | None:
        """Do the work; how it ended, as columns. None where the server stops and the next one
        decides."""
        try:
            self.progress.require_not_cancelled()
            with structlog.contextvars.bound_contextvars(job=self.job.id):
                result = self.work(self.progress)
            sentence = describe_result(self.job.kind, result)
            return {
                "state": DONE,
                "result": result,
                **({} if sentence is None else {"sentence": sentence}),
            }
        except JobCancelled as error:
            if not error.args and not self.progress.cancelled.is_set():
                return None
            return {"state": CANCELLED, "sentence": str(error) or "Cancelled."}
        except FailedWithReportError as error:
            return {**_failure_columns(error.message, error.hint), "result": error.result}
        except ReviewError as error:
            return _failure_columns(error.message, error.hint, error.pointer)
        except Exception:
            log.exception("job failed", job=self.job.id, kind=self.job.kind)
            return _failure_columns(
                "something went wrong inside the server",
                f"The server's log names job {self.job.id}.",
            )


def _failure_columns(detail: str, hint: str | None, pointer: str | None = None) -> dict[str, Any]:
    problem = {"detail": detail, "hint": hint, "pointer": pointer}
    return {"state": FAILED, "sentence": detail, "problem": problem}


@dataclass(frozen=True)
class RunQueue:
    """Which jobs of this process wait, and which run."""

    waiting: tuple[JobRun, ...] = ()
    running: tuple[JobRun, ...] = ()

    @property
    def all_runs(self) -> tuple[JobRun, ...]:
        """The jobs that wait and those that run."""
        return (*self.waiting, *self.running)

    @property
    def ready_runs(self) -> list[JobRun]:
        """The waiting jobs whose dataset has no running job."""
        taken = {run.job.dataset_id for run in self.running} - {None}
        return [run for run in self.waiting if run.job.dataset_id not in taken]

    def list_independent_ready_runs(self, kinds: Collection[str]) -> list[JobRun]:
        """The ready jobs of some kinds that are the earliest waiting job of their dataset."""
        first: dict[int | None, int] = {}
        for run in self.waiting:
            first[run.job.dataset_id] = min(run.job.id, first.get(run.job.dataset_id, run.job.id))
        return [
            run
            for run in self.ready_runs
            if run.job.kind in kinds
            and (run.job.dataset_id is None or run.job.id == first[run.job.dataset_id])
        ]

    def find_running(self, job_id: int) -> JobRun | None:
        """The run of a job, where it runs."""
        return next((run for run in self.running if run.job.id == job_id), None)

    def with_waiting_runs(self, *runs: JobRun) -> RunQueue:
        """With more that wait."""
        return replace(self, waiting=(*self.waiting, *runs))

    def with_started_run(self, run: JobRun) -> RunQueue:
        """With one running that waited."""
        left = self.without_run(run)
        return replace(left, running=(*left.running, run))

    def without_run(self, run: JobRun) -> RunQueue:
        """Without one that waits or runs."""
        waiting, running = (
            tuple(item for item in items if item is not run)
            for items in (self.waiting, self.running)
        )
        return RunQueue(waiting, running)


def run_job_in_worker(
    store: Store,
    kind: str,
    what: str,
    work: Callable[..., Result],
    *arguments: Any,
    dataset_id: int | None,
    progress: JobProgress,
    report: ReportProgress | None = None,
    answer: Callable[[Any], Any] = ignore_question,
) -> Result:
    """Call ``work(store, *arguments, caller)`` in a worker process (``database_worker.run_in_worker``).

    Args:
        store: The database.
        kind: What is done; see ``worker_process.KINDS``.
        what: The same in a sentence.
        work: A function of a module.
        arguments: Its arguments between the database and the caller.
        dataset_id: What it works on; where that is small, it is done here. None: never here.
        progress: Of the job; the work ends when the job is cancelled.
        report: Receives the progress of the work; None: the job's progress itself.
        answer: Answers the work's questions.

    Raises:
        OverloadedError: The process did not come to its end, or could not be started.
        ReviewError: As the work raised it.
    """
    report = report or progress
    if dataset_id is not None and _is_small_dataset(store, dataset_id):
        return run_in_this_thread(store, work, *arguments, progress=report, answer=answer)
    stop = make_stop_with_grace_period(progress.check)
    try:
        with leave_work_to_next_server(progress):
            return run_in_worker(
                store, kind, work, *arguments, progress=report, stop=stop, answer=answer
            )
    except WorkerEnded as error:
        ended, hint = _ENDS[error.reason]
        raise OverloadedError(f"the process of {what} {ended}", hint=hint) from error


@contextmanager
def leave_work_to_next_server(progress: JobProgress) -> Iterator[None]:
    """Let the next server go on where a process ended because this server is about to stop.

    A service manager may end the processes of a service first.
    """
    try:
        yield
    except (WorkerEnded, OverloadedError, TooLargeError):
        progress.wait_and_require_not_stopped(STOP_SECONDS)
        raise


def _is_small_dataset(store: Store, dataset_id: int) -> bool:
    with store.read() as session:
        return not has_more_groups(session, dataset_id, SMALL)
