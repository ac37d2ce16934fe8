"""Tables of verdicts: they only grow, the last one of a group counts.

A batch holds verdicts that were given at once.
"""

from __future__ import annotations

from sqlalchemy import ForeignKey, Index
from sqlalchemy.orm import Mapped, mapped_column

from app.db.session import Base


class VerdictModel(Base):
    """One person's verdict on one state of a group; the newest is the effective one.

    ``override`` names the gate that failed when the group was accepted all the same.
    """

    __tablename__ = "verdict"
    __table_args__ = (Index("verdict_group", "group_id", "id"),)

    id: Mapped[int] = mapped_column(primary_key=True)
    group_id: Mapped[int] = mapped_column(ForeignKey("groups.id"))
    actor: Mapped[str]
    at: Mapped[str]
    state: Mapped[str]
    reason: Mapped[str | None]
    note: Mapped[str | None]
    inputs_hash: Mapped[str]
    policy_hash: Mapped[str]
    fixed: Mapped[bool]
    override: Mapped[str | None]


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
