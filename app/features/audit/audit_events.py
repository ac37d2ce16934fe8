"""Audit events: what people do that changes no group.

What was done before there were accounts is shown as a person's, once.
"""

from __future__ import annotations

from app.db.log import Entry, append
from app.db.session import Session, now
from app.db.store import Store
from app.errors import ConflictError, NotFoundError
from app.features.people.queries import person_by_id
from app.features.people.roles import PERSON, require_no_token
from app.features.people.visibility_queries import find_alias, insert_alias
from app.soccer.actors import LOCAL_USER

DEED = "deed"
"""Kind of the log's entries about what was made, changed or deleted beside the groups."""
JOB = "job"
"""Kind of the log's entries about jobs that somebody asked for."""


def add_audit_event(
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


def record_audit_event(
    store: Store, actor: str, did: str, dataset_id: int | None, **what: str | int | None
) -> None:
    """The same where what happens is in no transaction: a file that goes. Answers the request."""
    with store.write() as session:
        add_audit_event(session, actor, did, dataset_id, **what)
        session.respond(None)


def find_owner_of_local_work(store: Store) -> str | None:
    """As whose the work of the single user is shown; None where it was given to nobody."""
    with store.read() as session:
        return find_alias(session, LOCAL_USER)


def assign_local_work(store: Store, person_id: int, *, actor: str) -> str:
    """Show what was done until now without an account as a person's; returns their name.

    Raises:
        NotFoundError: There is nobody of that id.
        ConflictError: It was given to somebody before.
        ForbiddenError: A token asks.
    """
    require_no_token(actor)
    with store.write() as session:
        person = person_by_id(session, person_id)
        if person is None:
            raise NotFoundError.person(person_id)
        before = find_alias(session, LOCAL_USER)
        if before is not None:
            raise ConflictError(
                f"what was done as {LOCAL_USER} is shown as {before}'s already",
                hint="It can be given to one person, and only once.",
            )
        at = now()
        body = {"person": person.name, "did": "adopted", "role": person.role, "from": LOCAL_USER}
        append(session, [Entry(PERSON, actor, at, body)])
        insert_alias(session, LOCAL_USER, person_id, person.name, at, actor)
        return str(person.name)
