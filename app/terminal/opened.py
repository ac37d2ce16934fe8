"""What a command opens for as long as it runs: the database, and who solves in batches."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import closing, contextmanager
from typing import TYPE_CHECKING

from app.progress import ReportProgress
from app.terminal.options import read_settings
from app.terminal.server import require_home
from app.terminal.terminal import show_progress

if TYPE_CHECKING:
    from concurrent.futures import Executor

    from app.config import Settings
    from app.db.store import Store


@contextmanager
def opened_store(settings: Settings | None = None) -> Iterator[Store]:
    """The database of a home; by default the one that the environment names."""
    require_home()
    from app.db.store import Store

    with closing(Store.open(settings or read_settings())) as store:
        yield store


@contextmanager
def opened_to_solve(
    what: str, workers: int | None, cluster: str | None = None
) -> Iterator[tuple[Store, Executor | None, ReportProgress]]:
    """The database, where its datasets are solved, and a bar that says what is done."""
    from app.workers.executors import executor_of

    settings = read_settings(cluster=cluster)
    with (
        opened_store(settings) as store,
        executor_of(settings, workers) as executor,
        show_progress(what) as progress,
    ):
        yield store, executor, progress
