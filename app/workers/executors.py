"""Where batches are solved, as the settings say: here, in processes, or on a cluster; and how tasks
go there and results come back."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import FIRST_COMPLETED, Executor, Future, wait
from contextlib import AbstractContextManager, contextmanager
from itertools import takewhile
from typing import TypeVar

from app.config import Settings
from app.errors import InputError
from app.worker_process import open_spawned_pool
from app.workers.cluster import ClusterExecutor, parse_scheduler_address

AHEAD = 8
"""Tasks under way, so that memory stays flat however many there are; an executor of more workers
says its own number (``ahead``)."""


T = TypeVar("T")


R = TypeVar("R")


LOOK_S = 0.2
"""Seconds between two looks whether to stop."""


def _never_stop() -> bool:
    return False


def run_tasks(
    work: Callable[[T], R],
    tasks: Iterable[T],
    executor: Executor | None,
    stop: Callable[[], bool] = _never_stop,
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


@contextmanager
def open_executor(settings: Settings, workers: int | None = None) -> Iterator[Executor | None]:
    """Where a command solves: on a cluster where one is named; None: in its own process.

    Args:
        settings: Name the cluster, and how many processes there are.
        workers: As many processes instead.

    Raises:
        InputError: The cluster's address cannot be one, or processes cannot enter the folder.
        ClusterError: Nobody is there, or somebody of another version.
    """
    count = workers or settings.workers
    if settings.cluster is not None:
        with _open_cluster(settings) as cluster:
            yield cluster
    elif count == 1:
        yield None
    else:
        with open_process_pool(count) as pool:
            yield pool


def make_server_pool_opener(settings: Settings) -> Callable[[], AbstractContextManager[Executor]]:
    """Where large jobs of a server are solved, opened when there is one; raises as ``open_executor``."""
    if settings.cluster is not None:
        return lambda: _open_cluster(settings)
    # One processor is left for the requests.
    return lambda: open_process_pool(max(1, settings.workers - 1))


@contextmanager
def open_process_pool(workers: int) -> Iterator[Executor]:
    """Processes that solve; what is not done when the work fails is found again by the next run.

    Raises:
        InputError: They could not even enter the present folder.
    """
    if not os.access(".", os.X_OK):
        raise InputError(
            "this user has no access to the current folder, in which the worker processes"
            " would start",
            hint="Change to another folder first (cd /), or solve with --workers 1.",
        )
    with open_spawned_pool(workers) as pool:
        yield pool


def _open_cluster(settings: Settings) -> ClusterExecutor:
    return ClusterExecutor(parse_scheduler_address(settings.cluster or "", settings.cluster_keys))
