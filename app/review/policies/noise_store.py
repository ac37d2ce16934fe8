"""NoiseStore: the noise of the datasets that somebody asked about, until something changes."""

from __future__ import annotations

from collections import OrderedDict
from threading import Lock

from app.review.policies.noise import Noise, read_noise
from app.review.policies.policy import read_policy
from app.store.log import newest_entry
from app.store.solutions import newest_solution
from app.store.store import Store

SIZE = 64
"""Datasets whose last answer is kept; the one that was not asked for the longest goes first."""


class NoiseStore:
    """The last answer for each dataset, computed anew when log, solutions or policy differ."""

    def __init__(self, store: Store):
        self._store = store
        self._lock = Lock()
        self._kept: OrderedDict[int, tuple[tuple[int, int, str, str], Noise]] = OrderedDict()

    def read(self, dataset: str | int) -> Noise:
        """``read_noise`` of the present state.

        Raises:
            NotFoundError: There is no such dataset.
        """
        # The mark is older than what is read: at worst a new answer is computed once too often.
        with self._store.read() as session:
            entry, solution = newest_entry(session), newest_solution(session)
        state = read_policy(self._store, dataset)
        mark = entry, solution, state.policy.hash, state.dataset
        with self._lock:
            kept = self._kept.get(state.dataset_id)
            if kept is not None and kept[0] == mark:
                self._kept.move_to_end(state.dataset_id)
                return kept[1]
        noise = read_noise(self._store, state.dataset_id)
        with self._lock:
            self._kept[state.dataset_id] = mark, noise
            self._kept.move_to_end(state.dataset_id)
            if len(self._kept) > SIZE:
                self._kept.popitem(last=False)
        return noise
