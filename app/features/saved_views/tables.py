"""The table of saved views: queries of the queue under names."""

from __future__ import annotations

from sqlalchemy import ForeignKey, UniqueConstraint
from sqlalchemy.orm import Mapped, mapped_column

from app.db.session import Base


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
