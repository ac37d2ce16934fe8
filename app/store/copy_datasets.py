"""Datasets of copies: whose own annotations of another dataset's groups they hold."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

from sqlalchemy import insert, select

from app.store.session import Session
from app.store.tables.groups import DatasetModel
from app.store.tables.takes import CopyDatasetModel

_COPIES = select(*CopyDatasetModel.__table__.columns, DatasetModel.name).join(
    DatasetModel, DatasetModel.id == CopyDatasetModel.dataset_id
)


@dataclass(frozen=True)
class CopiesOf:
    """Of what a dataset holds copies: of the groups of ``of_id``, by a person, in a batch (0: none)."""

    of_id: int
    batch_id: int
    person: str


def insert_copy_dataset(session: Session, dataset_id: int, copies: CopiesOf) -> None:
    """Say whose copies a dataset holds."""
    session.execute(insert(CopyDatasetModel), [{"dataset_id": dataset_id, **vars(copies)}])


def copies_of(session: Session, dataset_id: int) -> Sequence[Any]:
    """``dataset_id``, ``of_id``, ``batch_id``, ``person`` and ``name`` of a dataset's copies."""
    return session.execute(_COPIES.where(CopyDatasetModel.of_id == dataset_id)).all()


def find_copies(session: Session, copies: CopiesOf) -> Any | None:
    """The dataset of such copies."""
    column = CopyDatasetModel
    mine = (column.of_id == copies.of_id) & (column.batch_id == copies.batch_id)
    return session.execute(_COPIES.where(mine, column.person == copies.person)).one_or_none()


def copy_dataset_ids(session: Session) -> frozenset[int]:
    """Ids of the datasets that hold somebody's copies."""
    return frozenset(session.scalars(select(CopyDatasetModel.dataset_id)))


def is_copy(session: Session, dataset_id: int) -> bool:
    """Whether a dataset holds somebody's copies."""
    mine = CopyDatasetModel.dataset_id == dataset_id
    return session.scalar(select(CopyDatasetModel.dataset_id).where(mine)) is not None
