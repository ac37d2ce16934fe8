"""Progress: how a long piece of work tells whoever started it how far it is."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from typing import Protocol, TypeVar

Item = TypeVar("Item")


class ReportProgress(Protocol):
    """Called every now and then with how much is done.

    It may raise (``errors.JobCancelled``) to end the work there.
    """

    def __call__(self, done: int, total: int | None = None, sentence: str = "", /) -> None:
        """Tell how far the work is.

        Args:
            done: How much is done, in the unit that the work counts.
            total: How much there is to do; None: as told before, or not known.
            sentence: What is being done; empty: as told before.
        """


def make_partial_progress(
    progress: ReportProgress, sentence: str, *, start: int = 0, total: int | None = None
) -> ReportProgress:
    """A progress for one part of some work: its counts go on from ``start``, under a sentence.

    Args:
        progress: Hears of the whole work.
        sentence: What the part does.
        start: How much was done before the part.
        total: How much there is to do in the whole work; None: as the part says.
    """

    def report_part(done: int, of: int | None = None, _sentence: str = "") -> None:
        progress(start + done, of if total is None else total, sentence)

    return report_part


def report_each_item(
    items: Iterable[Item], total: int, progress: ReportProgress | None, sentence: str
) -> Iterator[Item]:
    """The same items, each of which is told as it comes.

    Args:
        items: What is worked through.
        total: How many they are.
        progress: Hears how many were done before each, and that all are.
        sentence: What is done with them.
    """
    for done, item in enumerate(items):
        if progress is not None:
            progress(done, total, sentence)
        yield item
    if progress is not None:
        progress(total, total, sentence)
