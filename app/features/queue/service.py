"""Pages of groups by query, where a group stands among them, and how far the review of them is."""

from __future__ import annotations

import base64
import binascii
import json
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, fields, replace
from typing import Any

import numpy as np

from app.db.store import Store
from app.errors import InputError, NotFoundError
from app.features.agreement.queries import read_agreement_states
from app.features.comments.queries import count_open_threads
from app.features.independent_annotations.queries import count_submitted
from app.features.queue.fields import STATUSES
from app.features.queue.queries import GroupListing, Key, find_dataset_and_sort_keys, read_rows
from app.features.queue.query import NUMBERS, Query, parse_query
from app.geometry.arrays import FloatArray, IntArray
from app.json_text import MAX_ID, json_text


def encode_cursor(query: Query, keys: Sequence[Key]) -> str:
    """The cursor that continues after the row with these keys."""
    text = json_text([_make_query_fingerprint(query), *keys], ascii_=True, compact=True)
    return base64.urlsafe_b64encode(text.encode()).decode().rstrip("=")


def decode_cursor(query: Query, cursor: str) -> list[Key]:
    """The keys of a cursor; raises InputError when it is none of this query's."""
    try:
        padded = cursor + "=" * (-len(cursor) % 4)
        text = base64.b64decode(padded, altchars=b"-_", validate=True)
        name, *values = json.loads(text)
    except (binascii.Error, ValueError, TypeError) as error:
        raise InputError(
            "the cursor is invalid; request the first page without a cursor", pointer="/cursor"
        ) from error
    sound = all(map(_is_valid_cursor_key, values))
    if name != _make_query_fingerprint(query) or len(values) != len(query.order.keys) or not sound:
        raise InputError(
            "this cursor belongs to another query; request the first page without a cursor",
            pointer="/cursor",
        )
    return list(values)


def _make_query_fingerprint(query: Query) -> str:
    """What tells a query from others: its order, and a digest of its conditions."""
    order = query.sort + ("-desc" if query.descending else "")
    if query.batch is not None:
        order = f"batch {query.batch}"
    return f"{order} {query.digest}"


def _is_valid_cursor_key(value: Any) -> bool:
    """Whether the database can compare with a value: no NaN, no Infinity, no endless integer."""
    if value is None or isinstance(value, str):
        return True
    if not isinstance(value, (int, float)):
        return False
    # No key of a row is beyond; NaN is not below it either.
    return abs(value) <= MAX_ID


MAX_PAGE = 500
MAX_IDS = 100_000
_NEIGHBOURS = 5


@dataclass(frozen=True)
class GroupRow:
    """One group in a list; numbers are None where there is none, all while it is not solved.

    Attributes:
        gate: The first failing gate with its view and sentence, None when the group passes.
        main_view: Id of the main view, None when it has no frame to show.
        override: The gate that was overridden when the group was accepted, or None.
        findings: Kinds that are open.
        dismissed: Kinds that somebody has checked.
        comments: Threads that are open.
        submissions: How many people submitted an annotation of their own.
        annotations: What these came to: ``agreed``, ``open`` (somebody has to decide), ``decided``; None:
            they were not compared.
    """

    id: int
    number: int
    key: str
    label: str
    match: str
    split: str
    changed: str
    views: int
    pictures: int
    main_view: int | None
    status: str
    stale: bool
    fixed: bool
    reason: str | None
    reviewer: str | None
    override: str | None
    solved: bool
    passes: bool | None
    gate: str | None
    gate_view: str | None
    gate_sentence: str | None
    margin: float | None
    value: float | None
    min_jac: float | None
    error_px: float | None
    error_percent: float | None
    sigma_m: float | None
    parallax_degrees: float | None
    size_ratio: float | None
    height_m: float | None
    distance_m: float | None
    box_px: float | None
    x_m: float | None
    y_m: float | None
    agreement: float | None
    findings: tuple[str, ...]
    dismissed: tuple[str, ...] = ()
    comments: int = 0
    submissions: int = 0
    annotations: str | None = None


@dataclass(frozen=True)
class Page:
    """Groups in order; ``next`` is the cursor of the page after, None at the end."""

    items: list[GroupRow]
    next: str | None
    total: int


@dataclass(frozen=True)
class Neighbours:
    """Where a group stands among those that match, and what comes before and after it.

    Attributes:
        index: From 0; None when the group does not match.
        total: How many match in all.
        previous: Ids of the groups before this one, the nearest first.
        next: Ids of the groups after this one, the nearest first.
    """

    index: int | None
    total: int
    previous: tuple[int, ...]
    next: tuple[int, ...]


