"""Webhooks in the database: who is told, and what waits to be sent.

A message is written in the transaction that it tells of.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from typing import Any, NamedTuple, cast

from sqlalchemy import ColumnElement, delete, func, select, tuple_, update

from app.db.dialects.dialect import insert
from app.db.json_columns import Json, parse_json_column
from app.db.log import AUDIT_KINDS, LogModel
from app.db.session import Session, now
from app.features.batches.queries import count_work, find_batch, list_batch_people
from app.features.datasets.queries import read_dataset_name
from app.features.groups.insert_queries import find_next_row_id, reserve_row_ids
from app.features.jobs.queries import JobModel
from app.features.webhooks.tables import DeliveryModel, WebhookModel
from app.json_text import canonical_json_text

WAITING, DELIVERED, FAILED = "waiting", "delivered", "failed"
"""States of a delivery."""
_DISTINCT_KINDS = ("work",)
"""Kinds of entries of which ``app.features.webhooks.queries`` tells."""


class DueDelivery(NamedTuple):
    """A message whose time has come, with the address and the secret of its webhook."""

    id: int
    webhook_id: int
    message: str
    kind: str
    body: str
    created: str
    state: str
    attempts: int
    next_at: str | None
    tried: str | None
    status: int | None
    problem: str | None
    url: str
    salt: str
    turn: int


_WEBHOOKS = select(*WebhookModel.__table__.columns)
_DELIVERIES = select(*DeliveryModel.__table__.columns)


def read_webhooks(session: Session, dataset_id: int) -> Sequence[WebhookModel]:
    """Every webhook of a dataset, in the order in which they were made."""
    mine = WebhookModel.dataset_id == dataset_id
    return session.rows(WebhookModel, _WEBHOOKS.where(mine).order_by(WebhookModel.id))


def find_webhook(session: Session, dataset_id: int, webhook_id: int) -> WebhookModel | None:
    """A webhook of a dataset."""
    where = (WebhookModel.id == webhook_id, WebhookModel.dataset_id == dataset_id)
    return session.row(WebhookModel, _WEBHOOKS.where(*where))


def list_active_webhooks(session: Session) -> Sequence[WebhookModel]:
    """Every webhook that is told."""
    return session.rows(WebhookModel, _WEBHOOKS.where(WebhookModel.off.is_(None)))


def insert_webhook(
    session: Session, dataset_id: int, url: str, kinds: Iterable[str], *, salt: str, by: str
) -> int:
    """Insert a webhook, which is told what happens from now on; returns its id."""
    at, identity = now(), find_next_row_id(session, WebhookModel)
    values = {
        "id": identity,
        "dataset_id": dataset_id,
        "url": url,
        "kinds": canonical_json_text(sorted(kinds)),
        "salt": salt,
        "created": at,
        "created_by": by,
        "log_id": session.scalar(select(func.max(LogModel.id))) or 0,
        "jobs_until": at,
        "job_id": 0,
    }
    session.execute(insert(WebhookModel).values(values))
    return identity


def update_webhook(session: Session, webhook_id: int, values: dict[str, Any]) -> None:
    """Change columns of a webhook."""
    session.execute(update(WebhookModel).where(WebhookModel.id == webhook_id).values(values))


def delete_webhook(session: Session, webhook_id: int) -> None:
    """Delete a webhook with all that it was told."""
    reserve_row_ids(session, WebhookModel)
    session.execute(delete(WebhookModel).where(WebhookModel.id == webhook_id))


class LoggedEvent(NamedTuple):
    """An entry of a dataset's log that webhooks may be told of."""

    id: int
    kind: str
    actor: str
    at: str
    group_id: int | None


def list_log_entries_since(
    session: Session, dataset_id: int, log_id: int, most: int
) -> Sequence[LoggedEvent]:
    """Entries of a dataset's log after one of them, in order."""
    columns = (LogModel.id, LogModel.kind, LogModel.actor, LogModel.at, LogModel.group_id)
    where = (
        LogModel.id > log_id,
        LogModel.dataset_id == dataset_id,
        LogModel.kind.not_in((*AUDIT_KINDS, *_DISTINCT_KINDS)),
    )
    return session.rows(
        LoggedEvent, select(*columns).where(*where).order_by(LogModel.id).limit(most)
    )


class EndedJob(NamedTuple):
    """A job of a dataset that ended."""

    id: int
    kind: str
    title: str
    state: str
    actor: str
    ended: str


