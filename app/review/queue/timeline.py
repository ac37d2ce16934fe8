"""Timeline: the groups of a dataset one after the other, in the few numbers that a curve needs."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

from app.review.queue.query import parse_query
from app.store.conditions import compares
from app.store.listing import Listing
from app.store.store import Store

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
        conditions.append(compares("match", "=", match))
    with store.read() as session:
        rows = Listing(session, dataset_id, conditions).columns(_SOURCES, by_number=True)
    timeline = Timeline()
    for name, value in _COLUMNS.items():
        getattr(timeline, name).extend(map(value, rows))
    return timeline


def _frame(row: Any) -> int | None:
    key = row.key
    return int(key) if key.isascii() and key.isdigit() and len(key) <= _FRAME_DIGITS else None


def _point(row: Any) -> tuple[float, float, float] | None:
    place = (row.x_m, row.y_m, row.height_m)
    return None if None in place else (row.x_m, row.y_m, -row.height_m)


_SOURCES = (
    "group_id", "number", "key", "error_px", "passes", "gate", "status", "stale", "sigma_m",
    "x_m", "y_m", "height_m",
)  # fmt: skip
_COLUMNS: dict[str, Callable[[Any], Any]] = {
    "id": lambda row: row.group_id,
    "number": lambda row: row.number,
    "frame": _frame,
    "error_px": lambda row: row.error_px,
    "passes": lambda row: row.passes,
    "gate": lambda row: row.gate,
    "status": lambda row: row.status,
    "stale": lambda row: row.stale,
    "sigma_m": lambda row: row.sigma_m,
    "point": _point,
}
