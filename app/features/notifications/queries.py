"""Bells in the database: what each person was told, the newest first."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from enum import StrEnum
from typing import Any

from sqlalchemy import ColumnElement, delete, func, insert, literal, select, update

from app.db.session import Session
from app.features.comments.queries import NotificationModel
from app.features.datasets.tables import DatasetModel
from app.features.groups.insert_queries import find_next_row_id
from app.features.people.visibility_queries import (
    Visibility,
    visible_groups_across_datasets_condition,
)
from app.json_text import Moment


class NotificationKind(StrEnum):
    """Why somebody is told."""

    MENTION = "mention"
    REPLY = "reply"
    JOB = "job"
    ASSIGNED = "assigned"
    RETURNED = "returned"


@dataclass(frozen=True)
class Notification:
    """One thing that a person was told.

    Attributes:
        kind: ``mention``, ``reply``, ``job``, ``assigned`` or ``returned``.
        actor: Who did it.
        address: Of the page that it is about.
        dataset: Name of its dataset; None where it has none.
        read: When they have seen it; None: not yet.
    """

    id: int
    at: Moment
    kind: NotificationKind
    actor: str
    sentence: str
    address: str
    dataset: str | None
    group_id: int | None
    read: Moment | None


def insert_notification(session: Session, person_id: int, values: dict[str, Any]) -> int:
    """Tell a person of something; returns its id."""
    identity = find_next_row_id(session, NotificationModel)
    session.execute(insert(NotificationModel), {"id": identity, "person_id": person_id, **values})
    return identity


def delete_notifications(session: Session, person_id: int, before: str) -> None:
    """Forget what a person was told before a time."""
    mine = NotificationModel.person_id == person_id
    session.execute(delete(NotificationModel).where(mine, NotificationModel.at < before))


def select_notifications(
    session: Session,
    person_id: int,
    visibility: Visibility,
    since: str,
    limit: int,
    before: int | None = None,
) -> list[Notification]:
    """What a person was told since a time of what they see now, the newest first."""
    columns = [
        getattr(NotificationModel, name)
        for name in Notification.__dataclass_fields__
        if name != "dataset"
    ]
    statement = (
        select(*columns, DatasetModel.name.label("dataset"))
        .outerjoin(DatasetModel, DatasetModel.id == NotificationModel.dataset_id)
        .where(*_visibility_conditions(person_id, visibility, since))
        .order_by(NotificationModel.id.desc())
        .limit(limit)
    )
    if before is not None:
        statement = statement.where(NotificationModel.id < before)
    rows = session.execute(statement)
    return [Notification(**{**row._mapping, "kind": NotificationKind(row.kind)}) for row in rows]


def count_unread(session: Session, person_id: int, visibility: Visibility, since: str) -> int:
    """How much of it they have not seen yet."""
    unread = (
        *_visibility_conditions(person_id, visibility, since),
        NotificationModel.read.is_(None),
    )
    return session.scalar(select(func.count()).select_from(NotificationModel).where(*unread)) or 0


def mark_read(
    session: Session, person_id: int, visibility: Visibility, ids: Sequence[int] | None, at: str
) -> None:
    """They have seen some of it, or (None) all that they see now."""
    where = [*_visibility_conditions(person_id, visibility, ""), NotificationModel.read.is_(None)]
    if ids is not None:
        where.append(NotificationModel.id.in_(ids))
    session.execute(update(NotificationModel).where(*where).values(read=at))


def _visibility_conditions(
    person_id: int, visibility: Visibility, since: str
) -> list[ColumnElement[bool]]:
    where = [NotificationModel.person_id == person_id, NotificationModel.at >= since]
    # What is of no dataset was told to them, and is theirs.
    seen = visibility.condition(NotificationModel.dataset_id, literal(visibility.name))
    where += visible_groups_across_datasets_condition(
        NotificationModel.dataset_id, NotificationModel.group_id
    )
    return where if seen is None else [*where, seen]
