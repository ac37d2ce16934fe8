"""Fan out: tasks to an executor and results back, with a bounded number under way."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import FIRST_COMPLETED, Executor, Future, wait
from itertools import takewhile
from typing import TypeVar

AHEAD = 8
"""Tasks under way, so that memory stays flat however many there are; an executor of more workers
says its own number (``ahead``)."""


T = TypeVar("T")


R = TypeVar("R")


LOOK_S = 0.2
"""Seconds between two looks whether to stop."""


def _never() -> bool:
    return False


def fan_out(
    work: Callable[[T], R],
    tasks: Iterable[T],
    executor: Executor | None,
    stop: Callable[[], bool] = _never,
) -> Iterator[R]:
    """Results as they come; without an executor here, one after the other.

    Args:
        work: A function of a module, so that it travels.
        tasks: Made one by one, as workers become free.
        executor: Where they run; None: in this thread.
        stop: Asked every now and then; once it says so, what is done is still given, and no more.
    """
    if executor is None:
        yield from map(work, takewhile(lambda _: not stop(), tasks))
        return
    running: set[Future[R]] = set()
    ahead = getattr(executor, "ahead", AHEAD)
    try:
        for task in tasks:
            running.add(executor.submit(work, task))
            while len(running) >= ahead and not stop():
                done, running = wait(running, LOOK_S, FIRST_COMPLETED)
                yield from (future.result() for future in done)
            if stop():
                break
        while running and not stop():
            done, running = wait(running, LOOK_S, FIRST_COMPLETED)
            yield from (future.result() for future in done)
        # A process that was stopped, too, has no result.
        arrived = [future for future in running if future.done() and not future.exception()]
        yield from (future.result() for future in arrived)
    finally:
        for future in running:
            future.cancel()
