"""Evaluations and their frames: inserted once, read, deleted; never changed."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass, fields
from typing import Any

from sqlalchemy import ColumnElement, and_, delete, func, insert, select
from sqlalchemy.orm import InstrumentedAttribute

from app.canonical import canonical
from app.db.json_columns import Json, pack, parse, unpack
from app.db.session import Session
from app.features.datasets.tables import DatasetModel
from app.features.groups.insert_queries import next_id
from app.features.people.alias_queries import columns_shown
from app.features.predictions.tables import EvaluationFrameModel, EvaluationModel

_BATCH = 2000
_MOST = 500
"""Runs of a dataset that are listed."""
_EVALUATIONS = select(*columns_shown(EvaluationModel), DatasetModel.name.label("dataset")).join(
    DatasetModel, DatasetModel.id == EvaluationModel.dataset_id
)


@dataclass(frozen=True)
class StoredEvaluation:
    """A run without its figures and frames; ``pins``, ``counts`` and ``tables`` are JSON."""

    id: int
    dataset_id: int
    dataset: str
    name: str
    created: str
    actor: str
    prediction_set_id: int | None
    careful_set_id: int | None
    version_id: int | None
    pins: Json
    counts: Json
    tables: Json
    figures: tuple[str, ...]
    """Names."""


def insert_evaluation(
    session: Session, values: Mapping[str, Any], figures: Mapping[str, Json], frames: Sequence[Any]
) -> int:
    """Insert a run; returns its id.

    Args:
        session: A write session.
        values: Columns of the run but its id; ``pins``, ``counts`` and ``tables`` as JSON values.
        figures: By name.
        frames: Dataclasses whose fields are columns of ``EvaluationFrameModel``, in order.
    """
    identity = next_id(session, EvaluationModel)
    texts = {name: canonical(values[name]) for name in ("pins", "counts", "tables")}
    row = {**values, **texts, "id": identity, "figures": pack(dict(figures))}
    session.execute(insert(EvaluationModel), [row])
    for start in range(0, len(frames), _BATCH):
        rows = [
            {**asdict(frame), "evaluation_id": identity, "position": position}
            for position, frame in enumerate(frames[start : start + _BATCH], start)
        ]
        session.execute(
            insert(EvaluationFrameModel), rows, execution_options={"render_nulls": True}
        )
    return identity


def delete_evaluation(session: Session, evaluation_id: int) -> None:
    """Delete a run with its frames; nothing where there is none."""
    session.execute(delete(EvaluationModel).where(EvaluationModel.id == evaluation_id))


def dataset_evaluations(session: Session, dataset_id: int) -> list[StoredEvaluation]:
    """The runs of a dataset, the newest first."""
    statement = _EVALUATIONS.where(EvaluationModel.dataset_id == dataset_id)
    rows = session.execute(statement.order_by(EvaluationModel.id.desc()).limit(_MOST))
    return [_stored(row) for row in rows]


def find_evaluation(session: Session, evaluation_id: int) -> StoredEvaluation | None:
    """A run by its id."""
    statement = _EVALUATIONS.where(EvaluationModel.id == evaluation_id)
    row = session.execute(statement).one_or_none()
    return None if row is None else _stored(row)


def read_figure(session: Session, evaluation_id: int, name: str) -> Json | None:
    """One figure of a run, or None."""
    statement = select(EvaluationModel.figures).where(EvaluationModel.id == evaluation_id)
    packed = session.execute(statement).scalar_one_or_none()
    return None if packed is None else unpack(packed).get(name)


def _stored(row: Any) -> StoredEvaluation:
    values = {item.name: getattr(row, item.name) for item in fields(StoredEvaluation)}
    for name in ("pins", "counts", "tables"):
        values[name] = parse(values[name])
    return StoredEvaluation(**{**values, "figures": tuple(unpack(row.figures))})


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
