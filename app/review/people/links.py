"""Links that are good once: an invitation, a new password, the first admin of a server."""

from __future__ import annotations

from dataclasses import dataclass
from datetime import UTC, datetime, timedelta
from typing import Any

from app.errors import ConflictError, NotFoundError
from app.review.people.names import checked_name, note
from app.review.people.passwords import hash_password
from app.review.people.roles import Role
from app.review.people.tokens import hash_of, new_token
from app.store.clock import now, text_of
from app.store.identities import identity_of
from app.store.logins import delete_logins
from app.store.people import (
    count_able,
    find_link,
    forget_links,
    insert_link,
    insert_person,
    person_by_id,
    person_by_name,
    update_person,
)
from app.store.session import Session
from app.store.store import Store

LASTS = timedelta(days=3)
FIRST_LASTS = timedelta(hours=24)
GONE = "this link is not good any more: it was used, replaced, or is too old"
ASK = "Ask an admin of this server for a new one."


@dataclass(frozen=True)
class Link:
    """A link, which is shown to whoever asked for it, once: the database has its hash alone."""

    token: str
    expires: str

    def address(self, base: str) -> str:
        """Where it leads. The token is a fragment, which browsers send to no server and no log."""
        return f"{base.rstrip('/')}/join#{self.token}"


@dataclass(frozen=True)
class Meant:
    """Whom a link is for; ``name`` is None for the first admin, who chooses one."""

    name: str | None
    joined: bool


def make_first_link(store: Store, *, actor: str) -> Link | None:
    """A link that makes the first admin; None where there is one who can log in."""
    with store.write() as session:
        if count_able(session, Role.ADMIN):
            return None
        return insert_new(session, None, by=actor, at=datetime.now(UTC), lasts=FIRST_LASTS)


def insert_new(
    session: Session, person_id: int | None, *, by: str, at: datetime, lasts: timedelta = LASTS
) -> Link:
    """Make a link for a person (None: for the first admin), in the caller's transaction."""
    token, expires = new_token(), text_of(at + lasts)
    insert_link(session, hash_of(token), person_id, by=by, expires=expires)
    return Link(token, expires)


def look(store: Store, token: str) -> Meant:
    """Whom a link is for; it stays good.

    Raises:
        NotFoundError: It is not good.
    """
    with store.read() as session:
        return _meant(session, token)[1]


def use(store: Store, token: str, password: str, name: str | None = None) -> str:
    """Set the password that somebody has chosen; the link, and all their sessions, end with it.

    Returns:
        The name of the person.

    Raises:
        NotFoundError: It is not good.
        InputError: The password, or the name of the first admin, cannot be one.
        ConflictError: The name is taken.
    """
    meant = look(store, token)
    chosen = meant.name or checked_name(name or "")
    # Some tenths of a second: not while the database waits.
    hashed = hash_password(password, chosen)
    with store.write() as session:
        person_id = take(session, token, chosen, password=hashed)
        person = person_by_id(session, person_id)
        assert person is not None
        note(session, person.name, person.name, "password", person.role)
        return str(person.name)


def take(session: Session, token: str, name: str | None, *, password: str | None) -> int:
    """Whose a link is, which is then no longer valid; their sessions end, and they have that password.

    Raises:
        NotFoundError: It is not good.
        InputError: The name of the first admin cannot be one.
        ConflictError: It is taken.
    """
    person_id, _ = _meant(session, token)
    if person_id is None:
        person_id = _make_admin(session, checked_name(name or ""))
        forget_links(session, None)
    update_person(session, person_id, password=password)
    delete_logins(session, person_id)
    forget_links(session, person_id)
    return person_id


def _meant(session: Session, token: str) -> tuple[int | None, Meant]:
    """Id of the person of a good link (None: the first admin), and who it is."""
    row = find_link(session, hash_of(token), now())
    if row is None:
        raise NotFoundError(GONE, hint=ASK)
    if row.person_id is None:
        if count_able(session, Role.ADMIN):
            raise NotFoundError(GONE, hint=ASK)
        return None, Meant(None, False)
    person = person_by_id(session, row.person_id)
    if person is None or person.disabled:
        raise NotFoundError(GONE, hint=ASK)
    return row.person_id, Meant(person.name, has_joined(session, person))


def has_joined(session: Session, person: Any) -> bool:
    """Whether somebody has a way in: a password, or an account at the provider of single sign-on."""
    return person.password is not None or identity_of(session, person.id) is not None


def _make_admin(session: Session, name: str) -> int:
    if person_by_name(session, name) is not None:
        raise ConflictError(f"there is a {name} already", hint="Choose another name.")
    note(session, name, name, "first admin", Role.ADMIN)
    return insert_person(session, name, Role.ADMIN, by=name)
