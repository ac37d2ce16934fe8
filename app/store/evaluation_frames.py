"""Frames of evaluations in the database: those that fulfil conditions, in the order of a number."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from typing import Any

from sqlalchemy import ColumnElement, and_, func, select
from sqlalchemy.orm import InstrumentedAttribute

from app.store.session import Session
from app.store.tables.predictions import EvaluationFrameModel

FrameCondition = ColumnElement[bool]
"""Whether a frame is meant; made by the functions here."""

_KEEPING = ("evaluation_id", "position")


def is_of_match(match: str) -> FrameCondition:
    """The frame is of a match."""
    return EvaluationFrameModel.match == match


def lies_in(column: str, low: float | None, high: float | None) -> FrameCondition:
    """The frame has a number, and it lies in [low, high)."""
    value = _column(column)
    where: list[FrameCondition] = [value.is_not(None)]
    if low is not None:
        where.append(value >= low)
    if high is not None:
        where.append(value < high)
    return and_(*where)


def lacks(column: str) -> FrameCondition:
    """The frame has a ball and no such number."""
    return and_(_column(column).is_(None), EvaluationFrameModel.ball.is_(True))


def count_frame_rows(
    session: Session, evaluation_id: int, conditions: Iterable[FrameCondition] = ()
) -> int:
    """How many frames of a run fulfil all conditions."""
    model = EvaluationFrameModel
    where = (model.evaluation_id == evaluation_id, *conditions)
    return session.scalar(select(func.count()).select_from(model).where(*where)) or 0


def read_frame_rows(
    session: Session,
    evaluation_id: int,
    conditions: Iterable[FrameCondition] = (),
    *,
    sort: str | None = None,
    descending: bool = False,
    limit: int | None = None,
    offset: int = 0,
) -> Iterator[dict[str, Any]]:
    """Frames of a run as values by column; a run never changes, so places are stable.

    ``sort`` is a column, whose missing numbers come last; None: as they stand in the dataset.
    """
    model = EvaluationFrameModel
    order: list[ColumnElement[Any]] = []
    if sort is not None:
        value = _column(sort)
        order = [value.is_(None), value.desc() if descending else value.asc()]
    columns = [item for item in model.__table__.columns if item.name not in _KEEPING]
    statement = (
        select(*columns)
        .where(model.evaluation_id == evaluation_id, *conditions)
        .order_by(*order, model.position)
        .limit(limit)
        .offset(offset)
    )
    for row in session.execute(statement):
        yield dict(row._mapping)


def _column(name: str) -> InstrumentedAttribute[Any]:
    column: InstrumentedAttribute[Any] = getattr(EvaluationFrameModel, name)
    return column
