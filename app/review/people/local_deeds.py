"""Local deeds: what was done before there were accounts is shown as a person's; once.

The log does not change: its entries keep the name that they were written under.
"""

from __future__ import annotations

from app.errors import ConflictError, NotFoundError
from app.review.people.names import PERSON, require_no_token
from app.soccer.actors import LOCAL_USER
from app.store.aliases import find_alias, insert_alias
from app.store.clock import now
from app.store.log import Entry, append
from app.store.people import person_by_id
from app.store.store import Store


def adopted_by(store: Store) -> str | None:
    """As whose the work of the single user is shown; None where it was given to nobody."""
    with store.read() as session:
        return find_alias(session, LOCAL_USER)


def adopt(store: Store, person_id: int, *, actor: str) -> str:
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
