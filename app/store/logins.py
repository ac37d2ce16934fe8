"""Sessions of people in the database."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from sqlalchemy import delete, insert, select, update
from sqlalchemy.orm import Session

from app.store.people_models import LoginModel, PersonModel

_FOUND = select(
    LoginModel.id,
    LoginModel.person_id,
    LoginModel.seen,
    LoginModel.expires,
    PersonModel.name,
    PersonModel.role,
).join(PersonModel, PersonModel.id == LoginModel.person_id)


def insert_login(session: Session, values: dict[str, Any]) -> None:
    """Insert a session."""
    session.execute(insert(LoginModel), values)


def find_login(session: Session, token_hash: str, *, at: str, idle_since: str) -> Any | None:
    """The session under a hash with its person, unless it has ended or the person is disabled.

    Args:
        session: A transaction.
        token_hash: SHA-256 of what the browser has.
        at: The time now.
        idle_since: A session that was used last before this time has ended.
    """
    statement = _FOUND.where(
        LoginModel.token_hash == token_hash,
        LoginModel.expires > at,
        LoginModel.seen > idle_since,
        PersonModel.disabled.is_(False),
    )
    return session.execute(statement).one_or_none()


def logins_of(session: Session, person_id: int, *, at: str, idle_since: str) -> Sequence[Any]:
    """The sessions of a person that have not ended, the one that was used last first."""
    statement = select(*LoginModel.__table__.columns).where(
        LoginModel.person_id == person_id, LoginModel.expires > at, LoginModel.seen > idle_since
    )
    return session.execute(statement.order_by(LoginModel.seen.desc())).all()


def touch_login(session: Session, login_id: int, at: str) -> None:
    """Note that a session was used."""
    session.execute(update(LoginModel).where(LoginModel.id == login_id).values(seen=at))


def delete_login(session: Session, login_id: int, person_id: int) -> bool:
    """End a session of a person; returns whether there was one."""
    statement = delete(LoginModel).where(
        LoginModel.id == login_id, LoginModel.person_id == person_id
    )
    return session.execute(statement.returning(LoginModel.id)).one_or_none() is not None


def delete_logins(session: Session, person_id: int, *, but: int | None = None) -> None:
    """End every session of a person, or all but one."""
    statement = delete(LoginModel).where(LoginModel.person_id == person_id)
    session.execute(statement if but is None else statement.where(LoginModel.id != but))


def delete_ended(session: Session, *, at: str, idle_since: str) -> None:
    """Forget the sessions that have ended by themselves."""
    session.execute(
        delete(LoginModel).where((LoginModel.expires <= at) | (LoginModel.seen <= idle_since))
    )
