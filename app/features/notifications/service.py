"""Bell: what people are told, each for themselves, and never about what they may not see."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from datetime import UTC, datetime, timedelta

from app.db.session import Session, format_utc_time, now
from app.db.store import Store
from app.features.notifications.queries import (
    Notification,
    NotificationKind,
    count_unread,
    delete_notifications,
    insert_notification,
    mark_read,
    select_notifications,
)
from app.features.people.logins import Login, read_roles
from app.features.people.queries import find_person_by_name
from app.features.people.roles import Role
from app.soccer.actors import person_of_actor

KEPT_DAYS = 90
"""So long somebody can read what they were told."""


@dataclass(frozen=True)
class NotificationPage:
    """What a person was told, the newest first, and how much of all of it they have not seen."""

    items: list[Notification]
    unread: int


def notify_person(
    session: Session,
    person: str,
    kind: NotificationKind,
    sentence: str,
    *,
    actor: str,
    address: str,
    dataset_id: int | None = None,
    group_id: int | None = None,
) -> bool:
    """Tell somebody of something, in the transaction in which it happens.

    Nobody is told of what they did themselves, and of what they do not see.

    Args:
        session: A write session.
        person: Their name.
        kind: Why they are told.
        sentence: What, for them.
        actor: Who did it.
        address: Of the page that it is about.
        dataset_id: The dataset that it is about; None: none.
        group_id: The group.

    Returns:
        Whether they were told.
    """
    if kind is not NotificationKind.JOB and person_of_actor(actor) == person:
        return False
    row = find_person_by_name(session, person)
    if row is None or row.disabled:
        return False
    roles = read_roles(session, row.id, Role(row.role))
    if dataset_id is not None and roles.find_role_in(dataset_id) is Role.NONE:
        return False
    at = now()
    delete_notifications(session, row.id, _oldest_shown_time())
    what = {"at": at, "kind": str(kind), "actor": actor, "sentence": sentence}
    where = {"address": address, "dataset_id": dataset_id, "group_id": group_id}
    insert_notification(session, row.id, {**what, **where})
    return True


def read_notifications(
    store: Store, login: Login, limit: int = 50, before: int | None = None
) -> NotificationPage:
    """What somebody was told in the last 90 days, of what they see at this moment."""
    with store.read() as session:
        return _read_notification_page(session, login, limit, before)


def mark_as_read(store: Store, login: Login, ids: Sequence[int] | None = None) -> NotificationPage:
    """They have seen some of what they were told, or (None) all of it."""
    with store.write() as session:
        mark_read(session, login.person_id, login.visibility, ids, now())
        bell = _read_notification_page(session, login)
        session.respond(bell)
        return bell


def _read_notification_page(
    session: Session, login: Login, limit: int = 50, before: int | None = None
) -> NotificationPage:
    mine = (login.person_id, login.visibility, _oldest_shown_time())
    return NotificationPage(
        select_notifications(session, *mine, limit, before), count_unread(session, *mine)
    )


def _oldest_shown_time() -> str:
    return format_utc_time(datetime.now(UTC) - timedelta(days=KEPT_DAYS))
