"""Worker processes that outlive a test: starting a process costs more than most of what it is asked."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Callable
from multiprocessing.connection import Connection
from multiprocessing.process import BaseProcess
from typing import Any, ClassVar

from app.worker_process import WorkerLimits, WorkerProcess

USERS = ("app.worker_pool", "app.features.file_tools.paint", "app.db.database_worker")
"""Modules that start workers."""


class KeptWorker(WorkerProcess):
    """A worker whose process, when it is closed after its work, waits for the next of its kind.

    One that is closed in the midst of a task is ended, as every worker is.
    """

    shelf: ClassVar[dict[WorkerLimits, list[tuple[BaseProcess, Connection]]]] = defaultdict(list)

    def __init__(self, limits: WorkerLimits):
        super().__init__(limits)
        self._working = False

    def run(self, *arguments: Any, **options: Any) -> Any:
        """As ``WorkerProcess.run``."""
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
        if self._working or self._process is None or self._pipe is None:
            super().close()
            return
        self.shelf[self.limits].append((self._process, self._pipe))
        self._process = self._pipe = None

    def _ensure_process(self, stop: Callable[[], None] | None) -> Connection:
        if self._pipe is None and self.shelf[self.limits]:
            self._process, self._pipe = self.shelf[self.limits].pop()
        return super()._ensure_process(stop)
