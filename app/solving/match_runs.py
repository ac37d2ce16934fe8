"""Match runs: which frames are of one match, where nobody names the matches.

Frames of a match follow each other by name in the files that there are. Neighbouring runs are
joined, the two first that gain most by it, for as long as one place that moves with the pan
explains both better than one each (``match_model``).
"""

from __future__ import annotations

from collections.abc import Sequence
from heapq import heappop, heappush

import numpy as np

from app.solving.match_model import FramePlace, PlaceEquations

WANDER_M = np.array([0.3, 0.3, 0.18])
"""What frames of one match are allowed to differ by, each axis, beyond their own sigmas."""


def guess_matches(places: Sequence[FramePlace | None]) -> list[int]:
    """A match for each frame, from 0, where nobody names them: runs whose places agree.

    Args:
        places: Of all frames by name; None where a frame says nothing, it goes with the one
            before.
    """
    known = [(index, place) for index, place in enumerate(places) if place is not None]
    runs = _Runs([place for _, place in known])
    runs.join()
    run = {known[at][0]: number for number, at in enumerate(runs.firsts)}
    return _filled(run, len(places))


class _Runs:
    """Runs of places side by side, each known by its first place."""

    def __init__(self, places: Sequence[FramePlace]):
        self._equations = PlaceEquations(places, WANDER_M)
        self._end = {at: at + 1 for at in range(len(places))}
        self._begin = {at + 1: at for at in range(len(places))}
        self._cost = {at: self._cost_of(at, at + 1) for at in range(len(places))}
        self._gains: list[tuple[float, int, int, int, float]] = []

    @property
    def firsts(self) -> list[int]:
        """The first place of each run."""
        return sorted(self._end)

    def join(self) -> None:
        """Join neighbours until none gains by it."""
        for first in self.firsts:
            self._consider(first)
        while self._gains:
            _, first, second, end, cost = heappop(self._gains)
            if self._end.get(first) != second or self._end.get(second) != end:
                continue
            del self._end[second]
            self._end[first], self._begin[end], self._cost[first] = end, first, cost
            self._consider(first)
            if first in self._begin:
                self._consider(self._begin[first])

    def _consider(self, first: int) -> None:
        """Note what a run and the one behind it gain when they are joined."""
        second = self._end[first]
        if second not in self._end:
            return
        end = self._end[second]
        cost = self._cost_of(first, end)
        gain = self._cost[first] + self._cost[second] - cost
        if gain > 0:
            heappush(self._gains, (-gain, first, second, end, cost))

    def _cost_of(self, first: int, end: int) -> float:
        return self._equations.fit(slice(first, end)).cost


def _filled(run: dict[int, int], count: int) -> list[int]:
    """Runs of all frames from those of first frames; without any, each frame is its own."""
    if not run:
        return list(range(count))
    matches, present = [], 0
    for index in range(count):
        present = run.get(index, present)
        matches.append(present)
    return matches
