"""Everything that follows from a dataset's annotations: solutions, pitches, and the yield of many groups."""

from __future__ import annotations

from collections.abc import Callable
from concurrent.futures import Executor

from app.progress import TellProgress
from app.review.datasets.dataset import get_dataset_head
from app.review.editing.pitches import estimate_pitches
from app.review.editing.recompute import SolveReport, solve_dataset
from app.review.yields.store import AT_ONCE, YieldStore
from app.store.store import Store


def solve_fully(
    store: Store,
    dataset: str | int,
    executor: Executor | None,
    progress: TellProgress,
    stop: Callable[[], bool] = lambda: False,
) -> SolveReport:
    """Solve what is stale, estimate the pitches of matches, and count what many groups yield.

    Args:
        store: The database.
        dataset: Name or id.
        executor: Where chunks of groups, and matches, are worked on; None: here, one by one.
        progress: Called with groups solved and in all; an error that it raises ends the run, and
            nothing that was saved before is lost.
        stop: Asked every now and then; once it says so, what is done is saved, and no more.
    """
    report = solve_dataset(store, dataset, executor, progress, stop)
    total = report.total
    if stop():
        return report
    # It stays at the groups that are solved, and can be ended all the same.
    estimate_pitches(store, dataset, executor, lambda *_: progress(total, total), stop)
    if report.solved > AT_ONCE and not stop():
        # So that the first look at the yield finds it counted.
        found = get_dataset_head(store, dataset)
        progress(total, total, f"Counting what {found.name} yields.")
        YieldStore(store).keep_up(found.id)
    return report
