"""Webhook outbox: messages to webhooks that are written down in the transaction of what they tell of."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from sqlalchemy import select

from app.canonical import canonical
from app.store.datasets import dataset_name
from app.store.session import Session
from app.store.stored_json import Json, parse
from app.store.tables.webhooks import WebhookModel
from app.store.webhooks import insert_delivery
from app.store.work import batch_of, count_work, people_of

GIVEN_OUT = "batch.given_out"
HANDED_ON = "batch.handed_on"
DONE = "batch.done"
STALLED = "batch.stalled"
DISPUTED = "group.disputed"
HANDED_BACK = "group.handed_back"


def listeners(session: Session, dataset_id: int, kind: str) -> list[int]:
    """Ids of the webhooks of a dataset that are told of a kind."""
    table = WebhookModel
    on = (table.dataset_id == dataset_id, table.off.is_(None))
    rows = session.execute(select(table.id, table.kinds).where(*on).order_by(table.id))
    return [row.id for row in rows if kind in parse(row.kinds)]


def announce(
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
    hooks = listeners(session, dataset_id, kind)
    if not hooks:
        return 0
    told: dict[str, Json] = {"dataset": dataset_name(session, dataset_id), "actor": actor}
    if batch_id is not None:
        told["batch"] = batch_told(session, batch_id)
    body = canonical({"type": kind, "timestamp": at, "data": {**told, **(also or {})}})
    return sum(insert_delivery(session, hook, f"msg_{hook}_{event}", kind, body) for hook in hooks)


def announce_batch(session: Session, batch_id: int, kind: str, *, actor: str, at: str) -> int:
    """``announce`` what became of a batch at a time; nothing where it is gone."""
    row = batch_of(session, batch_id)
    if row is None:
        return 0
    event = f"batch{batch_id}_{kind.partition('.')[2]}{stamp(at)}"
    return announce(session, row.dataset_id, kind, event, actor=actor, at=at, batch_id=batch_id)


def batch_told(session: Session, batch_id: int) -> dict[str, Any] | None:
    """What a message says of a batch; None where it is gone."""
    row = batch_of(session, batch_id)
    if row is None:
        return None
    count = count_work(session, [batch_id]).get(batch_id)
    people = [(one.part, one.name) for one in people_of(session, [batch_id])]
    return {
        "id": row.id,
        "name": row.name,
        "due": row.due,
        "verdicts": row.verdicts,
        "blind": bool(row.blind),
        "annotators": [name for part, name in people if part == "annotator"],
        "reviewers": [name for part, name in people if part == "reviewer"],
        "groups": count.groups if count else 0,
        "handed_in": count.handed_in if count else 0,
        "settled": count.settled if count else 0,
    }


def stamp(at: str) -> str:
    """A time as a part of a message's id."""
    return "".join(letter for letter in at if letter.isdigit())
