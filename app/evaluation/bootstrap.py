"""Intervals by resampling whole matches: frames of one match are not independent of each other."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from app.evaluation.result import Cell
from app.geometry.arrays import FloatArray

RESAMPLES = 1000
SEED = 20_250_411
LEVEL = 0.95


@dataclass(frozen=True)
class MatchResamples:
    """How often each match was drawn in each resample.

    Attributes:
        matches: Keys, sorted.
        counts: Draws, shape (resamples, matches); no rows where there are fewer than two
            matches, which leaves nothing to resample.
    """

    matches: tuple[str, ...]
    counts: FloatArray

    @staticmethod
    def draw(
        matches: Sequence[str], resamples: int = RESAMPLES, seed: int = SEED
    ) -> MatchResamples:
        """Draw matches with replacement, as many as there are."""
        names = tuple(sorted(set(matches)))
        if len(names) < 2:
            return MatchResamples(names, np.zeros((0, len(names))))
        rng = np.random.default_rng(seed)
        share = np.full(len(names), 1 / len(names))
        return MatchResamples(names, rng.multinomial(len(names), share, resamples).astype(float))

    def find_match_columns(self, matches: Sequence[str]) -> npt.NDArray[np.int64]:
        """Column of ``counts`` of each match, shape (N,).

        Raises:
            KeyError: A match was not among those drawn from.
        """
        place = {name: index for index, name in enumerate(self.matches)}
        return np.array([place[match] for match in matches], dtype=np.int64)

    def mean_with_interval(
        self, values: Sequence[float], matches: Sequence[str], of: int | None = None
    ) -> Cell:
        """The mean with its interval; ``matches`` says where each value comes from.

        Args:
            values: One number per item.
            matches: Match of each item.
            of: How many items there could have been.
        """
        count, whole = len(values), len(values) if of is None else of
        if not count:
            return Cell(None, count=0, of=whole)
        array, place = np.asarray(values, dtype=float), self.find_match_columns(matches)
        sums = np.bincount(place, array, len(self.matches))
        sizes = np.bincount(place, minlength=len(self.matches)).astype(float)
        with np.errstate(invalid="ignore", divide="ignore"):
            means = (self.counts @ sums) / (self.counts @ sizes)
        return Cell(float(array.mean()), *percentile_interval(means), count, whole)

    def compute_interval(
        self, compute: Callable[[FloatArray], float]
    ) -> tuple[float | None, float | None]:
        """The interval of any number that is computed from a weight per match, shape (M,)."""
        return percentile_interval(np.array([compute(weights) for weights in self.counts]))


def percentile_interval(values: FloatArray) -> tuple[float | None, float | None]:
    """Ends of the central 95 % of resampled values: the percentile interval of the bootstrap.

    Args:
        values: One number per resample, in the statistic's unit, shape (resamples,); NaN and
            infinity, of resamples without any value, do not count.

    Returns:
        Both ends, or None twice where no value is left (Efron & Tibshirani 1993, 13.3).
    """
    found = values[np.isfinite(values)]
    if not len(found):
        return None, None
    tail = (1 - LEVEL) / 2
    low, high = np.quantile(found, [tail, 1 - tail]).tolist()
    return low, high
