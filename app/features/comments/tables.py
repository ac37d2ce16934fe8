"""Tables of what people say to each other about groups, and of what they are told."""

from __future__ import annotations

from sqlalchemy import ForeignKey, Index
from sqlalchemy.orm import Mapped, mapped_column

from app.db.session import Base


class ThreadModel(Base):
    """Comments that belong together, about a group, or about a view of it and a place there.

    ``view`` is the view's key; ``x`` and ``y`` are pixels of its annotated size. ``resolved`` is when
    somebody said that it is settled, NULL while it is open.
    """

    __tablename__ = "thread"
    __table_args__ = (
        Index("thread_group", "group_id", "id"),
        Index("thread_dataset", "dataset_id"),
    )

    id: Mapped[int] = mapped_column(primary_key=True)
    dataset_id: Mapped[int] = mapped_column(ForeignKey("dataset.id"))
    group_id: Mapped[int] = mapped_column(ForeignKey("groups.id"))
    view: Mapped[str | None]
    x: Mapped[float | None]
    y: Mapped[float | None]
    created: Mapped[str]
    resolved: Mapped[str | None]
    resolved_by: Mapped[str | None]


class CommentModel(Base):
    """What one person says in a thread; ``text`` is NULL once they have deleted it."""

    __tablename__ = "comment"
    __table_args__ = (Index("comment_thread", "thread_id", "id"),)

    id: Mapped[int] = mapped_column(primary_key=True)
    thread_id: Mapped[int] = mapped_column(ForeignKey("thread.id", ondelete="CASCADE"))
    actor: Mapped[str]
    at: Mapped[str]
    edited: Mapped[str | None]
    text: Mapped[str | None]


class CommentMentionModel(Base):
    """Somebody whom a comment mentions, and who saw its dataset when it was written."""

    __tablename__ = "comment_mention"
    __table_args__ = (Index("comment_mention_person", "person_id"),)

    comment_id: Mapped[int] = mapped_column(
        ForeignKey("comment.id", ondelete="CASCADE"), primary_key=True
    )
    person_id: Mapped[int] = mapped_column(ForeignKey("person.id"), primary_key=True)


class NotificationModel(Base):
    """One thing that a person is told; ``address`` leads to it, ``read`` is when they have seen it."""

    __tablename__ = "bell"
    __table_args__ = (Index("bell_person", "person_id", "id"), Index("bell_dataset", "dataset_id"))

    id: Mapped[int] = mapped_column(primary_key=True)
    person_id: Mapped[int] = mapped_column(ForeignKey("person.id"))
    at: Mapped[str]
    kind: Mapped[str]
    actor: Mapped[str]
    sentence: Mapped[str]
    address: Mapped[str]
    dataset_id: Mapped[int | None] = mapped_column(ForeignKey("dataset.id"))
    group_id: Mapped[int | None] = mapped_column(ForeignKey("groups.id"))
    read: Mapped[str | None]
