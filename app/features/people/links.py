"""Links that are good once, the tokens in them, and passwords."""

from __future__ import annotations

import hashlib
import secrets
from collections.abc import Callable
from dataclasses import dataclass
from datetime import UTC, datetime, timedelta
from functools import cache
from threading import BoundedSemaphore
from typing import Any, TypeVar

from pwdlib import PasswordHash
from pwdlib.hashers.argon2 import Argon2Hasher

from app.db.session import Session, format_utc_time, now
from app.db.store import Store
from app.errors import ConflictError, InputError, NotFoundError, OverloadedError
from app.features.people.login_queries import delete_logins, find_person_identity
from app.features.people.queries import (
    count_people_who_can_log_in,
    delete_person_links,
    find_link,
    find_person_by_id,
    find_person_by_name,
    insert_link,
    insert_person,
    update_person,
)
from app.features.people.roles import Role, log_account_event, normalize_user_name

BYTES = 32


def make_random_token() -> str:
    """A token that nobody guesses."""
    return secrets.token_urlsafe(BYTES)


def hash_token(token: str) -> str:
    """What is kept of a token. It is random and long, so a plain hash suffices."""
    return hashlib.sha256(token.encode("utf-8", "replace")).hexdigest()


SHORTEST, LONGEST = 10, 200
"""Letters of a password. Length is what makes it hard to guess; no kinds of letters are asked for."""
MOST_GUESSED = 40
"""Letters that are looked at. Longer texts of signs that stand for letters keep the library busy for seconds."""
T = TypeVar("T")

HASHER = PasswordHash((Argon2Hasher(),))
AT_A_TIME = 2
"""Hashes at a time: each takes 64 MB of memory, and some tenths of a second."""
PATIENCE = 10.0
"""Seconds that one waits for its turn."""
_turns = BoundedSemaphore(AT_A_TIME)


def hash_password(password: str, name: str, *, pointer: str = "/password") -> str:
    """The argon2 hash of a new password.

    Raises:
        InputError: It is too short, too long, the name itself, or easy to guess.
    """
    if not SHORTEST <= len(password) <= LONGEST:
        raise InputError(
            f"a password must have {SHORTEST} to {LONGEST} characters",
            hint="Three or four unrelated words are easy to remember.",
            pointer=pointer,
        )
    if password.casefold() == name.casefold():
        raise InputError("a password must differ from the name", pointer=pointer)
    if _run_hash_with_limit(lambda: _is_easy_to_guess(password, name)):
        raise InputError(
            "this password is easy to guess: it is common, or repeats a few parts",
            hint="Three or four unrelated words are easy to remember.",
            pointer=pointer,
        )
    return _run_hash_with_limit(lambda: HASHER.hash(password))


def _is_easy_to_guess(password: str, name: str) -> bool:
    """Whether a million guesses find a password, by lists of common passwords, words and patterns."""
    # Its lists take some tenths of a second to load, and few requests need them.
    from zxcvbn import zxcvbn

    found = zxcvbn(password[:MOST_GUESSED], user_inputs=[name, "touchline"])
    return bool(found["score"] < 2)


def verify_password(password: str, known: str | None) -> bool:
    """Whether a password belongs to a hash; without one it takes as long, and is not."""
    fits = _run_hash_with_limit(
        lambda: HASHER.verify(password[:LONGEST], known or _make_placeholder_hash())
    )
    return fits and known is not None and len(password) <= LONGEST


@cache
def _make_placeholder_hash() -> str:
    """A hash that no password is known of, which is asked where there is no account."""
    return HASHER.hash("a placeholder password, as long as others")


def _run_hash_with_limit(work: Callable[[], T]) -> T:
    if not _turns.acquire(timeout=PATIENCE):
        raise OverloadedError(
            "too many people are logging in at this moment", hint="Try again in a while."
        )
    try:
        return work()
    finally:
        _turns.release()


LASTS = timedelta(days=3)
FIRST_LASTS = timedelta(hours=24)
GONE = "this link is no longer valid: it was used, replaced, or has expired"
ASK = "Ask an admin of this server for a new one."


