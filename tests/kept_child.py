"""Children that outlive a test: starting a process costs more than most of what it is asked."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Callable
from multiprocessing.connection import Connection
from multiprocessing.process import BaseProcess
from typing import Any, ClassVar

from app.child import Allowance, Child

USERS = ("app.child_pool", "app.review.datasets.picture_files", "app.store.child")
"""Modules that make children."""


class KeptChild(Child):
    """A child whose process, when it is closed after its work, waits for the next of its kind.

    One that is closed in the midst of a task is ended, as every child is.
    """

    shelf: ClassVar[dict[Allowance, list[tuple[BaseProcess, Connection]]]] = defaultdict(list)

    def __init__(self, allowance: Allowance):
        super().__init__(allowance)
        self._working = False

    def run(self, *arguments: Any, **options: Any) -> Any:
        """As ``Child.run``."""
        self._working = True
        try:
            return super().run(*arguments, **options)
        finally:
            self._working = False

    def kill(self) -> None:
        """End the process that is at work; one that waits may go on doing so."""
        if self._working:
            super().kill()

    def close(self) -> None:
        """Put a process that has nothing to do aside; end any other."""
        if self._working or self._process is None or self._line is None:
            super().close()
            return
        self.shelf[self.allowance].append((self._process, self._line))
        self._process = self._line = None

    def _start(self, stop: Callable[[], None] | None) -> Connection:
        if self._line is None and self.shelf[self.allowance]:
            self._process, self._line = self.shelf[self.allowance].pop()
        return super()._start(stop)
