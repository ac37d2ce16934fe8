"""Queue: pages of groups by query, and where a group stands among them.

There are two ways to read on: a cursor (no group is seen twice or missed while others edit) and a
position (any place at once, true at the moment of reading).
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, fields, replace
from typing import Any

from app.errors import InputError, NotFoundError
from app.review.queue import cursor as cursors
from app.review.queue.query import parse_query
from app.store.agreement import states_of
from app.store.listing import Listing, find_place, read_rows
from app.store.store import Store
from app.store.takes import count_handed_in
from app.store.threads import count_open

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
        takes: How many people handed in an annotation of their own.
        came_to: What these came to: ``agreed``, ``open`` (somebody has to decide), ``decided``; None:
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
    takes: int = 0
    came_to: str | None = None


@dataclass(frozen=True)
class Page:
    """Groups in order; ``next`` is the cursor of the page after, None at the end."""

    items: list[GroupRow]
    next: str | None
    total: int


@dataclass(frozen=True)
class Neighbours:
    """Where a group stands among those that match.

    Attributes:
        index: From 0; None when the group itself does not match (any more).
        previous: Ids before it, the nearest first; ``next`` likewise after it.
    """

    index: int | None
    total: int
    previous: tuple[int, ...]
    next: tuple[int, ...]


@dataclass(frozen=True)
class Ids:
    """Ids of groups in order, out of ``total`` that match."""

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
        raise InputError(f"a page has 1 to {MAX_PAGE} groups", pointer="/limit")
    if cursor is not None and start is not None:
        raise InputError("a page begins at a cursor or at a position, not both", pointer="/from")
    order = parsed.order
    keys = None if cursor is None else cursors.decode(parsed, cursor)
    with store.read() as session:
        listing = Listing(session, dataset_id, parsed.conditions)
        total = listing.count()
        if start is not None:
            rows = read_rows(session, listing.ids_from(order, start, limit, total), order)
            more = start + limit < total
        else:
            rows = listing.rows_after(order, keys, limit + 1)
            more = len(rows) > limit
        ids = [row.group_id for row in rows[:limit]]
        said, takes = count_open(session, ids), count_handed_in(session, ids)
        states = states_of(session, list(takes)) if takes else {}
    rows = rows[:limit]
    following = cursors.encode(parsed, order.keys_of(rows[-1])) if more else None
    found = [
        replace(_row(row, said), takes=takes.get(row.group_id, 0), came_to=states.get(row.group_id))
        if takes
        else _row(row, said)
        for row in rows
    ]
    return Page(found, following, total)


def list_ids(
    store: Store, dataset_id: int, query: str = "", limit: int = MAX_IDS, start: int = 0
) -> Ids:
    """The ids alone of the groups that match, in order, from a position on.

    Raises:
        InputError: The query cannot be understood.
    """
    parsed = parse_query(query)
    with store.read() as session:
        listing = Listing(session, dataset_id, parsed.conditions)
        total = listing.count()
        ids = listing.ids_from(parsed.order, start, limit, total)
    return Ids(tuple(ids), total)


def neighbours(store: Store, group_id: int, query: str = "") -> Neighbours:
    """Where a group stands in a query's order, and up to five groups on either side.

    A group that does not match (it was just accepted, say) still has a place in the order.

    Raises:
        NotFoundError: There is no such group.
    """
    parsed = parse_query(query)
    order = parsed.order
    with store.read() as session:
        place = find_place(session, group_id, order)
        if place is None:
            raise NotFoundError.group(group_id)
        dataset_id, keys = place
        listing = Listing(session, dataset_id, parsed.conditions)
        index, total = listing.place(order, keys, group_id)
        before, after = listing.ids_around(order, keys, _NEIGHBOURS, total)
    return Neighbours(index, total, tuple(before), tuple(after))


_STORED = [
    item.name
    for item in fields(GroupRow)
    if item.name not in ("id", "findings", "dismissed", "comments", "takes", "came_to")
]


def _row(row: Any, said: Mapping[int, int]) -> GroupRow:
    return GroupRow(
        id=row.group_id,
        findings=_kinds(row.findings),
        dismissed=_kinds(row.dismissed),
        comments=said.get(row.group_id, 0),
        **{name: getattr(row, name) for name in _STORED},
    )


def _kinds(text: str) -> tuple[str, ...]:
    """A list between commas."""
    return tuple(text.strip(",").split(",")) if text else ()