@dataclass(frozen=True)
class MatchingGroupIds:
    """Ids of groups in order, out of ``total`` that match.

    Attributes:
        total: How many match in all.
    """

    ids: tuple[int, ...]
    total: int


def list_groups(
    store: Store,
    dataset_id: int,
    query: str = "",
    limit: int = 50,
    cursor: str | None = None,
    start: int | None = None,
) -> Page:
    """A page of the groups that match.

    Args:
        store: The database.
        dataset_id: The dataset.
        query: As ``query.parse_query`` reads it.
        limit: Most groups of the page, 1 to 500.
        cursor: ``next`` of the page before, for the same query.
        start: Position of the first group, from 0, instead of a cursor.

    Raises:
        InputError: The query, the limit, the cursor or the position cannot be understood.
    """
    parsed = parse_query(query)
    if not 1 <= limit <= MAX_PAGE:
        raise InputError(f"limit must be 1 to {MAX_PAGE} groups", pointer="/limit")
    if cursor is not None and start is not None:
        raise InputError("give a cursor or a position, not both", pointer="/from")
    order = parsed.order
    keys = None if cursor is None else decode_cursor(parsed, cursor)
    with store.read() as session:
        listing = GroupListing(session, dataset_id, parsed.conditions)
        total = listing.count()
        if start is not None:
            rows = read_rows(session, listing.ids_from(order, start, limit, total), order)
            more = start + limit < total
        else:
            rows = listing.rows_after(order, keys, limit + 1)
            more = len(rows) > limit
        ids = [row.group_id for row in rows[:limit]]
        comments, annotations = count_open_threads(session, ids), count_submitted(session, ids)
        states = read_agreement_states(session, list(annotations)) if annotations else {}
    rows = rows[:limit]
    following = encode_cursor(parsed, order.keys_of(rows[-1])) if more else None
    found = [
        replace(
            _build_group_row(row, comments),
            submissions=annotations.get(row.group_id, 0),
            annotations=states.get(row.group_id),
        )
        if annotations
        else _build_group_row(row, comments)
        for row in rows
    ]
    return Page(found, following, total)


def list_ids(
    store: Store, dataset_id: int, query: str = "", limit: int = MAX_IDS, start: int = 0
) -> MatchingGroupIds:
    """The ids alone of the groups that match, in order, from a position on.

    Raises:
        InputError: The query cannot be understood.
    """
    parsed = parse_query(query)
    with store.read() as session:
        listing = GroupListing(session, dataset_id, parsed.conditions)
        total = listing.count()
        ids = listing.ids_from(parsed.order, start, limit, total)
    return MatchingGroupIds(tuple(ids), total)


def find_neighbours(store: Store, group_id: int, query: str = "") -> Neighbours:
    """Where a group stands in a query's order, and up to five groups on either side.

    A group that does not match (it was just accepted, say) still has a place in the order.

    Raises:
        NotFoundError: There is no such group.
    """
    parsed = parse_query(query)
    order = parsed.order
    with store.read() as session:
        place = find_dataset_and_sort_keys(session, group_id, order)
        if place is None:
            raise NotFoundError.group(group_id)
        dataset_id, keys = place
        listing = GroupListing(session, dataset_id, parsed.conditions)
        index, total = listing.find_position_and_total(order, keys, group_id)
        before, after = listing.ids_around(order, keys, _NEIGHBOURS, total)
    return Neighbours(index, total, tuple(before), tuple(after))


_STORED = [
    item.name
    for item in fields(GroupRow)
    if item.name not in ("id", "findings", "dismissed", "comments", "submissions", "annotations")
]


def _build_group_row(row: Any, comments: Mapping[int, int]) -> GroupRow:
    return GroupRow(
        id=row.group_id,
        findings=_split_comma_list(row.findings),
        dismissed=_split_comma_list(row.dismissed),
        comments=comments.get(row.group_id, 0),
        **{name: getattr(row, name) for name in _STORED},
    )


def _split_comma_list(text: str) -> tuple[str, ...]:
    """A list between commas."""
    return tuple(text.strip(",").split(",")) if text else ()


def make_even_bins(low: float, high: float, bins: int) -> tuple[float, ...]:
    """Edges of bins of equal width, shape (bins + 1,)."""
    return tuple(np.round(np.linspace(low, high, bins + 1), 6).tolist())


