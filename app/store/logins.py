"""Sessions of people in the database."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from functools import cache
from typing import Any

from sqlalchemy import Select, bindparam, delete, insert, select, update

from app.store.rights import with_rights
from app.store.second_factors import MUST_ENROL
from app.store.session import Session
from app.store.tables.people import LoginModel, PersonModel

_FOUND = select(
    LoginModel.id,
    LoginModel.person_id,
    LoginModel.seen,
    LoginModel.created,
    LoginModel.expires,
    LoginModel.way,
    LoginModel.vouched,
    PersonModel.name,
    PersonModel.role,
    MUST_ENROL.label("must_enrol"),
).join(PersonModel, PersonModel.id == LoginModel.person_id)


def insert_login(session: Session, values: dict[str, Any]) -> None:
    """Insert a session."""
    session.execute(insert(LoginModel), values)


def find_login(
    session: Session, token_hash: str, *, at: str, idle_since: str, leading: Collection[str]
) -> Any | None:
    """The session under a hash with its person, their rights (``rights_in``) and whether they
    ``must_enrol``, unless it has ended or the person is disabled.

    Args:
        session: A transaction.
        token_hash: SHA-256 of what the browser has.
        leading: The roles that lead a dataset.
        at: The time now.
        idle_since: A session that was used last before this time has ended.
    """
    given = {"token_hash": token_hash, "at": at, "idle_since": idle_since}
    return session.execute(_found(tuple(leading)), given).one_or_none()


@cache
def _found(leading: tuple[str, ...]) -> Select[*tuple[Any, ...]]:
    """Made once: it takes longer to put together than to answer."""
    return with_rights(_FOUND, leading).where(
        LoginModel.token_hash == bindparam("token_hash"),
        LoginModel.expires > bindparam("at"),
        LoginModel.seen > bindparam("idle_since"),
        PersonModel.disabled.is_(False),
    )


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


def delete_logins(
    session: Session, person_id: int, *, but: int | None = None, way: str | None = None
) -> None:
    """End every session of a person, or all but one, or those that began in one way."""
    statement = delete(LoginModel).where(LoginModel.person_id == person_id)
    if way is not None:
        statement = statement.where(LoginModel.way == way)
    session.execute(statement if but is None else statement.where(LoginModel.id != but))


def delete_ended(session: Session, *, at: str, idle_since: str) -> None:
    """Forget the sessions that have ended by themselves."""
    session.execute(
        delete(LoginModel).where((LoginModel.expires <= at) | (LoginModel.seen <= idle_since))
    )
