"""Everything that follows from a dataset's annotations: solutions, pitches, and the yield of many groups."""

from __future__ import annotations

from collections.abc import Callable
from concurrent.futures import Executor

from app.plural import plural
from app.progress import TellProgress
from app.review.datasets.dataset import get_dataset_head
from app.review.editing.pitches import estimate_pitches, stale_matches
from app.review.editing.recompute import SolveReport, solve_dataset, stale_groups
from app.review.yields.store import AT_ONCE, YieldStore
from app.store.store import Store


def solve_fully(
    store: Store,
    dataset: str | int,
    executor: Executor | None,
    progress: TellProgress,
    stop: Callable[[], bool] = lambda: False,
) -> SolveReport:
    """Solve what is stale, and estimate the pitches of matches; ``count_yield`` comes after it.

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
    if not stop():

        def estimated(done: int, _total: int | None = None, _said: str = "") -> None:
            report.estimated = done
            # It stays at the groups that are solved, and can be ended all the same.
            progress(total, total)

        found = estimate_pitches(store, dataset, executor, estimated, stop)
        report.proposed = len(found.proposals)
    return report


def left_undone(store: Store, dataset: str | int) -> str | None:
    """What ``solve_fully`` would do now, as a sentence; None: nothing."""
    groups, matches = len(stale_groups(store, dataset)), len(stale_matches(store, dataset))
    if groups:
        return f"{groups} are left to do"
    many = plural(matches, "match", "matches")
    return f"the pitch of {many} is left to estimate" if matches else None


def count_yield(
    store: Store, dataset: str | int, report: SolveReport, progress: TellProgress
) -> None:
    """Count what a dataset yields where many groups were solved, so that the first look finds it."""
    if report.solved > AT_ONCE:
        found = get_dataset_head(store, dataset)
        progress(report.total, report.total, f"Counting what {found.name} yields.")
        YieldStore(store).keep_up(found.id)
