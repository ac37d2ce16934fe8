"""Logins: sessions that the server keeps, and that a person can look at and end."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from datetime import UTC, datetime, timedelta

from app.errors import InputError, NotFoundError, NotLoggedInError
from app.review.people.names import note
from app.review.people.passwords import LONGEST, hash_password, is_password
from app.review.people.roles import Role
from app.review.people.tokens import hash_of, new_token
from app.store.logins import (
    delete_ended,
    delete_login,
    delete_logins,
    find_login,
    insert_login,
    logins_of,
    touch_login,
)
from app.store.people import forget_links, person_by_id, person_by_name, update_person
from app.store.session import Store

IDLE = timedelta(hours=12)
"""A session that nobody has used for so long has ended."""
LASTS = timedelta(days=14)
"""And every session after so long."""
NOTED_AFTER = timedelta(minutes=5)
"""When a session was used is written down no more often."""
WRONG = "that name and that password do not belong together"
MOST = 20
"""Sessions of one person; the one that was used longest ago makes room."""


@dataclass(frozen=True)
class Login:
    """Who is logged in, and by which session."""

    id: int
    person_id: int
    name: str
    role: Role
    seen: datetime


@dataclass(frozen=True)
class OpenSession:
    """One session of a person, as they are shown it."""

    id: int
    browser: str
    address: str
    created: str
    seen: str
    expires: str


class Logins:
    """Everything that is asked of sessions.

    Args:
        store: Where they are.
        clock: Says what time it is, in UTC.
    """

    def __init__(self, store: Store, clock: Callable[[], datetime] = lambda: datetime.now(UTC)):
        self._store, self._clock = store, clock

    def log_in(
        self,
        name: str,
        password: str,
        *,
        browser: str = "",
        address: str = "",
        before: str | None = None,
    ) -> str:
        """Begin a session; returns its token. The one that the browser had ``before`` ends.

        A name that nobody has takes as long as a wrong password, and gets the same answer.

        Raises:
            NotLoggedInError: Name and password do not belong together, or the account is disabled.
        """
        name = name.strip().lower()[:LONGEST]
        with self._store.read() as session:
            person = person_by_name(session, name)
        able = person is not None and not person.disabled
        if not is_password(password, person.password if person and able else None):
            raise NotLoggedInError(WRONG, hint="An admin can send you a link for a new password.")
        assert person is not None
        return self._begin(person.id, person.password, browser, address, before)

    def _begin(
        self, person_id: int, password: str, browser: str, address: str, before: str | None
    ) -> str:
        token, at = new_token(), self._clock()
        values = {
            "token_hash": hash_of(token),
            "person_id": person_id,
            "created": _text(at),
            "seen": _text(at),
            "expires": _text(at + LASTS),
            "browser": browser[:200],
            "address": address[:60],
        }
        with self._store.write() as session:
            person = person_by_id(session, person_id)
            # The password may have been changed, or the account disabled, since it was asked for.
            if person is None or person.disabled or person.password != password:
                raise NotLoggedInError(WRONG)
            delete_ended(session, at=_text(at), idle_since=_text(at - IDLE))
            if before and (old := find_login(session, hash_of(before), **self._alive(at))):
                delete_login(session, old.id, old.person_id)
            for spare in logins_of(session, person_id, **self._alive(at))[MOST - 1 :]:
                delete_login(session, spare.id, person_id)
            insert_login(session, values)
        return token

    def find(self, token: str) -> Login | None:
        """Who a token stands for; None where its session has ended."""
        with self._store.read() as session:
            row = find_login(session, hash_of(token), **self._alive(self._clock()))
        if row is None:
            return None
        seen = datetime.fromisoformat(row.seen)
        return Login(row.id, row.person_id, row.name, Role(row.role), seen)

    def is_stale(self, login: Login) -> bool:
        """Whether it should be written down that a session is used."""
        return self._clock() - login.seen > NOTED_AFTER

    def touch(self, login: Login) -> None:
        """Write down that a session is used."""
        with self._store.write() as session:
            touch_login(session, login.id, _text(self._clock()))

    def sessions(self, login: Login) -> list[OpenSession]:
        """Every session of a person, the one that was used last first."""
        with self._store.read() as session:
            rows = logins_of(session, login.person_id, **self._alive(self._clock()))
        return [
            OpenSession(row.id, row.browser, row.address, row.created, row.seen, row.expires)
            for row in rows
        ]

    def end(self, login: Login, session_id: int) -> None:
        """End a session of one's own.

        Raises:
            NotFoundError: There is none of that id, or it is another person's.
        """
        with self._store.write() as session:
            if not delete_login(session, session_id, login.person_id):
                raise NotFoundError(f"you have no session {session_id}")

    def end_others(self, login: Login) -> None:
        """End every session of a person but the one that asks."""
        with self._store.write() as session:
            delete_logins(session, login.person_id, but=login.id)

    def change_password(self, login: Login, old: str, new: str) -> str:
        """Give oneself another password; every session ends, and a new one begins.

        Returns:
            The token of the new one.

        Raises:
            InputError: The old one is wrong, or the new one cannot be one.
        """
        with self._store.read() as session:
            person = person_by_id(session, login.person_id)
        if person is None or not is_password(old, person.password):
            raise InputError("that is not your present password", pointer="/old")
        hashed = hash_password(new, login.name, pointer="/new")
        with self._store.write() as session:
            found = logins_of(session, login.person_id, **self._alive(self._clock()))
            mine = next((row for row in found if row.id == login.id), None)
            if mine is None:
                raise NotLoggedInError("your session has ended")
            update_person(session, login.person_id, password=hashed)
            delete_logins(session, login.person_id)
            forget_links(session, login.person_id)
            note(session, login.name, login.name, "password", login.role)
        return self._begin(login.person_id, hashed, mine.browser, mine.address, None)

    def _alive(self, at: datetime) -> dict[str, str]:
        return {"at": _text(at), "idle_since": _text(at - IDLE)}


def _text(at: datetime) -> str:
    return at.isoformat(timespec="microseconds")
