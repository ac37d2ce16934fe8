"""Names of people, and what the log says of their accounts."""

from __future__ import annotations

import re

from app.errors import ForbiddenError, InputError
from app.finite import quoted
from app.soccer.actors import LOCAL_USER, person_of
from app.store.clock import now
from app.store.log import Entry, append
from app.store.session import Session

PERSON = "person"
"""Kind of the log's entries about accounts."""
_NAME = re.compile(r"[a-z0-9](?:[a-z0-9._-]{0,38}[a-z0-9])?")
_TAKEN = frozenset({LOCAL_USER, "script", "everybody", "nobody"})


def checked_name(said: str) -> str:
    """The name of a person, as the log will remember them.

    Raises:
        InputError: It cannot be one.
    """
    name = said.strip().lower()
    if not _NAME.fullmatch(name) or name in _TAKEN:
        raise InputError(
            f"{quoted(name)} cannot be the name of a person",
            hint="Use up to 40 small letters, digits and . _ -, with a letter or digit at both ends;"
            f" {', '.join(sorted(_TAKEN))} mean something else here.",
            pointer="/name",
        )
    return name


def require_no_token(actor: str) -> None:
    """Raise ForbiddenError where a token asks: who may come in, and as what, is decided by people."""
    if person_of(actor) != actor:
        raise ForbiddenError(
            "no token makes people or changes their rights",
            hint="An admin does it in the browser, or touchline users on the machine.",
        )


def note(
    session: Session, actor: str, name: str, did: str, role: str, **more: str | int | None
) -> None:
    """Write what became of an account into the log."""
    body = {"person": name, "did": did, "role": str(role), **more}
    dataset = more.get("dataset_id")
    where = dataset if isinstance(dataset, int) else None
    append(session, [Entry(PERSON, actor, now(), body, where)])
