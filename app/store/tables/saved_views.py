"""Tables around the queue: its saved views, batches of verdicts, and ids that are used up."""

from __future__ import annotations

from sqlalchemy import ForeignKey, Index, UniqueConstraint
from sqlalchemy.orm import Mapped, mapped_column

from app.store.tables.base import Base


class SavedViewModel(Base):
    """A query of the queue under a name that everybody who works on the dataset sees."""

    __tablename__ = "saved_view"
    __table_args__ = (UniqueConstraint("dataset_id", "name", name="saved_view_name"),)

    id: Mapped[int] = mapped_column(primary_key=True)
    dataset_id: Mapped[int] = mapped_column(ForeignKey("dataset.id"))
    name: Mapped[str]
    query: Mapped[str]
    actor: Mapped[str]
    created: Mapped[str]


class VerdictBatchModel(Base):
    """Verdicts that were given at once; ``spans`` (JSON) are first and last id of each chunk.

    ``log_id`` is the entry that closed the batch, None while it runs (or was killed).
    ``undo_spans`` are those of the verdicts that took it back, ``redone`` is the id of the batch
    that gave it again after that.
    """

    __tablename__ = "verdict_batch"
    __table_args__ = (Index("verdict_batch_dataset", "dataset_id", "id"),)

    id: Mapped[int] = mapped_column(primary_key=True)
    dataset_id: Mapped[int] = mapped_column(ForeignKey("dataset.id"))
    actor: Mapped[str]
    at: Mapped[str]
    query: Mapped[str]
    state: Mapped[str]
    reason: Mapped[str | None]
    note: Mapped[str | None]
    changed: Mapped[int]
    spans: Mapped[str]
    log_id: Mapped[int | None]
    undone: Mapped[str | None]
    undone_by: Mapped[str | None]
    undo_spans: Mapped[str | None]
    redone: Mapped[int | None]


COPIES_USED = "copy_dataset"
"""Under which name the ids of datasets of copies are remembered, which are counted by themselves."""


class UsedIdModel(Base):
    """The largest id of a table that a deleted dataset had; ids are given once and for all."""

    __tablename__ = "used_id"

    table: Mapped[str] = mapped_column(primary_key=True)
    id: Mapped[int]
