"""Statistics and the timeline of a dataset.

They say how its numbers are spread, and how they run over its groups.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
import numpy.typing as npt

from app.db.store import Store
from app.features.people.visibility_queries import has_hidden_groups as has_hidden_groups
from app.features.queue.queries import GroupListing, compare_condition
from app.features.queue.query import NUMBERS, parse_query
from app.features.queue.service import ERROR_PERCENT, SIGMA_M, find_bin_indices, make_even_bins
from app.geometry.arrays import BoolArray, FloatArray, IntArray


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
class MeasureCountsOfSplit:
    """Counts of one split; ``unknown`` groups have no such number.

    Attributes:
        unknown: Groups that have no such number.
    """

    split: str
    counts: tuple[int, ...]
    unknown: int


@dataclass(frozen=True)
class MeasureHistogram:
    """A measure over the groups that match; ``queries`` open the queue at each bar."""

    measure: Measure
    queries: tuple[str, ...]
    series: tuple[MeasureCountsOfSplit, ...]


@dataclass(frozen=True)
class BallPositionCounts:
    """Balls on the pitch in cells, metres of the pitch frame; ``counts`` by row of y, then x.

    Attributes:
        x_edges: Metres along the length, from the centre mark.
        y_edges: Metres across, towards the main cameras.
        counts: A row for each cell of y, in it one for each x.
        outside: Balls that lie outside all cells.
    """

    x_edges: tuple[float, ...]
    y_edges: tuple[float, ...]
    counts: tuple[tuple[int, ...], ...]
    outside: int


@dataclass(frozen=True)
class MatchSplitCounts:
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
    histograms: tuple[MeasureHistogram, ...]
    positions: BallPositionCounts
    matches: tuple[MatchSplitCounts, ...]
    splits: tuple[MatchSplitCounts, ...]


MEASURES = (
    Measure("distance", "Camera to ball", "m", "distance", make_even_bins(0, 120, 24)),
    Measure("parallax", "Parallax", "°", "parallax", make_even_bins(0, 180, 36), open_high=False),
    Measure("sigma", "Uncertainty", "m", "sigma", SIGMA_M, log=True),
    Measure("box", "Ball diameter in the image", "px", "box", make_even_bins(0, 40, 20)),
    Measure("size_ratio", "Annotated over expected size", "", "ratio", make_even_bins(0, 3, 30)),
    Measure(
        "height", "Height above the grass", "m", "height", make_even_bins(-1, 11, 24), open_low=True
    ),
    Measure(
        "error", "Reprojection error", "% of the diagonal", "error_percent", ERROR_PERCENT, log=True
    ),
    Measure(
        "jac", "Lowest JaC of views in use", "", "jac", make_even_bins(0, 1, 20), open_high=False
    ),
    Measure(
        "agreement",
        "Lowest agreement with the paint",
        "",
        "agreement",
        make_even_bins(0, 1, 20),
        open_high=False,
    ),
)

X_EDGES = make_even_bins(-60, 60, 24)
Y_EDGES = make_even_bins(-40, 40, 16)
"""Cells of 5 m, with a rim around the pitch."""


COLUMNS = (
    "split",
    "match",
    "passes",
    "status",
    "x_m",
    "y_m",
    *(NUMBERS[measure.field] for measure in MEASURES),
)
"""Of the queue, what statistics are about."""
UNKNOWN, NOWHERE = -1, -2
"""In place of a bin or cell: there is no such number, or it lies in none."""


@dataclass(frozen=True, eq=False)
class StatisticsColumns:
    """Groups as statistics count them: 21 bytes each, whatever was measured.

    Attributes:
        split: Index in ``splits`` of each group, shape (G,); ``match`` likewise.
        passes: Shape (G,), like ``accepted``.
        cell: Of the ball on the pitch, by row of y, then x, shape (G,).
        bins: Of each of ``MEASURES``, shape (9, G).
    """

    splits: tuple[str, ...]
    matches: tuple[str, ...]
    split: npt.NDArray[np.int32]
    match: npt.NDArray[np.int32]
    passes: BoolArray
    accepted: BoolArray
    cell: npt.NDArray[np.int16]
    bins: npt.NDArray[np.int8]

    @property
    def groups(self) -> int:
        """How many groups there are."""
        return len(self.split)


def read_statistics(store: Store, dataset_id: int, query: str = "") -> Statistics:
    """Statistics over the groups of a dataset that match a query.

    Raises:
        InputError: The query cannot be understood.
    """
    conditions = parse_query(query).conditions
    with store.read() as session:
        rows = GroupListing(session, dataset_id, conditions).columns(COLUMNS)
    return make_statistics(rows_to_statistics_columns(rows))


def rows_to_statistics_columns(rows: Sequence[Any]) -> StatisticsColumns:
    """Rows of ``COLUMNS`` as they are counted."""
    nothing: list[tuple[Any, ...]] = [()] * len(COLUMNS)
    split, match, passes, status, *numbers = list(zip(*rows, strict=True)) or nothing
    x, y, *values = (np.array(column, float) for column in numbers)
    splits, matches = sorted(set(split)), sorted(set(match))
    of_split = {name: place for place, name in enumerate(splits)}
    of_match = {name: place for place, name in enumerate(matches)}
    return StatisticsColumns(
        splits=tuple(splits),
        matches=tuple(matches),
        split=np.array([of_split[name] for name in split], np.int32),
        match=np.array([of_match[name] for name in match], np.int32),
        passes=np.array([bool(value) for value in passes], bool),
        accepted=np.array([state == "accepted" for state in status], bool),
        cell=_find_pitch_cells(x, y),
        bins=np.array(
            [
                _find_value_bins(measure, column)
                for measure, column in zip(MEASURES, values, strict=True)
            ],
            np.int8,
        ).reshape(len(MEASURES), -1),
    )


def make_statistics(found: StatisticsColumns) -> Statistics:
    """The statistics of groups."""
    return Statistics(
        groups=found.groups,
        histograms=tuple(
            _make_histogram(measure, found.bins[place], found)
            for place, measure in enumerate(MEASURES)
        ),
        positions=_count_ball_positions(found.cell),
        matches=_count_by_match_and_split(found, found.match, found.matches),
        splits=_count_by_match_and_split(found, np.zeros_like(found.match), ("",)),
    )


def make_bin_query(measure: Measure, place: int) -> str:
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


def _find_value_bins(measure: Measure, values: FloatArray) -> IntArray:
    place = find_bin_indices(
        measure.edges, values, open_low=measure.open_low, open_high=measure.open_high
    )
    return np.where(np.isnan(values), UNKNOWN, np.where(place < 0, NOWHERE, place))


def _find_pitch_cells(x: FloatArray, y: FloatArray) -> npt.NDArray[np.int16]:
    column, row = (
        find_bin_indices(edges, values, open_low=False, open_high=False)
        for edges, values in ((X_EDGES, x), (Y_EDGES, y))
    )
    cell = row * (len(X_EDGES) - 1) + column
    outside = np.where((row < 0) | (column < 0), NOWHERE, cell)
    return np.where(np.isnan(x) | np.isnan(y), UNKNOWN, outside).astype(np.int16)


def _make_histogram(
    measure: Measure, place: npt.NDArray[np.int8], found: StatisticsColumns
) -> MeasureHistogram:
    bins = len(measure.edges) - 1
    # NOWHERE, UNKNOWN, and the bins, of each split.
    width = bins + 2
    code = found.split * width + (place - NOWHERE)
    counts = np.bincount(code, minlength=len(found.splits) * width).reshape(-1, width)
    series = tuple(
        MeasureCountsOfSplit(split, tuple(row[2:].tolist()), int(row[UNKNOWN - NOWHERE]))
        for split, row in sorted(zip(found.splits, counts, strict=True), key=_get_pair_name)
        if row.any()
    )
    queries = tuple(make_bin_query(measure, number) for number in range(bins))
    return MeasureHistogram(measure, queries, series)


def _get_pair_name(pair: tuple[str, Any]) -> str:
    return pair[0]


def _count_ball_positions(cell: npt.NDArray[np.int16]) -> BallPositionCounts:
    rows, columns = len(Y_EDGES) - 1, len(X_EDGES) - 1
    counts = np.bincount(cell.astype(np.int64) - NOWHERE, minlength=rows * columns + 2)
    whole = counts[2:].reshape(rows, columns)
    return BallPositionCounts(
        x_edges=X_EDGES,
        y_edges=Y_EDGES,
        counts=tuple(tuple(row) for row in whole.tolist()),
        outside=int(counts[0]),
    )


def _count_by_match_and_split(
    found: StatisticsColumns, match: npt.NDArray[np.int32], matches: Sequence[str]
) -> tuple[MatchSplitCounts, ...]:
    width = max(len(found.splits), 1)
    code = match.astype(np.int64) * width + found.split
    size = len(matches) * width
    groups, passing, accepted = (
        np.bincount(code[chosen], minlength=size).tolist()
        for chosen in (slice(None), found.passes, found.accepted)
    )
    shares = [
        MatchSplitCounts(matches[place // width], found.splits[place % width], *counts)
        for place, counts in enumerate(zip(groups, passing, accepted, strict=True))
        if counts[0]
    ]
    return tuple(sorted(shares, key=lambda share: (share.match, share.split)))


_FRAME_DIGITS = 12
"""Frame numbers have fewer; longer runs of digits are names."""


@dataclass(frozen=True)
class Timeline:
    """Groups in order, column by column: the values of one group stand at one index.

    Attributes:
        frame: Number of the video frame where the key of the group is one, else None.
        error_px: The larger reprojection error of the best pair, with or without a ball.
        passes: None while the group is not solved.
        gate: The first failing gate.
        point: The 3D ball, pitch frame, metres, z down.
    """

    id: list[int] = field(default_factory=list)
    number: list[int] = field(default_factory=list)
    frame: list[int | None] = field(default_factory=list)
    error_px: list[float | None] = field(default_factory=list)
    passes: list[bool | None] = field(default_factory=list)
    gate: list[str | None] = field(default_factory=list)
    status: list[str] = field(default_factory=list)
    stale: list[bool] = field(default_factory=list)
    sigma_m: list[float | None] = field(default_factory=list)
    point: list[tuple[float, float, float] | None] = field(default_factory=list)


def read_timeline(
    store: Store, dataset_id: int, query: str = "", match: str | None = None
) -> Timeline:
    """The groups of a dataset that match a query, in the order of their numbers.

    The order that the query asks for has no say: time runs one way.

    Args:
        store: The database.
        dataset_id: The dataset.
        query: As ``query.parse_query`` reads it.
        match: Groups of this match alone; None: of all matches.

    Raises:
        InputError: The query cannot be understood.
    """
    conditions = list(parse_query(query).conditions)
    if match is not None:
        conditions.append(compare_condition("match", "=", match))
    with store.read() as session:
        rows = GroupListing(session, dataset_id, conditions).columns(_SOURCES, by_number=True)
    timeline = Timeline()
    for name, value in _COLUMNS.items():
        getattr(timeline, name).extend(map(value, rows))
    return timeline


def _parse_row_frame_number(row: Any) -> int | None:
    key = row.key
    return int(key) if key.isascii() and key.isdigit() and len(key) <= _FRAME_DIGITS else None


def _get_row_ball_point(row: Any) -> tuple[float, float, float] | None:
    place = (row.x_m, row.y_m, row.height_m)
    return None if None in place else (row.x_m, row.y_m, -row.height_m)


_SOURCES = (
    "group_id", "number", "key", "error_px", "passes", "gate", "status", "stale", "sigma_m",
    "x_m", "y_m", "height_m",
)  # fmt: skip
_COLUMNS: dict[str, Callable[[Any], Any]] = {
    "id": lambda row: row.group_id,
    "number": lambda row: row.number,
    "frame": _parse_row_frame_number,
    "error_px": lambda row: row.error_px,
    "passes": lambda row: row.passes,
    "gate": lambda row: row.gate,
    "status": lambda row: row.status,
    "stale": lambda row: row.stale,
    "sigma_m": lambda row: row.sigma_m,
    "point": _get_row_ball_point,
}
