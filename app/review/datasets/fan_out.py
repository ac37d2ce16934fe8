"""Fan out: tasks to an executor and results back, with a bounded number under way."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import FIRST_COMPLETED, Executor, Future, wait
from typing import TypeVar

AHEAD = 8
"""Tasks that may wait for a worker, so that memory stays flat however many there are."""

T = TypeVar("T")
R = TypeVar("R")


def fan_out(work: Callable[[T], R], tasks: Iterable[T], executor: Executor | None) -> Iterator[R]:
    """Results as they come; without an executor here, one after the other.

    Args:
        work: A function of a module, so that it travels.
        tasks: Made one by one, as workers become free.
        executor: Where they run; None: in this thread.
    """
    if executor is None:
        yield from map(work, tasks)
        return
    running: set[Future[R]] = set()
    try:
        for task in tasks:
            running.add(executor.submit(work, task))
            if len(running) >= AHEAD:
                done, running = wait(running, return_when=FIRST_COMPLETED)
                yield from (future.result() for future in done)
        while running:
            done, running = wait(running, return_when=FIRST_COMPLETED)
            yield from (future.result() for future in done)
    finally:
        for future in running:
            future.cancel()
