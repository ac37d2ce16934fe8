"""What a command opens for as long as it runs: the database, and processes that solve in batches."""

from __future__ import annotations

import os
from collections.abc import Iterator
from contextlib import closing, contextmanager
from typing import TYPE_CHECKING

from app.commands.options import read_settings
from app.commands.server import require_home
from app.commands.terminal import show_progress
from app.errors import InputError
from app.progress import TellProgress

if TYPE_CHECKING:
    from concurrent.futures import Executor

    from app.config import Settings
    from app.store.store import Store


@contextmanager
def opened_store(settings: Settings | None = None) -> Iterator[Store]:
    """The database of a home; by default the one that the environment names."""
    require_home()
    from app.store.store import Store

    with closing(Store.open(settings or read_settings())) as store:
        yield store


@contextmanager
def opened_to_solve(
    what: str, workers: int | None, cluster: str | None = None
) -> Iterator[tuple[Store, Executor | None, TellProgress]]:
    """The database, where its datasets are solved, and a bar that says what is done."""
    settings = read_settings(cluster=cluster)
    with (
        opened_store(settings) as store,
        executor_of(settings, workers) as executor,
        show_progress(what) as progress,
    ):
        yield store, executor, progress


@contextmanager
def executor_of(settings: Settings, workers: int | None = None) -> Iterator[Executor | None]:
    """Where a dataset is solved: on a cluster where one is named; None: in this process."""
    count = workers or settings.workers
    if settings.cluster is not None:
        with cluster_of(settings) as cluster:
            yield cluster
    elif count == 1:
        yield None
    else:
        with process_pool(count) as pool:
            yield pool


@contextmanager
def cluster_of(settings: Settings) -> Iterator[Executor]:
    """The workers of the scheduler that the settings name.

    Raises:
        InputError: The address cannot be one.
        ClusterError: Nobody is there, or somebody of another version.
    """
    from app.review.datasets.cluster import Cluster, read_place

    with Cluster(read_place(settings.cluster or "", settings.cluster_keys)) as cluster:
        yield cluster


@contextmanager
def process_pool(workers: int) -> Iterator[Executor]:
    """Processes that solve; each starts anew, because forking a process with threads is unsafe.

    Raises:
        InputError: They could not even enter the present folder.
    """
    if not os.access(".", os.X_OK):
        raise InputError(
            "this user may not enter the folder in which the command was given, and processes"
            " that solve begin there",
            hint="Change to another folder first (cd /), or solve with --workers 1.",
        )
    import multiprocessing
    from concurrent.futures import ProcessPoolExecutor

    from app.child import abandon

    context = multiprocessing.get_context("spawn")
    with ProcessPoolExecutor(
        workers, mp_context=context, initializer=_belong_to_the_parent
    ) as executor:
        try:
            yield executor
        except BaseException:
            # What waits, and what is not done yet, is found again by the next run.
            abandon(executor)
            raise


def _belong_to_the_parent() -> None:
    """End with it; and Ctrl+C reaches every process of a terminal, where it alone decides."""
    import signal

    from app.child import end_with_parent

    signal.signal(signal.SIGINT, signal.SIG_IGN)
    end_with_parent()
