"""Worker pool: a few worker processes, with a bound on how many tasks wait for them."""

from __future__ import annotations

import asyncio
import threading
from collections.abc import Awaitable, Callable, Sequence
from concurrent.futures import CancelledError, Future, ThreadPoolExecutor
from itertools import takewhile
from queue import LifoQueue
from time import monotonic
from typing import Any

import structlog

from app.errors import OverloadedError
from app.worker_process import COUNTS, WorkerCounts, WorkerEnded, WorkerLimits, WorkerProcess

log = structlog.get_logger("touchline.workers")

ABANDONED_SECONDS = 1.0
"""A task that nobody waits for runs so long before its worker is killed: a warm worker is worth more."""
GONE_SECONDS = 0.25
"""Between two looks whether whoever asked for a task is gone."""
WARM_WAITING = 100
"""Tasks that may wait for a warm worker; before they do, they wait for their request's turn."""

Explain = Callable[[WorkerEnded], Exception]


def begin_without_check() -> None:
    """Begin every task."""


class PoolTask:
    """A task that waits or runs; ``future`` has its result.

    Args:
        explain: Makes the error that a caller reads of the way that the worker ended.
        begin: Called before the task is given to a worker; what it raises is the result instead.
    """

    def __init__(self, explain: Explain, begin: Callable[[], None] = begin_without_check) -> None:
        self.future: Future[Any] = Future()
        self._explain, self._begin = explain, begin
        self._abandoned = threading.Event()

    def abandon(self) -> None:
        """Give the task up: it is not begun, or its worker is killed soon."""
        self._abandoned.set()
        self.future.cancel()

    async def result_unless_client_gone(self, gone: Callable[[], Awaitable[bool]]) -> Any:
        """The result; None where the task is given up because nobody waits for it any more.

        Args:
            gone: Whether whoever asked for it is gone, such as ``Request.is_disconnected``.
        """
        result: asyncio.Future[Any] = asyncio.wrap_future(self.future)
        try:
            while not result.done():
                await asyncio.wait({result}, timeout=GONE_SECONDS)
                if not result.done() and await gone():
                    return None
            return result.result()
        finally:
            self.abandon()
            # Of one that is given up nobody asks for the error.
            result.cancel()

    def run(
        self,
        worker: WorkerProcess,
        counts: WorkerCounts,
        work: Callable[..., Any],
        arguments: tuple[Any, ...],
    ) -> None:
        """Run the task in a worker, unless it was given up."""
        if not self.future.set_running_or_notify_cancel():
            return
        counts.add_waiting(-1)
        began = monotonic()

        def stop_if_abandoned() -> None:
            if self._abandoned.is_set() and monotonic() - began > ABANDONED_SECONDS:
                raise CancelledError

        try:
            self._begin()
            with counts.track_task():
                result = worker.run(work, *arguments, stop=stop_if_abandoned)
        except WorkerEnded as error:
            self.future.set_exception(self._explain(error))
        except BaseException as error:
            self.future.set_exception(error)
        else:
            self.future.set_result(result)


