"""Child figures: what the children of this process are at, and how those ended that did not finish."""

from __future__ import annotations

import threading
from collections.abc import Iterator
from contextlib import contextmanager
from typing import get_args

from app.child import ChildEnded, EndReason

KINDS = (
    "pictures",
    "readers",
    "fetchers",
    "indexers",
    "previews",
    "large",
    "predictions",
    "imports",
    "exports",
    "freezing",
    "verifying",
    "evaluating",
    "accepting",
    "practice",
    "paint",
    "proposals",
)


class ChildFigures:
    """The figures of one kind of children; any thread may change them.

    Attributes:
        busy: Tasks at work.
        waiting: Tasks that wait for a child.
        ended: Children that ended in the midst of a task, by reason.
    """

    def __init__(self) -> None:
        self.busy = self.waiting = 0
        self.ended: dict[EndReason, int] = dict.fromkeys(get_args(EndReason), 0)
        self._lock = threading.Lock()

    def wait(self) -> None:
        """One more task waits."""
        with self._lock:
            self.waiting += 1

    def wait_no_more(self) -> None:
        """One less does: it begins, or nobody wants it any more."""
        with self._lock:
            self.waiting -= 1

    @contextmanager
    def working(self) -> Iterator[None]:
        """Count what is done within as a task at work, and its child where that ends before it is done."""
        with self._lock:
            self.busy += 1
        try:
            yield
        except ChildEnded as error:
            with self._lock:
                self.ended[error.reason] += 1
            raise
        finally:
            with self._lock:
                self.busy -= 1


FIGURES = {kind: ChildFigures() for kind in KINDS}
"""Of all kinds that a server has, whichever of its pools and jobs made them."""
