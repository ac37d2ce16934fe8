"""Guidelines in the database: what annotators of a dataset are told, and its pictures."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

from sqlalchemy import func, select

from app.db.dialects.dialect import insert
from app.db.session import Session, now
from app.features.independent_annotations.tables import (
    CopyDatasetModel,
    GuidelineModel,
    GuidelinePictureModel,
)

GUIDELINE = "guideline"
"""Kind of the log's entries about them; each has the digest of a text."""


class GuidelineText(NamedTuple):
    """One version of a dataset's guidelines."""

    dataset_id: int
    number: int
    text: str


def list_all_guidelines(session: Session) -> Sequence[GuidelineText]:
    """Every version of the guidelines of every dataset."""
    model = GuidelineModel
    return session.rows(GuidelineText, select(model.dataset_id, model.number, model.text))


def find_guidelines_dataset(session: Session, dataset_id: int) -> int:
    """Of which dataset the guidelines count in a dataset: of that which it holds copies of."""
    statement = select(CopyDatasetModel.of_id).where(CopyDatasetModel.dataset_id == dataset_id)
    return session.scalar(statement) or dataset_id


class GuidelineHead(NamedTuple):
    """When and by whom a version of guidelines was written."""

    number: int
    written: str
    written_by: str


def list_guideline_heads(session: Session, dataset_id: int) -> Sequence[GuidelineHead]:
    """Every version of a dataset's guidelines without its text, the newest first."""
    model = GuidelineModel
    statement = select(model.number, model.written, model.written_by).where(
        model.dataset_id == dataset_id
    )
    return session.rows(GuidelineHead, statement.order_by(model.number.desc()))


def read_guideline_text(session: Session, dataset_id: int, number: int) -> str | None:
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


class StoredPicture(NamedTuple):
    """A picture of guidelines: its media type and its bytes."""

    type: str
    body: bytes


def find_picture(session: Session, dataset_id: int, digest: str) -> StoredPicture | None:
    """A picture by its digest."""
    model = GuidelinePictureModel
    mine = (model.dataset_id == dataset_id) & (model.digest == digest)
    return session.row(StoredPicture, select(model.type, model.body).where(mine))


def count_pictures(session: Session, dataset_id: int) -> int:
    """How many pictures a dataset's guidelines have."""
    model = GuidelinePictureModel
    statement = select(func.count()).select_from(model).where(model.dataset_id == dataset_id)
    return session.scalar(statement) or 0
