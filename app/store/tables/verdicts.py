"""Verdicts: they only grow (a trigger sees to it); the last one of a group counts."""

from __future__ import annotations

from sqlalchemy import ForeignKey, Index
from sqlalchemy.orm import Mapped, mapped_column

from app.store.tables.base import Base


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
