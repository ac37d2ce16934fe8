"""Progress: how far the groups of a query are, and how their numbers are spread."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

from sqlalchemy import ColumnElement, Integer, cast, func, select
from sqlalchemy.orm import InstrumentedAttribute, Session

from app.review.query import STATUSES, parse_query
from app.store.models import QueueModel
from app.store.session import Store

BINS = 20
RANGES = {
    "jac": (QueueModel.min_jac, 0.0, 1.0),
    "error_percent": (QueueModel.error_percent, 0.0, 2.0),
    "sigma": (QueueModel.sigma_m, 0.0, 2.0),
    "parallax": (QueueModel.parallax_degrees, 0.0, 180.0),
    "size_ratio": (QueueModel.size_ratio, 0.0, 2.0),
}
"""Column and range of each histogram: fixed, so that the bins stay put while one filters."""


@dataclass(frozen=True)
class Histogram:
    """Counts in bins of equal width from ``low`` to ``high``; the end bins hold what lies
    beyond."""

    low: float
    high: float
    counts: tuple[int, ...]


@dataclass(frozen=True)
class Summary:
    """How many groups match, how many of them are in each state, and the histograms."""

    groups: int
    solved: int
    accepted: int
    rejected: int
    deferred: int
    unreviewed: int
    stale: int
    histograms: dict[str, Histogram]


def summary(store: Store, dataset_id: int, query: str = "") -> Summary:
    """Progress and histograms over the groups of a dataset that match a query.

    Raises:
        InputError: The query cannot be understood.
    """
    where = [QueueModel.dataset_id == dataset_id, *parse_query(query).conditions]
    counts = (
        func.count(),
        func.sum(cast(QueueModel.solved, Integer)),
        func.sum(cast(QueueModel.stale, Integer)),
    )
    with store.read() as session:
        states = session.execute(
            select(QueueModel.status, *counts).where(*where).group_by(QueueModel.status)
        ).all()
        histograms = {
            name: _histogram(session, where, column, low, high)
            for name, (column, low, high) in RANGES.items()
        }
    by_state = {row[0]: int(row[1]) for row in states}
    return Summary(
        groups=sum(by_state.values()),
        solved=sum(int(row[2]) for row in states),
        stale=sum(int(row[3]) for row in states),
        histograms=histograms,
        **{state: by_state.get(state, 0) for state in STATUSES},
    )


def _histogram(
    session: Session,
    where: Sequence[ColumnElement[bool]],
    column: InstrumentedAttribute[Any],
    low: float,
    high: float,
) -> Histogram:
    # Counted by the database: the numbers of a whole season need not travel.
    place = cast((column - low) * (BINS / (high - low)), Integer)
    within = func.max(func.min(place, BINS - 1), 0).label("place")
    counted = dict(
        session.execute(
            select(within, func.count()).where(*where, column.is_not(None)).group_by(within)
        ).all()
    )
    return Histogram(low, high, tuple(counted.get(index, 0) for index in range(BINS)))
