"""Statistics: how distances, parallax, sigma, sizes, heights and positions are spread."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from app.geometry.arrays import FloatArray, IntArray
from app.review.queue.bins import ERROR_PERCENT, SIGMA_M, even, places
from app.review.queue.query import NUMBERS, parse_query
from app.store.listing import Listing
from app.store.session import Store


@dataclass(frozen=True)
class Measure:
    """A number of each group, the bins that it is counted in, and its field in queries.

    Bins stay the same for every query and every dataset, so that two pictures compare; with an
    open end the last one holds what lies beyond, too. Where ``log`` is set they are powers of
    ten apart, and the first one holds 0 and all that is smaller than the first power.
    """

    name: str
    label: str
    unit: str
    field: str
    edges: tuple[float, ...]
    open_low: bool = False
    open_high: bool = True
    log: bool = False


@dataclass(frozen=True)
class Series:
    """Counts of one split; ``unknown`` groups have no such number."""

    split: str
    counts: tuple[int, ...]
    unknown: int


@dataclass(frozen=True)
class Histogram:
    """A measure over the groups that match; ``queries`` open the queue at each bar."""

    measure: Measure
    queries: tuple[str, ...]
    series: tuple[Series, ...]


@dataclass(frozen=True)
class Positions:
    """Balls on the pitch in cells, metres of the pitch frame; ``counts`` by row of y, then x."""

    x_edges: tuple[float, ...]
    y_edges: tuple[float, ...]
    counts: tuple[tuple[int, ...], ...]
    outside: int


@dataclass(frozen=True)
class Share:
    """Groups of a match, or of a split (its ``match`` is empty)."""

    match: str
    split: str
    groups: int
    passing: int
    accepted: int


@dataclass(frozen=True)
class Statistics:
    """All of it, over the groups that match a query."""

    groups: int
    histograms: tuple[Histogram, ...]
    positions: Positions
    matches: tuple[Share, ...]
    splits: tuple[Share, ...]


MEASURES = (
    Measure("distance", "Camera to ball", "m", "distance", even(0, 120, 24)),
    Measure("parallax", "Parallax", "°", "parallax", even(0, 180, 36), open_high=False),
    Measure("sigma", "Uncertainty", "m", "sigma", SIGMA_M, log=True),
    Measure("box", "Ball diameter in the image", "px", "box", even(0, 40, 20)),
    Measure("size_ratio", "Annotated over expected size", "", "ratio", even(0, 3, 30)),
    Measure("height", "Height above the grass", "m", "height", even(-1, 11, 24), open_low=True),
    Measure(
        "error", "Reprojection error", "% of the diagonal", "error_percent", ERROR_PERCENT, log=True
    ),
    Measure("jac", "Lowest JaC of the views", "", "jac", even(0, 1, 20), open_high=False),
    Measure(
        "agreement",
        "Lowest agreement with the paint",
        "",
        "agreement",
        even(0, 1, 20),
        open_high=False,
    ),
)

X_EDGES = even(-60, 60, 24)
Y_EDGES = even(-40, 40, 16)
"""Cells of 5 m, with a rim around the pitch."""


def statistics(store: Store, dataset_id: int, query: str = "") -> Statistics:
    """Statistics over the groups of a dataset that match a query.

    Raises:
        InputError: The query cannot be understood.
    """
    columns = ("split", "match", "passes", "status", "x_m", "y_m")
    measured = (NUMBERS[measure.field] for measure in MEASURES)
    conditions = parse_query(query).conditions
    with store.read() as session:
        rows = Listing(session, dataset_id, conditions).columns((*columns, *measured))
    nothing: list[tuple[Any, ...]] = [()] * (len(columns) + len(MEASURES))
    split, match, passes, status, *numbers = list(zip(*rows, strict=True)) or nothing
    x, y, *values = (np.array(column, float) for column in numbers)
    splits = sorted(set(split))
    of_split = np.array([splits.index(name) for name in split], np.int64)
    judged = (passes, [state == "accepted" for state in status])
    return Statistics(
        groups=len(rows),
        histograms=tuple(
            _histogram(measure, column, splits, of_split)
            for measure, column in zip(MEASURES, values, strict=True)
        ),
        positions=_positions(x, y),
        matches=_shares(zip(match, split, strict=True), *judged),
        splits=_shares((("", name) for name in split), *judged),
    )


def bin_query(measure: Measure, place: int) -> str:
    """The query that finds the groups of one bar."""
    low, high = measure.edges[place], measure.edges[place + 1]
    last = place == len(measure.edges) - 2
    parts = []
    if not (measure.open_low and place == 0):
        parts.append(f"{measure.field}>={low:g}")
    if not last:
        parts.append(f"{measure.field}<{high:g}")
    elif not measure.open_high:
        parts.append(f"{measure.field}<={high:g}")
    return " ".join(parts)


def _histogram(
    measure: Measure, values: FloatArray, splits: Sequence[str], of_split: IntArray
) -> Histogram:
    bins = len(measure.edges) - 1
    place = places(measure.edges, values, open_low=measure.open_low, open_high=measure.open_high)
    inside = place >= 0
    series = []
    for number, split in enumerate(splits):
        mine = of_split == number
        counts = np.bincount(place[mine & inside], minlength=bins)
        unknown = int((mine & np.isnan(values)).sum())
        series.append(Series(split, tuple(counts.tolist()), unknown))
    queries = tuple(bin_query(measure, place) for place in range(bins))
    return Histogram(measure, queries, tuple(series))


def _positions(x: FloatArray, y: FloatArray) -> Positions:
    known = ~(np.isnan(x) | np.isnan(y))
    counts, _, _ = np.histogram2d(y[known], x[known], bins=(Y_EDGES, X_EDGES))
    whole = counts.astype(np.int64)
    return Positions(
        x_edges=X_EDGES,
        y_edges=Y_EDGES,
        counts=tuple(tuple(row) for row in whole.tolist()),
        outside=int(known.sum() - whole.sum()),
    )


def _shares(
    places: Iterable[tuple[str, str]], passes: Iterable[bool | None], accepted: Iterable[bool]
) -> tuple[Share, ...]:
    counts: dict[tuple[str, str], list[int]] = {}
    for place, passing, taken in zip(places, passes, accepted, strict=True):
        count = counts.setdefault(place, [0, 0, 0])
        count[0] += 1
        count[1] += bool(passing)
        count[2] += taken
    return tuple(Share(*place, *count) for place, count in sorted(counts.items()))
