"""Child pool: tasks for a few children, with a bound on how many wait."""

from __future__ import annotations

import threading
from collections.abc import Callable
from concurrent.futures import CancelledError, Future, ThreadPoolExecutor
from queue import LifoQueue
from time import monotonic
from typing import Any

from app.child import Allowance, Child, ChildEnded
from app.child_figures import ChildFigures
from app.errors import OverloadedError

PATIENCE = 1.0
"""Seconds that a task may go on which nobody waits for: its child is worth more than that."""

Explain = Callable[[ChildEnded], Exception]


def begin_all() -> None:
    """Say nothing against any task."""


class PoolTask:
    """A task that waits or runs; ``future`` has its result.

    Args:
        explain: From the way that its child ended to the error that a caller reads.
        begin: Called when its turn has come; what it raises is the result, and no child works.
    """

    def __init__(self, explain: Explain, begin: Callable[[], None] = begin_all) -> None:
        self.future: Future[Any] = Future()
        self._explain, self._begin = explain, begin
        self._left = threading.Event()

    def leave(self) -> None:
        """Say that nobody waits for it any more: it is not begun, or ended before long."""
        self._left.set()
        self.future.cancel()

    def run(
        self,
        child: Child,
        work: Callable[..., Any],
        arguments: tuple[Any, ...],
        figures: ChildFigures,
    ) -> None:
        """Do it in a child, if somebody still waits."""
        if not self.future.set_running_or_notify_cancel():
            return
        figures.wait_no_more()
        began = monotonic()

        def stop() -> None:
            if self._left.is_set() and monotonic() - began > PATIENCE:
                raise CancelledError

        try:
            self._begin()
            with figures.working():
                result = child.run(work, *arguments, stop=stop)
        except ChildEnded as error:
            self.future.set_exception(self._explain(error))
        except BaseException as error:
            self.future.set_exception(error)
        else:
            self.future.set_result(result)


class ChildPool:
    """A few children that work beside each other; they are started when they are needed.

    Args:
        allowance: What each child may use.
        children: How many work at once.
        waiting: How many tasks may wait for one that is free.
        what: What they make, for the refusal.
        figures: Where they are counted.
    """

    def __init__(
        self,
        allowance: Allowance,
        children: int,
        waiting: int,
        what: str,
        figures: ChildFigures,
    ):
        self._what, self._figures = what, figures
        self._threads = ThreadPoolExecutor(children, "child")
        self._most = children + waiting
        self._tasks: set[PoolTask] = set()
        self._lock = threading.Lock()
        self._closed = False
        self._children = [Child(allowance) for _ in range(children)]
        # The child that worked last is the one that is warm.
        self._free: LifoQueue[Child] = LifoQueue()
        for child in self._children:
            self._free.put(child)

    @property
    def tasks(self) -> int:
        """How many run or wait."""
        return len(self._tasks)

    @property
    def is_whole(self) -> bool:
        """Whether each child has its process."""
        return all(child.is_alive for child in self._children)

    def submit(
        self,
        work: Callable[..., Any],
        *arguments: Any,
        explain: Explain = lambda error: error,
        begin: Callable[[], None] = begin_all,
        bounded: bool = True,
    ) -> PoolTask:
        """Have a function of a module called in a child.

        Args:
            work: The function.
            arguments: What it is called with.
            explain: See ``PoolTask``.
            begin: Likewise.
            bounded: Refuse it where as many wait as may; else it waits with them.

        Returns:
            The task; of a pool that is closed, one that is not begun.

        Raises:
            OverloadedError: As many wait as may.
        """
        task = PoolTask(explain, begin)
        with self._lock:
            if self._closed:
                task.leave()
                return task
            if bounded and len(self._tasks) >= self._most:
                raise OverloadedError(
                    f"{len(self._tasks)} {self._what} are being made or wait already",
                    hint="Try again in a moment.",
                )
            self._tasks.add(task)
            self._figures.wait()
            task.future.add_done_callback(lambda _: self._forget(task))
            self._threads.submit(self._run, task, work, arguments)
        return task

    def close(self) -> None:
        """End all children, in the midst of their tasks too; what waits is not begun."""
        with self._lock:
            self._closed = True
            left = list(self._tasks)
        for task in left:
            task.leave()
        for child in self._children:
            child.kill()
        self._threads.shutdown(cancel_futures=True)
        for child in self._children:
            child.close()

    def _run(self, task: PoolTask, work: Callable[..., Any], arguments: tuple[Any, ...]) -> None:
        child = self._free.get()
        try:
            task.run(child, work, arguments, self._figures)
        finally:
            self._free.put(child)

    def _forget(self, task: PoolTask) -> None:
        if task.future.cancelled():
            # Before it was begun: what was is ended with an error.
            self._figures.wait_no_more()
        with self._lock:
            self._tasks.discard(task)
