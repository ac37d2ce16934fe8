"""Rater agreement: how far several people judge alike beyond what chance alone would give.

Every coefficient is a function of sums over items, so a resample of the items is one matrix
product; intervals are percentiles of resampled items (``bootstrap``), seeded.
"""

from __future__ import annotations

from collections.abc import Callable, Hashable, Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np

from app.evaluation.bootstrap import Resamples, percentile_interval
from app.geometry.arrays import FloatArray

Rated = Sequence[Sequence[Hashable | None]]
"""What each rater said of each item, one row per item; None where a rater did not judge it."""


@dataclass(frozen=True)
class Coefficient:
    """One coefficient of agreement.

    Attributes:
        name: ``cohen``, ``fleiss`` or ``krippendorff``.
        value: 1 is complete agreement, 0 what chance gives; None where nobody could disagree:
            no item was judged twice, or all judgements are the same.
        low: Lower end of the 95 % interval; None where there is none.
        high: Upper end.
        observed: Share of pairs of judgements that agree; None without any pair.
        items: How many items it was computed from.
    """

    name: Literal["cohen", "fleiss", "krippendorff"]
    value: float | None
    low: float | None
    high: float | None
    observed: float | None
    items: int


def cohen_kappa(first: Sequence[Hashable], second: Sequence[Hashable]) -> Coefficient:
    """Cohen's kappa of two raters who judged the same items.

    kappa = (p_o - p_e) / (1 - p_e), with p_o the share of items both call the same, and p_e the
    sum over categories of the product of both raters' shares of it.

    Args:
        first: One rater's category of each item.
        second: The other's, of the same length.

    Source: Cohen, "A coefficient of agreement for nominal scales", 1960, eq. 1.
    """
    names = _index_categories([first, second])
    count = len(names)
    parts = np.zeros((len(first), count, count))
    for row, (a, b) in enumerate(zip(first, second, strict=True)):
        parts[row, names[a], names[b]] = 1
    return _resampled_coefficient("cohen", parts, _cohen_of_tables)


def fleiss_kappa(rated: Rated) -> Coefficient:
    """Fleiss' kappa of items that were judged by equally many people, not always the same.

    Args:
        rated: As many judgements of each item, None nowhere.

    Raises:
        ValueError: Items were judged by different numbers of people, or by one alone.

    Source: Fleiss, "Measuring nominal scale agreement among many raters", 1971, eq. 2-7.
    """
    if len({len(row) for row in rated}) > 1 or (rated and len(rated[0]) < 2):
        raise ValueError(
            "Fleiss' kappa needs the same number of judgements of each item, two or more"
        )
    counts = _count_categories(rated)
    raters = counts.sum(axis=1, keepdims=True)
    agreeing = (counts * (counts - 1)).sum(axis=1, keepdims=True) / (raters * (raters - 1))
    return _resampled_coefficient("fleiss", np.hstack([agreeing, counts / raters]), _fleiss_of_sums)


def krippendorff_alpha(rated: Rated) -> Coefficient:
    """Krippendorff's alpha of categories, where not everybody judged every item.

    alpha = 1 - D_o / D_e over the coincidence matrix o_ck, to which an item with m judgements
    gives each of its ordered pairs with weight 1 / (m - 1). Items judged once say nothing.

    Args:
        rated: None where a rater did not judge an item.

    Source: Krippendorff, "Computing Krippendorff's alpha-reliability", 2011, section C.
    """
    counts = _count_categories(
        [row for row in rated if sum(value is not None for value in row) > 1]
    )
    judged = counts.sum(axis=1)
    pairs = counts[:, :, None] * counts[:, None, :]
    places = np.arange(counts.shape[1])
    pairs[:, places, places] -= counts
    return _resampled_coefficient(
        "krippendorff", pairs / (judged - 1)[:, None, None], _alpha_of_coincidences
    )


def _resampled_coefficient(
    name: Literal["cohen", "fleiss", "krippendorff"],
    parts: FloatArray,
    compute: Callable[[FloatArray], tuple[FloatArray, FloatArray]],
) -> Coefficient:
    """A coefficient from each item's part, shape (N, ...), and its interval by resampling."""
    items = len(parts)
    if not items:
        return Coefficient(name, None, None, None, None, 0)
    value, observed = compute(parts.sum(axis=0)[None])
    keys = [f"{number:09d}" for number in range(items)]
    counts = Resamples.draw(keys).counts
    low, high = None, None
    if np.isfinite(value[0]) and len(counts):
        sums = (counts @ parts.reshape(items, -1)).reshape(len(counts), *parts.shape[1:])
        low, high = percentile_interval(compute(sums)[0])
    known = float(value[0]) if np.isfinite(value[0]) else None
    return Coefficient(name, known, low, high, float(observed[0]), items)


def _cohen_of_tables(table: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Kappa and observed agreement of tables of counts, shape (R, K, K)."""
    share = table / table.sum(axis=(1, 2), keepdims=True)
    observed = np.trace(share, axis1=1, axis2=2)
    chance = (share.sum(axis=1) * share.sum(axis=2)).sum(axis=1)
    return _beyond_chance(observed, chance), observed


def _fleiss_of_sums(sums: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Kappa and observed agreement of sums of agreement and shares, shape (R, 1 + K)."""
    items = sums[:, 1:].sum(axis=1)
    observed = sums[:, 0] / items
    chance = ((sums[:, 1:] / items[:, None]) ** 2).sum(axis=1)
    return _beyond_chance(observed, chance), observed


def _alpha_of_coincidences(coincidences: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Alpha and observed agreement of coincidence matrices, shape (R, K, K)."""
    totals = coincidences.sum(axis=2)
    judged = totals.sum(axis=1)
    observed = np.trace(coincidences, axis1=1, axis2=2) / judged
    chance = (totals * (totals - 1)).sum(axis=1) / (judged * (judged - 1))
    return _beyond_chance(observed, chance), observed


def _beyond_chance(observed: FloatArray, chance: FloatArray) -> FloatArray:
    """(observed - chance) / (1 - chance), NaN where chance alone agrees always."""
    room = 1 - chance
    found = np.full(len(room), np.nan)
    there = room > 1e-12
    found[there] = (observed[there] - chance[there]) / room[there]
    return found


def _index_categories(rows: Rated) -> dict[Hashable, int]:
    names: dict[Hashable, int] = {}
    for row in rows:
        for value in row:
            if value is not None:
                names.setdefault(value, len(names))
    return names


def _count_categories(rated: Rated) -> FloatArray:
    """How often each item was given each category, shape (N, K)."""
    names = _index_categories(rated)
    counts = np.zeros((len(rated), len(names)))
    for row, ratings in enumerate(rated):
        for value in ratings:
            if value is not None:
                counts[row, names[value]] += 1
    return counts
