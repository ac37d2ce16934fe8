"""Source noise: how noisy the balls of one static camera or of one person are, beside their dataset's.

Each miss of rays (``ball_noise``) has a variance to which every view adds its own part: that of the
dataset, times the squared factors of its camera and of who placed its ball. All factors are sought
together, each drawn towards one by what few numbers say, so that who placed little is not called
good or bad, and who works at a bad camera is not blamed for it.

Source: Osborne, "Fisher's method of scoring" (1992); Efron & Morris, "Stein's paradox in statistics"
(shrinkage).
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Literal, NamedTuple

import numpy as np

from app.geometry.arrays import BoolArray, FloatArray, IntArray
from app.solving.ball_noise import LIMIT, MIN_NUMBERS, TRIMMED, RayResidual
from app.solving.noise_grid import NORMAL_95

SPREAD = 0.5
"""Of the logarithm of a factor: sources differ by so much."""
DECIMALS = 2
"""Of a factor that is used: what lies below is no difference."""
_ROUNDS, _LONGEST, _SETTLED = 30, 0.5, 1e-4


class BallSource(NamedTuple):
    """Where a ball comes from: a static camera by its key, or a person by their name."""

    kind: Literal["camera", "person"]
    name: str


@dataclass(frozen=True)
class SourceNoise:
    """Noise of the balls of one source, with its 95 % interval.

    Attributes:
        source: A station's key or a person's name.
        sigma_px: Of a coordinate of a ball, without the part that grows with the ball, pixels at
            1920 x 1080.
        ratio: Of that to the dataset's.
        numbers: Independent numbers that speak of this source alone.
    """

    source: str
    sigma_px: float
    low: float
    high: float
    ratio: float
    numbers: float

    @property
    def differs(self) -> bool:
        """Whether the interval leaves out the dataset's sigma."""
        return not self.low <= self.sigma_px / self.ratio <= self.high


@dataclass(frozen=True)
class SourceFactors:
    """The factors of the sources of which enough is seen.

    Attributes:
        sigma_px: Of the dataset, pixels at 1920 x 1080.
        sources: In the order of the rows.
        logs: Logarithms of their factors, shape (S,).
        covariance: Of these, shape (S, S).
        numbers: Independent numbers that speak of each, shape (S,).
    """

    sigma_px: float
    sources: tuple[BallSource, ...]
    logs: FloatArray
    covariance: FloatArray
    numbers: FloatArray

    def of(self, kind: str) -> tuple[SourceNoise, ...]:
        """The sources of one kind, the noisiest first."""
        found = []
        for at, source in enumerate(self.sources):
            if source.kind == kind:
                log, half = float(self.logs[at]), NORMAL_95 * math.sqrt(self.covariance[at, at])
                low, middle, high = (
                    self.sigma_px * math.exp(end) for end in (log - half, log, log + half)
                )
                numbers = float(self.numbers[at])
                found.append(SourceNoise(source.name, middle, low, high, math.exp(log), numbers))
        return tuple(sorted(found, key=lambda item: -item.sigma_px))

    def factor(self, sources: Sequence[BallSource]) -> float:
        """How noisy a ball of these sources is beside the dataset's; one where it may be alike.

        What is asked is whether all of them together differ: of a camera whose balls one person
        places that may be known though nobody knows which of the two it is.
        """
        row = np.array([source in sources for source in self.sources], float)
        log, variance = float(row @ self.logs), float(row @ self.covariance @ row)
        if abs(log) <= NORMAL_95 * math.sqrt(variance):
            return 1.0
        return round(math.exp(log), DECIMALS)


NOBODY = SourceFactors(1.0, (), np.zeros(0), np.zeros((0, 0)), np.zeros(0))
"""Nothing is known of any source."""


