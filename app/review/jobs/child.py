"""The work of a job in a process of its own, so that requests do not wait for it."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any, TypeVar

from app.child import ChildEnded, EndReason
from app.errors import OverloadedError, TooLargeError
from app.progress import TellProgress
from app.review.jobs.run import JobProgress
from app.store.child import nothing, patiently, work_apart, work_here
from app.store.datasets import has_more_groups
from app.store.store import Store

Result = TypeVar("Result")

SMALL = 100
"""Groups of a dataset that are worked on here: to start a process takes longer."""
STOP_SECONDS = 2.0
"""So long after its process a server may be told to stop."""
_AGAIN = "Start it again."
_MEMORY = f"{_AGAIN} Where it happens often, give more memory."
_ENDS: dict[EndReason, tuple[str, str]] = {
    "memory": ("needs more memory than there is", _MEMORY),
    "killed": ("was killed, most likely for want of memory", _MEMORY),
    "told": ("was told to end", _AGAIN),
    "crash": ("crashed", f"{_AGAIN} Where it crashes again, report it."),
    "processor": ("took too long to work out", _AGAIN),
    "silence": ("came to no next step", f"{_AGAIN} The disk or a store may not answer."),
}
"""How a process ended, and what to do about it."""


def carry_out_apart(
    store: Store,
    kind: str,
    what: str,
    work: Callable[..., Result],
    *arguments: Any,
    dataset_id: int | None,
    progress: JobProgress,
    told: TellProgress | None = None,
    answer: Callable[[Any], Any] = nothing,
) -> Result:
    """The result of ``work(store, *arguments, caller)``, as ``store.child.work_apart`` has it.

    Args:
        store: The database.
        kind: What is done, as its figures are called.
        what: The same in a sentence.
        work: A function of a module.
        arguments: What it is called with besides.
        dataset_id: What it works on; where that is small, it is done here. None: never here.
        progress: Of the job; who cancels it ends the work.
        told: Hears how far the work is; None: the job's progress itself.
        answer: What the work's questions are answered with.

    Raises:
        OverloadedError: The process did not come to its end, or could not be started.
        ReviewError: As the work raised it.
    """
    hears = told or progress
    if dataset_id is not None and _is_small(store, dataset_id):
        return work_here(store, work, *arguments, progress=hears, answer=answer)
    stop = patiently(progress.check)
    try:
        with left_to_the_next(progress):
            return work_apart(
                store, kind, work, *arguments, progress=hears, stop=stop, answer=answer
            )
    except ChildEnded as error:
        ended, hint = _ENDS[error.reason]
        raise OverloadedError(f"the process of {what} {ended}", hint=hint) from error


@contextmanager
def left_to_the_next(progress: JobProgress) -> Iterator[None]:
    """Let the next server go on where a process ended because this one is about to stop.

    Who ends a service may end its processes first.
    """
    try:
        yield
    except (ChildEnded, OverloadedError, TooLargeError):
        progress.check_within(STOP_SECONDS)
        raise


def _is_small(store: Store, dataset_id: int) -> bool:
    with store.read() as session:
        return not has_more_groups(session, dataset_id, SMALL)