def list_jobs_ended_since(
    session: Session, dataset_id: int, ended: str, job_id: int, states: Iterable[str]
) -> Sequence[EndedJob]:
    """Jobs of a dataset that ended after another one."""
    columns = (
        JobModel.id,
        JobModel.kind,
        JobModel.title,
        JobModel.state,
        JobModel.actor,
        JobModel.ended,
    )
    later = tuple_(JobModel.ended, JobModel.id) > tuple_(ended, job_id)
    where = (JobModel.dataset_id == dataset_id, later, JobModel.state.in_(states))
    order = (JobModel.ended, JobModel.id)
    return session.rows(EndedJob, select(*columns).where(*where).order_by(*order))


def insert_delivery(session: Session, webhook_id: int, message: str, kind: str, body: str) -> bool:
    """Insert a message that is to be sent at once; False where the webhook has it already."""
    at = now()
    values = {
        "webhook_id": webhook_id,
        "message": message,
        "kind": kind,
        "body": body,
        "created": at,
        "state": WAITING,
        "attempts": 0,
        "next_at": at,
    }
    statement = insert(DeliveryModel).values(values).on_conflict_do_nothing()
    done = session.execute(statement)
    return bool(cast(Any, done).rowcount)


def list_due_deliveries(
    session: Session, at: str, most: int, most_each: int
) -> Sequence[DueDelivery]:
    """Deliveries whose time has come, with ``url`` and ``salt`` of their webhooks; oldest first.

    Args:
        at: The time.
        most: So many at most.
        most_each: So many of one webhook.
    """
    turn = func.row_number().over(
        partition_by=DeliveryModel.webhook_id, order_by=(DeliveryModel.next_at, DeliveryModel.id)
    )
    due = (
        _DELIVERIES.add_columns(WebhookModel.url, WebhookModel.salt, turn.label("turn"))
        .join(WebhookModel, WebhookModel.id == DeliveryModel.webhook_id)
        .where(DeliveryModel.next_at <= at, WebhookModel.off.is_(None))
        .subquery()
    )
    order = (due.c.turn, due.c.next_at, due.c.id)
    statement = select(due).where(due.c.turn <= most_each).order_by(*order).limit(most)
    return session.rows(DueDelivery, statement)


def find_next_delivery_time(session: Session) -> str | None:
    """When the next delivery is to be tried; None: none waits."""
    return session.scalar(
        select(func.min(DeliveryModel.next_at))
        .join(WebhookModel, WebhookModel.id == DeliveryModel.webhook_id)
        .where(WebhookModel.off.is_(None))
    )


def read_deliveries(
    session: Session, webhook_id: int, before: int | None, most: int
) -> Sequence[DeliveryModel]:
    """The deliveries of a webhook, newest first, from below an id."""
    where = [DeliveryModel.webhook_id == webhook_id]
    if before is not None:
        where.append(DeliveryModel.id < before)
    statement = _DELIVERIES.where(*where).order_by(DeliveryModel.id.desc()).limit(most)
    return session.rows(DeliveryModel, statement)


def find_delivery(session: Session, webhook_id: int, delivery_id: int) -> DeliveryModel | None:
    """A delivery of a webhook."""
    where = (DeliveryModel.id == delivery_id, DeliveryModel.webhook_id == webhook_id)
    return session.row(DeliveryModel, _DELIVERIES.where(*where))


def find_waiting_delivery(session: Session, webhook_id: int, kind: str) -> DeliveryModel | None:
    """A delivery of that kind that is still to be sent."""
    where = (
        DeliveryModel.webhook_id == webhook_id,
        DeliveryModel.kind == kind,
        DeliveryModel.next_at.is_not(None),
    )
    return session.row(DeliveryModel, _DELIVERIES.where(*where).limit(1))


def update_delivery(session: Session, delivery_id: int, values: dict[str, Any]) -> None:
    """Change columns of a delivery."""
    session.execute(update(DeliveryModel).where(DeliveryModel.id == delivery_id).values(values))


def count_deliveries(session: Session, webhook_ids: Sequence[int]) -> dict[tuple[int, str], int]:
    """How many deliveries of some webhooks are in each state."""
    key = (DeliveryModel.webhook_id, DeliveryModel.state)
    statement = select(*key, func.count()).where(DeliveryModel.webhook_id.in_(webhook_ids))
    return {(row[0], row[1]): row[2] for row in session.execute(statement.group_by(*key))}


