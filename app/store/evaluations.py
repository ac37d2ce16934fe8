"""Evaluations in the database: inserted once, read, deleted; never changed."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass, fields
from typing import Any

from sqlalchemy import ColumnElement, delete, func, insert, select
from sqlalchemy.orm import Session

from app.store.codecs import Json, canonical, pack, parse, unpack
from app.store.group_rows import next_id
from app.store.models import DatasetModel
from app.store.prediction_models import EvaluationFrameModel, EvaluationModel

_BATCH = 2000


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


def read_evaluations(
    session: Session, *where: ColumnElement[bool], limit: int = 500
) -> list[StoredEvaluation]:
    """Runs, the newest first."""
    statement = (
        select(*EvaluationModel.__table__.columns, DatasetModel.name.label("dataset"))
        .join(DatasetModel, DatasetModel.id == EvaluationModel.dataset_id)
        .where(*where)
        .order_by(EvaluationModel.id.desc())
        .limit(limit)
    )
    return [_stored(row) for row in session.execute(statement)]


def read_figure(session: Session, evaluation_id: int, name: str) -> Json | None:
    """One figure of a run, or None."""
    statement = select(EvaluationModel.figures).where(EvaluationModel.id == evaluation_id)
    packed = session.execute(statement).scalar_one_or_none()
    return None if packed is None else unpack(packed).get(name)


def read_frame_rows(
    session: Session,
    evaluation_id: int,
    *where: ColumnElement[bool],
    order: Sequence[ColumnElement[Any]] = (),
    limit: int | None = None,
    offset: int = 0,
) -> Iterator[dict[str, Any]]:
    """Frames of a run as values by column; a run never changes, so places are stable."""
    model = EvaluationFrameModel
    names = [column for column in model.__table__.columns if column.name not in _KEEPING]
    statement = (
        select(*names)
        .where(model.evaluation_id == evaluation_id, *where)
        .order_by(*order, model.position)
        .limit(limit)
        .offset(offset)
    )
    for row in session.execute(statement):
        yield dict(row._mapping)


def count_frame_rows(session: Session, evaluation_id: int, *where: ColumnElement[bool]) -> int:
    """How many frames of a run fulfil the conditions."""
    model = EvaluationFrameModel
    statement = (
        select(func.count()).select_from(model).where(model.evaluation_id == evaluation_id, *where)
    )
    return int(session.execute(statement).scalar_one())


def _stored(row: Any) -> StoredEvaluation:
    values = {item.name: getattr(row, item.name) for item in fields(StoredEvaluation)}
    for name in ("pins", "counts", "tables"):
        values[name] = parse(values[name])
    return StoredEvaluation(**{**values, "figures": tuple(unpack(row.figures))})


_KEEPING = ("evaluation_id", "position")
