"""Dismissals: findings that a person has checked; they only grow, the last one of a finding counts."""

from __future__ import annotations

from sqlalchemy import Double, ForeignKey, Index
from sqlalchemy.orm import Mapped, mapped_column

from app.db.session import Base


class DismissalModel(Base):
    """A finding of a group that somebody dismissed, or (``dismissed`` false) opened again.

    ``kind``, ``view``, ``marking`` and ``suggested`` name the finding; ``number`` and ``sentence``
    are what it said: where it says something else now, the dismissal no longer counts.
    """

    __tablename__ = "dismissal"
    __table_args__ = (Index("dismissal_group", "group_id", "id"),)

    id: Mapped[int] = mapped_column(primary_key=True)
    group_id: Mapped[int] = mapped_column(ForeignKey("groups.id"))
    actor: Mapped[str]
    at: Mapped[str]
    kind: Mapped[str]
    view: Mapped[str | None]
    marking: Mapped[str | None]
    suggested: Mapped[str | None]
    number: Mapped[float | None] = mapped_column(Double)
    sentence: Mapped[str]
    dismissed: Mapped[bool]
    note: Mapped[str | None]