def make_logarithmic_bins(first: int, last: int, per_decade: int) -> tuple[float, ...]:
    """Edges of logarithmic bins from ``10**first`` to ``10**last``, after one that begins at 0.

    Numbers that spread over decades (errors of given and of drawn cameras, say) would fall into
    one bin of equal width. 0 has no logarithm: the bin before the first decade holds it, and
    whatever else is too small to matter.

    Args:
        first: Exponent of the first power of ten.
        last: Exponent of the last one.
        per_decade: Bins from one power of ten to the next.

    Example:
        >>> make_logarithmic_bins(-1, 1, 2)
        (0.0, 0.1, 0.316, 1.0, 3.16, 10.0)
    """
    steps = range(first * per_decade, last * per_decade + 1)
    return (0.0, *(float(f"{10 ** (step / per_decade):.3g}") for step in steps))


SIGMA_M = make_logarithmic_bins(-2, 2, 5)
"""Of the ball's uncertainty, metres: from a centimetre to a hundred metres."""
ERROR_PERCENT = make_logarithmic_bins(-2, 1, 6)
"""Of the reprojection error, per cent of the diagonal: from 0.2 px in HD to 220 px."""


def find_bin_indices(
    edges: Sequence[float], values: FloatArray, *, open_low: bool, open_high: bool
) -> IntArray:
    """The bin of each value, -1 for one in no bin (NaN, or beyond an end that is closed).

    As queries compare: from an edge on and below the next one; a closed last bin has its end.
    """
    bins = len(edges) - 1
    place = np.searchsorted(np.array(edges), values, "right") - 1
    if open_low:
        place = np.maximum(place, 0)
    place[values == edges[-1]] = bins - 1
    if open_high:
        place = np.minimum(place, bins - 1)
    place[np.isnan(values) | (place >= bins)] = -1
    return place.astype(np.int64)


@dataclass(frozen=True)
class HistogramBins:
    """The bins of a number's histogram; the first bin has no lower end.

    Attributes:
        open_high: The last bin has no upper end.
        log: Its bins are powers of ten apart (see ``make_logarithmic_bins``).
    """

    edges: tuple[float, ...]
    open_high: bool = True
    log: bool = False


COLUMNS = {
    "jac": HistogramBins(make_even_bins(0, 1, 20), open_high=False),
    "error_percent": HistogramBins(ERROR_PERCENT, log=True),
    "sigma": HistogramBins(SIGMA_M, log=True),
    "parallax": HistogramBins(make_even_bins(0, 180, 20), open_high=False),
    "size_ratio": HistogramBins(make_even_bins(0, 2, 20)),
    "agreement": HistogramBins(make_even_bins(0, 1, 20), open_high=False),
}
"""The bins are fixed, so that they stay put while one filters."""


@dataclass(frozen=True)
class Histogram:
    """Counts of a column over the groups that match; ``unknown`` ones have no such number."""

    column: HistogramBins
    counts: tuple[int, ...]
    unknown: int


@dataclass(frozen=True)
class MatchingGroupsSummary:
    """How many groups match, how many of them are in each state, and the histograms."""

    groups: int
    solved: int
    accepted: int
    rejected: int
    deferred: int
    unreviewed: int
    stale: int
    histograms: dict[str, Histogram]


def summarize_groups(store: Store, dataset_id: int, query: str = "") -> MatchingGroupsSummary:
    """Progress and histograms over the groups of a dataset that match a query.

    Raises:
        InputError: The query cannot be understood.
    """
    columns = ("status", "solved", "stale", *(NUMBERS[name] for name in COLUMNS))
    conditions = parse_query(query).conditions
    # One pass for all of it: seven statements over ten thousand groups take seven times as long.
    with store.read() as session:
        rows = GroupListing(session, dataset_id, conditions).columns(columns)
    status, solved, stale, *numbers = (
        zip(*rows, strict=True) if rows else ((),) * (3 + len(COLUMNS))
    )
    states = Counter(status)
    return MatchingGroupsSummary(
        groups=len(rows),
        solved=sum(solved),
        stale=sum(stale),
        histograms={
            name: _make_histogram(column, values)
            for (name, column), values in zip(COLUMNS.items(), numbers, strict=True)
        },
        **{state: states[state] for state in STATUSES},
    )


def _make_histogram(column: HistogramBins, values: Sequence[float | None]) -> Histogram:
    numbers = np.array(values, float)
    place = find_bin_indices(column.edges, numbers, open_low=True, open_high=column.open_high)
    counts = np.bincount(place[place >= 0], minlength=len(column.edges) - 1)
    return Histogram(column, tuple(counts.tolist()), int(np.isnan(numbers).sum()))
