"""What a command opens for as long as it runs: the database, and processes that solve in batches."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import closing, contextmanager
from typing import TYPE_CHECKING

from app.commands.options import read_settings

if TYPE_CHECKING:
    from concurrent.futures import Executor

    from app.config import Settings
    from app.store.session import Store


@contextmanager
def opened_store(settings: Settings | None = None) -> Iterator[Store]:
    """The database of a home; by default the one that the environment names."""
    from app.store.session import Store

    with closing(Store.open(settings or read_settings())) as store:
        yield store


@contextmanager
def executor_of(workers: int) -> Iterator[Executor | None]:
    """Where a dataset is solved; None: in this process."""
    if workers == 1:
        yield None
        return
    with process_pool(workers) as pool:
        yield pool


@contextmanager
def process_pool(workers: int) -> Iterator[Executor]:
    """Processes that solve; each starts anew, because forking a process with threads is unsafe."""
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
