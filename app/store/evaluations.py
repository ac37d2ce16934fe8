"""Evaluations in the database: inserted once, read, deleted; never changed."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, fields
from typing import Any

from sqlalchemy import delete, insert, select

from app.canonical import canonical
from app.store.aliases import columns_shown
from app.store.group_rows import next_id
from app.store.session import Session
from app.store.stored_json import Json, pack, parse, unpack
from app.store.tables.groups import DatasetModel
from app.store.tables.predictions import EvaluationFrameModel, EvaluationModel

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