@dataclass(frozen=True)
class _SourceVariances:
    """What views add to the variance of misses.

    Attributes:
        squares: Of the misses, shape (M,).
        known: The variance to which no source adds, shape (M,).
        added: By each view that has a source, at the dataset's noise, shape (C,).
        row: Of its miss, shape (C,).
        of: Which sources it has, shape (C, S).
    """

    squares: FloatArray
    known: FloatArray
    added: FloatArray
    row: IntArray
    of: FloatArray

    def view_variances(self, logs: FloatArray) -> FloatArray:
        """What the views add under some factors, shape (C,)."""
        own: FloatArray = self.added * np.exp(2 * self.of @ logs)
        return own

    def miss_variances(self, own: FloatArray) -> FloatArray:
        """Of the misses, shape (M,)."""
        variance: FloatArray = self.known + np.bincount(self.row, own, len(self.known))
        return variance

    def variances_by_source(self, own: FloatArray) -> FloatArray:
        """What the views of each source add to each miss, shape (M, S)."""
        total = np.zeros((len(self.known), self.of.shape[1]))
        np.add.at(total, self.row, own[:, None] * self.of)
        return total

    def without_outliers(self, logs: FloatArray) -> BoolArray:
        """Misses that are no mistakes, shape (M,)."""
        kept: BoolArray = self.squares <= LIMIT * self.miss_variances(self.view_variances(logs))
        return kept

    def log_variance_derivatives(self, logs: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Of the variances' logarithms by those of the factors, (M, S), and the variances, (M,)."""
        own = self.view_variances(logs)
        variance = self.miss_variances(own)
        return 2 * self.variances_by_source(own) / variance[:, None], variance


def estimate_sources(
    misses: Sequence[tuple[RayResidual, Mapping[str, Sequence[BallSource]]]],
    click: float,
    share: float,
    given: float,
) -> SourceFactors:
    """The noise of each source of which enough is seen, cameras and people together.

    Args:
        misses: Of many groups, each with the sources of each of its views.
        click: The dataset's sigma of a clicked ball, pixels at 1920 x 1080.
        share: What the ball's diameter adds to it.
        given: What a given camera adds to it, pixels at 1920 x 1080.
    """
    sources = _distinct_sources(
        [of.get(view[0], ()) for miss, of in misses for view in miss.by_view]
    )
    if not sources:
        return NOBODY
    parts = _make_source_variances(misses, sources, np.array([click**2, share**2, given**2]))
    logs, covariance, numbers = _fit_factors(parts)
    seen = np.flatnonzero(numbers >= MIN_NUMBERS)
    return SourceFactors(
        math.hypot(click, given) if given and not click else click,
        tuple(sources[at] for at in seen.tolist()),
        logs[seen],
        covariance[np.ix_(seen, seen)],
        numbers[seen],
    )


def _distinct_sources(seen: Sequence[Sequence[BallSource]]) -> list[BallSource]:
    """The sources, without those that all views have: one alone is the dataset."""
    every = sorted({source for sources in seen for source in sources})
    return [one for one in every if not all(one in sources for sources in seen)]


def _make_source_variances(
    misses: Sequence[tuple[RayResidual, Mapping[str, Sequence[BallSource]]]],
    sources: Sequence[BallSource],
    squared: FloatArray,
) -> _SourceVariances:
    place = {source: at for at, source in enumerate(sources)}
    known = np.array([miss.known for miss, _ in misses])
    added, rows, which = [], [], []
    for row, (miss, of) in enumerate(misses):
        for view, *columns in miss.by_view:
            own = [place[source] for source in of.get(view, ()) if source in place]
            if own:
                added.append(float(np.dot(columns, squared)))
                rows.append(row)
                which.append(np.isin(np.arange(len(sources)), own))
            else:
                known[row] += np.dot(columns, squared)
    squares = np.array([miss.miss**2 for miss, _ in misses])
    of_each = np.array(which, float).reshape(-1, len(sources))
    return _SourceVariances(squares, known, np.array(added), np.array(rows, np.int64), of_each)


def _fit_factors(parts: _SourceVariances) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Logarithms of the factors, their covariance, and how much speaks of each."""
    logs = np.zeros(parts.of.shape[1])
    for _ in range(_ROUNDS):
        kept = parts.without_outliers(logs)
        slopes, variance = (array[kept] for array in parts.log_variance_derivatives(logs))
        pull = 0.5 * slopes.T @ (parts.squares[kept] / TRIMMED / variance - 1) - logs / SPREAD**2
        step = np.linalg.solve(_fisher_information(slopes), pull)
        logs = logs + np.clip(step, -_LONGEST, _LONGEST)
        if np.abs(step).max() < _SETTLED:
            break
    kept = parts.without_outliers(logs)
    slopes = parts.log_variance_derivatives(logs)[0][kept]
    covariance = np.linalg.inv(_fisher_information(slopes)).astype(np.float64)
    return logs, covariance, slopes.sum(axis=0) / 2


def _fisher_information(slopes: FloatArray) -> FloatArray:
    """Fisher's, with that of the prior, shape (S, S)."""
    total: FloatArray = 0.5 * slopes.T @ slopes + np.eye(slopes.shape[1]) / SPREAD**2
    return total
