"""Processes that solve in batches."""

from __future__ import annotations

from collections.abc import Iterator
from concurrent.futures import Executor
from contextlib import contextmanager


@contextmanager
def process_pool(workers: int) -> Iterator[Executor]:
    """Processes that solve; each starts anew, because forking a process with threads is unsafe."""
    import multiprocessing
    from concurrent.futures import ProcessPoolExecutor

    context = multiprocessing.get_context("spawn")
    with ProcessPoolExecutor(
        workers, mp_context=context, initializer=_leave_interrupts_to_the_parent
    ) as executor:
        try:
            yield executor
        except BaseException:
            # What waits is found again by the next run.
            executor.shutdown(wait=False, cancel_futures=True)
            raise


def _leave_interrupts_to_the_parent() -> None:
    """Ctrl+C reaches every process of a terminal; the parent alone decides what ends."""
    import signal

    signal.signal(signal.SIGINT, signal.SIG_IGN)