@dataclass(frozen=True)
class PasswordLink:
    """A link, which is shown to whoever asked for it, once: the database has its hash alone."""

    token: str
    expires: str

    def address(self, base: str) -> str:
        """Where it leads. The token is a fragment, which browsers send to no server and no log."""
        return f"{base.rstrip('/')}/join#{self.token}"


@dataclass(frozen=True)
class LinkHolder:
    """The person a link is for; ``name`` is None for the first admin, who chooses one.

    Attributes:
        name: None: for the first admin, who chooses one.
        joined: They have a password already; the link gives another one.
    """

    name: str | None
    joined: bool


def make_first_admin_link(store: Store, *, actor: str) -> PasswordLink | None:
    """A link that makes the first admin; None where there is one who can log in."""
    with store.write() as session:
        if count_people_who_can_log_in(session, Role.ADMIN):
            return None
        return insert_password_link(
            session, None, by=actor, at=datetime.now(UTC), lasts=FIRST_LASTS
        )


def insert_password_link(
    session: Session, person_id: int | None, *, by: str, at: datetime, lasts: timedelta = LASTS
) -> PasswordLink:
    """Make a link for a person (None: for the first admin), in the caller's transaction."""
    token, expires = make_random_token(), format_utc_time(at + lasts)
    insert_link(session, hash_token(token), person_id, by=by, expires=expires)
    return PasswordLink(token, expires)


def find_link_holder(store: Store, token: str) -> LinkHolder:
    """The person a link is for; the link stays valid.

    Raises:
        NotFoundError: It is not good.
    """
    with store.read() as session:
        return _find_holder(session, token)[1]


def set_password_by_link(store: Store, token: str, password: str, name: str | None = None) -> str:
    """Set the password that somebody has chosen; the link, and all their sessions, end with it.

    Returns:
        The name of the person.

    Raises:
        NotFoundError: It is not good.
        InputError: The password, or the name of the first admin, cannot be one.
        ConflictError: The name is taken.
    """
    meant = find_link_holder(store, token)
    chosen = meant.name or normalize_user_name(name or "")
    # Some tenths of a second: not while the database waits.
    hashed = hash_password(password, chosen)
    with store.write() as session:
        person_id = consume_link(session, token, chosen, password=hashed)
        person = find_person_by_id(session, person_id)
        assert person is not None
        log_account_event(session, person.name, person.name, "password", person.role)
        return str(person.name)


def consume_link(session: Session, token: str, name: str | None, *, password: str | None) -> int:
    """Whose a link is, which is then no longer valid; their sessions end, and they have that password.

    Raises:
        NotFoundError: It is not good.
        InputError: The name of the first admin cannot be one.
        ConflictError: It is taken.
    """
    person_id, _ = _find_holder(session, token)
    if person_id is None:
        person_id = _insert_first_admin(session, normalize_user_name(name or ""))
        delete_person_links(session, None)
    update_person(session, person_id, password=password)
    delete_logins(session, person_id)
    delete_person_links(session, person_id)
    return person_id


def _find_holder(session: Session, token: str) -> tuple[int | None, LinkHolder]:
    """Id of the person of a good link (None: the first admin), and who it is."""
    row = find_link(session, hash_token(token), now())
    if row is None:
        raise NotFoundError(GONE, hint=ASK)
    if row.person_id is None:
        if count_people_who_can_log_in(session, Role.ADMIN):
            raise NotFoundError(GONE, hint=ASK)
        return None, LinkHolder(None, False)
    person = find_person_by_id(session, row.person_id)
    if person is None or person.disabled:
        raise NotFoundError(GONE, hint=ASK)
    return row.person_id, LinkHolder(person.name, has_login_method(session, person))


def has_login_method(session: Session, person: Any) -> bool:
    """Whether somebody has a way in: a password, or an account at the provider of single sign-on."""
    return person.password is not None or find_person_identity(session, person.id) is not None


def _insert_first_admin(session: Session, name: str) -> int:
    if find_person_by_name(session, name) is not None:
        raise ConflictError(f"there is already a user {name}", hint="Choose another name.")
    log_account_event(session, name, name, "first admin", Role.ADMIN)
    return insert_person(session, name, Role.ADMIN, by=name)
