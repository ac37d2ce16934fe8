"""Guidelines in the database: what annotators of a dataset are told, and its pictures."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from sqlalchemy import func, select

from app.db.dialects.statements import insert
from app.db.session import Session, now
from app.features.independent_annotations.tables import (
    CopyDatasetModel,
    GuidelineModel,
    GuidelinePictureModel,
)

GUIDELINE = "guideline"
"""Kind of the log's entries about them; each has the digest of a text."""


def all_guidelines(session: Session) -> Sequence[Any]:
    """``dataset_id``, ``number`` and ``text`` of every version of every dataset."""
    model = GuidelineModel
    return session.execute(select(model.dataset_id, model.number, model.text)).all()


def guidelines_dataset(session: Session, dataset_id: int) -> int:
    """Of which dataset the guidelines count in a dataset: of that which it holds copies of."""
    statement = select(CopyDatasetModel.of_id).where(CopyDatasetModel.dataset_id == dataset_id)
    return session.scalar(statement) or dataset_id


def guideline_heads(session: Session, dataset_id: int) -> Sequence[Any]:
    """``number``, ``written`` and ``written_by`` of every version, the newest first."""
    model = GuidelineModel
    statement = select(model.number, model.written, model.written_by).where(
        model.dataset_id == dataset_id
    )
    return session.execute(statement.order_by(model.number.desc())).all()


def guideline_text(session: Session, dataset_id: int, number: int) -> str | None:
    """The text of a version."""
    model = GuidelineModel
    mine = (model.dataset_id == dataset_id) & (model.number == number)
    return session.scalar(select(model.text).where(mine))


def insert_guideline(session: Session, dataset_id: int, number: int, text: str, by: str) -> None:
    """Insert a version, which counts from now on."""
    values = {"dataset_id": dataset_id, "number": number, "text": text}
    session.execute(insert(GuidelineModel).values(**values, written=now(), written_by=by))


def insert_picture(session: Session, dataset_id: int, digest: str, kind: str, body: bytes) -> None:
    """Keep a picture; what is there already stays."""
    values = {"dataset_id": dataset_id, "digest": digest, "type": kind, "body": body}
    session.execute(insert(GuidelinePictureModel).values(**values).on_conflict_do_nothing())


def find_picture(session: Session, dataset_id: int, digest: str) -> Any | None:
    """``type`` and ``body`` of a picture."""
    model = GuidelinePictureModel
    mine = (model.dataset_id == dataset_id) & (model.digest == digest)
    return session.execute(select(model.type, model.body).where(mine)).one_or_none()


def count_pictures(session: Session, dataset_id: int) -> int:
    """How many pictures a dataset's guidelines have."""
    model = GuidelinePictureModel
    statement = select(func.count()).select_from(model).where(model.dataset_id == dataset_id)
    return session.scalar(statement) or 0
