"""Deeds: what people do that changes no group and leaves no word of its own, for the audit."""

from __future__ import annotations

from app.store.clock import now
from app.store.log import Entry, append
from app.store.session import Session
from app.store.store import Store

DEED = "deed"
"""Kind of the log's entries about what was made, changed or deleted beside the groups."""
JOB = "job"
"""Kind of the log's entries about jobs that somebody asked for."""


def note_deed(
    session: Session, actor: str, did: str, dataset_id: int | None, **what: str | int | None
) -> None:
    """Write into the log who did something, in the transaction in which it happens.

    Args:
        session: A write session.
        actor: Who.
        did: What, in words: ``webhook deleted``.
        dataset_id: Of which dataset; None: of none.
        what: What tells it from others of its kind; nothing secret.
    """
    append(session, [Entry(DEED, actor, now(), {"did": did, **what}, dataset_id)])


def note_job(
    session: Session, actor: str, job: int, kind: str, title: str, dataset_id: int | None
) -> None:
    """Write into the log who asked for a job."""
    body = {"job": job, "kind": kind, "title": title}
    append(session, [Entry(JOB, actor, now(), body, dataset_id)])


def record_deed(
    store: Store, actor: str, did: str, dataset_id: int | None, **what: str | int | None
) -> None:
    """The same where what happens is in no transaction: a file that goes. Answers the request."""
    with store.write() as session:
        note_deed(session, actor, did, dataset_id, **what)
        session.respond(None)
