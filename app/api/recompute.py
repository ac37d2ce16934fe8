"""Background solving of groups that a change of a station or a policy left without a solution."""

from __future__ import annotations

import threading
from concurrent.futures import Future, ThreadPoolExecutor

import structlog

from app.review.recompute import solve_dataset
from app.store.session import Store

log = structlog.get_logger("touchline.api")


class _ClosedError(Exception):
    """The server is stopping; the work is derived from the data and is found again."""


class Recompute:
    """One worker beside the requests; a dataset that waits already is not queued twice."""

    def __init__(self, store: Store):
        self._store = store
        self._worker = ThreadPoolExecutor(1, thread_name_prefix="recompute")
        self._waiting: set[str] = set()
        self._lock = threading.Lock()
        self._closed = threading.Event()

    def request(self, dataset: str) -> Future[None] | None:
        """Solve what is stale in a dataset, soon; None when that is already waiting."""
        with self._lock:
            if dataset in self._waiting or self._closed.is_set():
                return None
            self._waiting.add(dataset)
            return self._worker.submit(self._run, dataset)

    def close(self) -> None:
        """Stop after the batch in hand."""
        self._closed.set()
        self._worker.shutdown(cancel_futures=True)

    def _run(self, dataset: str) -> None:
        # Before the work starts: what changes from now on needs another round.
        with self._lock:
            self._waiting.discard(dataset)
        try:
            solve_dataset(self._store, dataset, progress=self._progress)
        except _ClosedError:
            log.info("solving interrupted", dataset=dataset)
        except Exception:
            log.exception("solving failed", dataset=dataset)

    def _progress(self, *_: object) -> None:
        if self._closed.is_set():
            raise _ClosedError
