"""The table of marks: which groups have changed, in the order of their last change."""

from __future__ import annotations

from sqlalchemy import ForeignKey
from sqlalchemy.orm import Mapped, mapped_column

from app.store.tables.base import Base


class GroupChangeModel(Base):
    """The last change of a group, its inputs or its solution; triggers write it, nobody else.

    Ids grow with every change and are never given again: who remembers one finds what has
    changed since. A group from before there were marks has none.
    """

    __tablename__ = "group_change"
    __table_args__ = ({"sqlite_autoincrement": True},)

    id: Mapped[int] = mapped_column(primary_key=True)
    dataset_id: Mapped[int]
    group_id: Mapped[int] = mapped_column(ForeignKey("groups.id", ondelete="CASCADE"), unique=True)
