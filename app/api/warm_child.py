"""Warm child: a process that is started when it is first wanted, and asked once it is ready.

Until then whoever wants it does the work in the server, as where there is no such process.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from concurrent.futures import Future
from itertools import takewhile
from typing import Any

import structlog

from app.child import Allowance
from app.child_figures import FIGURES
from app.child_pool import ChildPool, Explain, PoolTask

log = structlog.get_logger("touchline.children")

WAITING = 100
"""Tasks that may wait for it; before they do, they wait in their lane."""


class WarmChild:
    """One process that does one task after the other.

    Args:
        kind: What it is for, as its figures are called.
        allowance: What it may use.
        explain: From the way that it ended to the error that a caller reads.
        make_ready: Called in it before the first task.
        arguments: What that is called with.
    """

    def __init__(
        self,
        kind: str,
        allowance: Allowance,
        explain: Explain,
        make_ready: Callable[..., None],
        *arguments: Any,
    ):
        self._pool = ChildPool(allowance, 1, WAITING, kind, FIGURES[kind])
        self._kind, self._explain = kind, explain
        self._first = make_ready, *arguments
        self._begun = self._closed = False
        self.is_ready = False
        """Whether the process is there."""

    def begin(self) -> bool:
        """Whether it is ready; the first call starts it, and the first after it broke down another."""
        if self._closed:
            return False
        if self.is_ready and not self._pool.is_whole:
            self.is_ready = self._begun = False
        if not self._begun:
            self._begun = True
            begun = self._pool.submit(*self._first, explain=self._explain, bounded=False)
            begun.future.add_done_callback(self._note)
        return self.is_ready

    @property
    def tasks(self) -> int:
        """How many it has to do."""
        return self._pool.tasks

    def submit(self, work: Callable[..., Any], *arguments: Any) -> PoolTask:
        """Have a function of a module called in it; see ``ChildPool.submit``."""
        return self._pool.submit(work, *arguments, explain=self._explain)

    def close(self) -> None:
        """End the process; no other is started."""
        self._closed = True
        self._pool.close()

    def _note(self, begun: Future[None]) -> None:
        if begun.cancelled():
            return
        error = begun.exception()
        self.is_ready = error is None
        if error is not None:
            log.warning(f"there is no process for {self._kind}", error=str(error))


def least_busy(children: Sequence[WarmChild]) -> WarmChild | None:
    """Who of those that are ready has least to do; one after the other is started."""
    ready = list(takewhile(WarmChild.begin, children))
    return min(ready, key=lambda child: child.tasks, default=None)
