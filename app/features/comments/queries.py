"""Threads in the database: comments on groups, whom they mention, and which groups have some."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field

from sqlalchemy import ForeignKey, Index, Select, delete, func, insert, select, update
from sqlalchemy.orm import Mapped, mapped_column

from app.db.session import Base, Session
from app.features.datasets.tables import DatasetModel, GroupModel, ViewModel
from app.features.groups.insert_queries import find_next_row_id, reserve_row_ids
from app.features.people.tables import PersonModel
from app.features.people.visibility_queries import shown_actor_column


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
    """A person whom a comment mentions, and who could see its dataset when it was written."""

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


@dataclass(frozen=True)
class StoredComment:
    """One comment; ``text`` is None once its writer has deleted it."""

    id: int
    actor: str
    at: str
    edited: str | None
    text: str | None
    mentions: tuple[str, ...] = ()


@dataclass(frozen=True)
class StoredThread:
    """A thread with its comments, the oldest first.

    Attributes:
        view: Key of the view that it is about; None: the group.
        x: Where it stands in the view, pixels of the annotated size; None: nowhere. ``y`` likewise.
        resolved: When it was settled; None while it is open.
    """

    id: int
    group_id: int
    view: str | None
    x: float | None
    y: float | None
    created: str
    resolved: str | None
    resolved_by: str | None
    comments: tuple[StoredComment, ...] = ()


@dataclass
class ThreadRecord:
    """A thread as far as the log has it.

    Attributes:
        resolved: When it was settled, and by whom.
        comments: Actor, time, time of the last change, and text, by id.
    """

    dataset_id: int | None
    group_id: int | None
    view: str | None
    x: float | None
    y: float | None
    resolved: tuple[str | None, str | None] = (None, None)
    comments: dict[int, tuple[str, str, str | None, str | None]] = field(default_factory=dict)


@dataclass(frozen=True)
class CommentedGroup:
    """The group that a thread is about, and what people call it."""

    dataset_id: int
    dataset: str
    group_id: int
    label: str
    views: frozenset[str] = field(default_factory=frozenset)


def find_group(session: Session, group_id: int) -> CommentedGroup | None:
    """The group of an id, with the keys of its views; None where there is none."""
    statement = (
        select(GroupModel.dataset_id, DatasetModel.name, GroupModel.label, GroupModel.key)
        .join(DatasetModel, DatasetModel.id == GroupModel.dataset_id)
        .where(GroupModel.id == group_id)
    )
    row = session.execute(statement).one_or_none()
    if row is None:
        return None
    views = session.scalars(select(ViewModel.key).where(ViewModel.group_id == group_id))
    return CommentedGroup(
        row.dataset_id, row.name, group_id, row.label or row.key, frozenset(views)
    )


def read_threads(
    session: Session, group_id: int, thread_id: int | None = None
) -> list[StoredThread]:
    """The threads of a group, or one of them, the oldest first."""
    where = [ThreadModel.group_id == group_id]
    if thread_id is not None:
        where.append(ThreadModel.id == thread_id)
    columns = [item for item in ThreadModel.__table__.columns if item.name != "dataset_id"]
    rows = session.execute(select(*columns).where(*where).order_by(ThreadModel.id)).all()
    comments = _read_comments_by_thread(session, [row.id for row in rows])
    return [StoredThread(**row._mapping, comments=tuple(comments[row.id])) for row in rows]


def read_all_threads(session: Session) -> dict[int, ThreadRecord]:
    """Every thread by its id, under the names that were written."""
    thread, comment = ThreadModel, CommentModel
    found = {}
    for row in session.execute(select(*thread.__table__.columns)):
        settled = (row.resolved, row.resolved_by)
        place = (row.dataset_id, row.group_id, row.view, row.x, row.y)
        found[row.id] = ThreadRecord(*place, resolved=settled)
    for row in session.execute(select(*comment.__table__.columns).order_by(comment.id)):
        # One whose thread is gone is a lost reference, and the thread is missed.
        if row.thread_id in found:
            columns = (row.actor, row.at, row.edited, row.text)
            found[row.thread_id].comments[row.id] = columns
    return found


def _read_comments_by_thread(
    session: Session, threads: Sequence[int]
) -> dict[int, list[StoredComment]]:
    named = (
        select(CommentMentionModel.comment_id, PersonModel.name)
        .join(PersonModel, PersonModel.id == CommentMentionModel.person_id)
        .join(CommentModel, CommentModel.id == CommentMentionModel.comment_id)
        .where(CommentModel.thread_id.in_(threads))
        .order_by(PersonModel.name)
    )
    mentions: dict[int, list[str]] = defaultdict(list)
    for comment, name in session.execute(named):
        mentions[comment].append(name)
    statement = (
        select(
            CommentModel.id,
            CommentModel.thread_id,
            shown_actor_column(CommentModel.actor, CommentModel.at).label("actor"),
            CommentModel.at,
            CommentModel.edited,
            CommentModel.text,
        )
        .where(CommentModel.thread_id.in_(threads))
        .order_by(CommentModel.id)
    )
    found: dict[int, list[StoredComment]] = defaultdict(list)
    for row in session.execute(statement):
        columns = (row.id, row.actor, row.at, row.edited, row.text)
        found[row.thread_id].append(StoredComment(*columns, tuple(mentions[row.id])))
    return found


def insert_thread(
    session: Session,
    group: CommentedGroup,
    view: str | None,
    at: tuple[float, float] | None,
    time: str,
) -> int:
    """Insert an open thread without a comment; returns its id."""
    identity = find_next_row_id(session, ThreadModel)
    x, y = (None, None) if at is None else at
    values = {"id": identity, "dataset_id": group.dataset_id, "group_id": group.group_id}
    session.execute(insert(ThreadModel), {**values, "view": view, "x": x, "y": y, "created": time})
    return identity


def insert_comment(session: Session, thread_id: int, actor: str, text: str, time: str) -> int:
    """Insert a comment; returns its id."""
    identity = find_next_row_id(session, CommentModel)
    values = {"id": identity, "thread_id": thread_id, "actor": actor, "at": time, "text": text}
    session.execute(insert(CommentModel), values)
    return identity


def change_comment(session: Session, comment_id: int, text: str | None, time: str) -> None:
    """Give a comment another text; None: it is deleted, and mentions nobody."""
    session.execute(
        update(CommentModel).where(CommentModel.id == comment_id).values(text=text, edited=time)
    )
    if text is None:
        set_mentions(session, comment_id, ())


def set_mentions(session: Session, comment_id: int, people: Iterable[int]) -> None:
    """The ids of the people whom a comment mentions."""
    session.execute(delete(CommentMentionModel).where(CommentMentionModel.comment_id == comment_id))
    rows = [{"comment_id": comment_id, "person_id": person} for person in people]
    if rows:
        session.execute(insert(CommentMentionModel), rows)


def set_thread_resolved(
    session: Session, thread_id: int, time: str | None, actor: str | None
) -> None:
    """Settle a thread, or open it again (None)."""
    session.execute(
        update(ThreadModel)
        .where(ThreadModel.id == thread_id)
        .values(resolved=time, resolved_by=actor)
    )


def delete_thread(session: Session, thread_id: int) -> None:
    """Delete a thread with its comments."""
    reserve_row_ids(session, ThreadModel, CommentModel)
    session.execute(delete(ThreadModel).where(ThreadModel.id == thread_id))


def count_open_threads(session: Session, group_ids: Sequence[int]) -> dict[int, int]:
    """How many open threads groups have, by group; those without one are left out."""
    statement = (
        select(ThreadModel.group_id, func.count())
        .where(ThreadModel.group_id.in_(group_ids), ThreadModel.resolved.is_(None))
        .group_by(ThreadModel.group_id)
    )
    return {row[0]: row[1] for row in session.execute(statement)}


def select_groups_with_threads(state: str | None = None) -> Select[int]:
    """Ids of the groups that have a thread: an ``open`` one, a ``resolved`` one, or (None) any."""
    statement = select(ThreadModel.group_id)
    if state is None:
        return statement
    is_open = ThreadModel.resolved.is_(None)
    return statement.where(is_open if state == "open" else ~is_open)


def select_groups_with_mentions(name: str | None = None) -> Select[int]:
    """Ids of the groups of which an open thread mentions a person, or (None) anybody."""
    statement = (
        select(ThreadModel.group_id)
        .join(CommentModel, CommentModel.thread_id == ThreadModel.id)
        .join(CommentMentionModel, CommentMentionModel.comment_id == CommentModel.id)
        .where(ThreadModel.resolved.is_(None))
    )
    if name is None:
        return statement
    people = select(PersonModel.id).where(PersonModel.name == name)
    return statement.where(CommentMentionModel.person_id.in_(people))