class WorkerPool:
    """A few workers that work beside each other; they are started when they are needed.

    Args:
        limits: What each worker may use.
        workers: How many there are.
        waiting: How many tasks may wait for a free one.
        what: What they make, for the refusal.
        counts: Where tasks and ends are counted.
        explain: See ``PoolTask``; ``submit`` may name another.
    """

    def __init__(
        self,
        limits: WorkerLimits,
        workers: int,
        waiting: int,
        what: str,
        counts: WorkerCounts,
        explain: Explain = lambda error: error,
    ):
        self._what, self._counts, self._explain = what, counts, explain
        self._threads = ThreadPoolExecutor(workers, "worker")
        self._most = workers + waiting
        self._tasks: set[PoolTask] = set()
        self._lock = threading.Lock()
        self._closed = False
        self._workers = [WorkerProcess(limits) for _ in range(workers)]
        # The worker that worked last is the one that is warm.
        self._free: LifoQueue[WorkerProcess] = LifoQueue()
        for worker in self._workers:
            self._free.put(worker)

    @property
    def tasks(self) -> int:
        """How many run or wait."""
        return len(self._tasks)

    @property
    def has_all_processes(self) -> bool:
        """Whether each worker has its process."""
        return all(worker.is_alive for worker in self._workers)

    def submit(
        self,
        work: Callable[..., Any],
        *arguments: Any,
        explain: Explain | None = None,
        begin: Callable[[], None] = begin_without_check,
        bounded: bool = True,
    ) -> PoolTask:
        """Have a function of a module called in a worker.

        Args:
            work: The function.
            arguments: Its arguments.
            explain: See ``PoolTask``; None: that of the pool.
            begin: See ``PoolTask``.
            bounded: Refuse the task where as many wait as may; else it waits with them.

        Returns:
            The task; of a pool that is closed, one that was given up.

        Raises:
            OverloadedError: As many wait as may.
        """
        task = PoolTask(explain or self._explain, begin)
        with self._lock:
            if self._closed:
                task.abandon()
                return task
            if bounded and len(self._tasks) >= self._most:
                raise OverloadedError(
                    f"{len(self._tasks)} requests for {self._what} already run or wait",
                    hint="Try again in a moment.",
                )
            self._tasks.add(task)
            self._counts.add_waiting(1)
            task.future.add_done_callback(lambda _: self._forget_task(task))
            self._threads.submit(self._run_task, task, work, arguments)
        return task

    def close(self) -> None:
        """End all workers, in the midst of their tasks too; what waits is not begun."""
        with self._lock:
            self._closed = True
            left = list(self._tasks)
        for task in left:
            task.abandon()
        for worker in self._workers:
            worker.kill()
        self._threads.shutdown(cancel_futures=True)
        for worker in self._workers:
            worker.close()

    def _run_task(
        self, task: PoolTask, work: Callable[..., Any], arguments: tuple[Any, ...]
    ) -> None:
        worker = self._free.get()
        try:
            task.run(worker, self._counts, work, arguments)
        finally:
            self._free.put(worker)

    def _forget_task(self, task: PoolTask) -> None:
        if task.future.cancelled():
            # It waited until now: a task that runs ends with an error.
            self._counts.add_waiting(-1)
        with self._lock:
            self._tasks.discard(task)


class ReadyWorker(WorkerPool):
    """One worker that is asked only once it is ready; until then the server does the work itself.

    Args:
        kind: What it is for; see ``KINDS``.
        limits: What it may use.
        explain: Makes the error that a caller reads of the way that the worker ended.
        prepare: Called in the process before its first task.
        arguments: Arguments of ``prepare``.
    """

    def __init__(
        self,
        kind: str,
        limits: WorkerLimits,
        explain: Explain,
        prepare: Callable[..., None],
        *arguments: Any,
    ):
        super().__init__(limits, 1, WARM_WAITING, kind, COUNTS[kind], explain)
        self._prepare = prepare, *arguments
        self._begun = False
        self.is_ready = False
        """Whether the process has been prepared."""

    def start_and_check_ready(self) -> bool:
        """Whether it is ready; the first call, and the first after a crash, start a process."""
        if self.is_ready and not self.has_all_processes:
            self.is_ready = self._begun = False
        if not self._begun:
            self._begun = True
            self.submit(*self._prepare, bounded=False).future.add_done_callback(self._on_prepared)
        return self.is_ready

    def _on_prepared(self, prepared: Future[None]) -> None:
        if prepared.cancelled():
            return
        error = prepared.exception()
        self.is_ready = error is None
        if error is not None:
            log.warning(f"there is no process for {self._what}", error=str(error))


def choose_least_busy_worker(workers: Sequence[ReadyWorker]) -> ReadyWorker | None:
    """The ready worker that has fewest tasks; the workers are started one after the other."""
    ready = list(takewhile(ReadyWorker.start_and_check_ready, workers))
    return min(ready, key=lambda worker: worker.tasks, default=None)
