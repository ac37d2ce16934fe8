"""Saved views in the database: queries of the queue under names."""

from __future__ import annotations

from collections.abc import Sequence

from sqlalchemy import ForeignKey, UniqueConstraint, delete, insert, select
from sqlalchemy.orm import Mapped, mapped_column

from app.db.session import Base, Session, now
from app.features.groups.insert_queries import find_next_row_id, reserve_row_ids
from app.features.people.visibility_queries import shown_actor_column


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


_SAVED = select(
    *(column for column in SavedViewModel.__table__.columns if column.name != "actor"),
    shown_actor_column(SavedViewModel.actor, SavedViewModel.created).label("actor"),
)


def list_saved_views_of_dataset(session: Session, dataset_id: int) -> Sequence[SavedViewModel]:
    """The saved views of a dataset, by name."""
    statement = _SAVED.where(SavedViewModel.dataset_id == dataset_id)
    return session.rows(SavedViewModel, statement.order_by(SavedViewModel.name))


def find_saved_view(session: Session, view_id: int) -> SavedViewModel | None:
    """A saved view by its id."""
    return session.row(SavedViewModel, _SAVED.where(SavedViewModel.id == view_id))


def insert_saved_view(session: Session, dataset_id: int, *, actor: str, **values: str) -> int:
    """Insert a saved view with the values of its columns; returns its id."""
    identity = find_next_row_id(session, SavedViewModel)
    row = {"id": identity, "dataset_id": dataset_id, "actor": actor, "created": now(), **values}
    session.execute(insert(SavedViewModel), [row])
    return identity


def delete_saved_view(session: Session, view_id: int) -> None:
    """Delete a saved view; nothing where there is none."""
    reserve_row_ids(session, SavedViewModel)
    session.execute(delete(SavedViewModel).where(SavedViewModel.id == view_id))