def has_delivered_since(session: Session, webhook_id: int, at: str) -> bool:
    """Whether a webhook took anything since a time."""
    statement = select(DeliveryModel.id).where(
        DeliveryModel.webhook_id == webhook_id,
        DeliveryModel.state == DELIVERED,
        DeliveryModel.tried >= at,
    )
    return session.scalar(statement.limit(1)) is not None


def has_finished_deliveries(session: Session, before: str) -> bool:
    """Whether anything arrived or was given up before a time."""
    return (
        session.scalar(select(DeliveryModel.id).where(*_make_finished_conditions(before)).limit(1))
        is not None
    )


def delete_finished_deliveries(session: Session, before: str) -> int:
    """Delete what arrived or was given up before a time; returns how many."""
    gone = session.execute(delete(DeliveryModel).where(*_make_finished_conditions(before)))
    return int(cast(Any, gone).rowcount)


def _make_finished_conditions(before: str) -> tuple[ColumnElement[bool], ...]:
    return DeliveryModel.next_at.is_(None), DeliveryModel.created < before


GIVEN_OUT = "batch.given_out"
HANDED_ON = "batch.handed_on"
DONE = "batch.done"
STALLED = "batch.stalled"
DISPUTED = "group.disputed"
HANDED_BACK = "group.handed_back"


def list_subscribed_webhooks(session: Session, dataset_id: int, kind: str) -> list[int]:
    """Ids of the webhooks of a dataset that are told of a kind."""
    table = WebhookModel
    on = (table.dataset_id == dataset_id, table.off.is_(None))
    rows = session.execute(select(table.id, table.kinds).where(*on).order_by(table.id))
    return [row.id for row in rows if kind in parse_json_column(row.kinds)]


def queue_webhook_messages(
    session: Session,
    dataset_id: int,
    kind: str,
    event: str,
    *,
    actor: str,
    at: str,
    batch_id: int | None = None,
    also: Mapping[str, Json] | None = None,
) -> int:
    """Write a message down for each webhook that wants to hear of it; returns for how many.

    Args:
        session: The write session of what happened: both are there, or neither.
        dataset_id: In which dataset.
        kind: Of the message.
        event: Names what happened: a webhook is told once of each.
        actor: Who did it.
        at: When.
        batch_id: The batch that it is about, as it is then.
        also: What else is told.
    """
    hooks = list_subscribed_webhooks(session, dataset_id, kind)
    if not hooks:
        return 0
    data: dict[str, Json] = {"dataset": read_dataset_name(session, dataset_id), "actor": actor}
    if batch_id is not None:
        data["batch"] = read_message_values_of_batch(session, batch_id)
    body = canonical_json_text({"type": kind, "timestamp": at, "data": {**data, **(also or {})}})
    return sum(insert_delivery(session, hook, f"msg_{hook}_{event}", kind, body) for hook in hooks)


def queue_messages_about_batch(
    session: Session, batch_id: int, kind: str, *, actor: str, at: str
) -> int:
    """``queue_webhook_messages`` what became of a batch at a time; nothing where it is gone."""
    row = find_batch(session, batch_id)
    if row is None:
        return 0
    event = f"batch{batch_id}_{kind.partition('.')[2]}{make_time_suffix(at)}"
    return queue_webhook_messages(
        session, row.dataset_id, kind, event, actor=actor, at=at, batch_id=batch_id
    )


def read_message_values_of_batch(session: Session, batch_id: int) -> dict[str, Any] | None:
    """The values of a batch for a message; None where it was deleted."""
    row = find_batch(session, batch_id)
    if row is None:
        return None
    count = count_work(session, [batch_id]).get(batch_id)
    people = [(one.part, one.name) for one in list_batch_people(session, [batch_id])]
    return {
        "id": row.id,
        "name": row.name,
        "due": row.due,
        "verdicts": row.verdicts,
        "blind": bool(row.blind),
        "annotators": [name for part, name in people if part == "annotator"],
        "reviewers": [name for part, name in people if part == "reviewer"],
        "groups": count.groups if count else 0,
        "submitted": count.submitted if count else 0,
        "settled": count.settled if count else 0,
    }


def make_time_suffix(at: str) -> str:
    """A time as a part of a message's id."""
    return "".join(letter for letter in at if letter.isdigit())
