"""Accounts of the provider of single sign-on in the database: whose each is."""

from __future__ import annotations

from typing import Any

from sqlalchemy import delete, insert, select, update

from app.store.session import Session
from app.store.tables.people import IdentityModel

_ALL = select(*IdentityModel.__table__.columns)


def find_identity(session: Session, issuer: str, subject: str) -> Any | None:
    """The account of a subject at a provider, where it is somebody's."""
    same = (IdentityModel.issuer == issuer, IdentityModel.subject == subject)
    return session.execute(_ALL.where(*same)).one_or_none()


def identity_of(session: Session, person_id: int) -> Any | None:
    """The account of a person."""
    return session.execute(_ALL.where(IdentityModel.person_id == person_id)).one_or_none()


def put_identity(session: Session, values: dict[str, Any]) -> None:
    """Make an account a person's, in the place of the one that they had."""
    delete_identity(session, values["person_id"])
    session.execute(insert(IdentityModel), values)


def use_identity(session: Session, person_id: int, shown: str, at: str) -> None:
    """Note that a person came by their account, and what it is known by now."""
    statement = update(IdentityModel).where(IdentityModel.person_id == person_id)
    session.execute(statement.values(shown=shown, used=at))


def delete_identity(session: Session, person_id: int) -> str | None:
    """Take a person's account from them; returns what it was known by, None where there was none."""
    statement = delete(IdentityModel).where(IdentityModel.person_id == person_id)
    return session.execute(statement.returning(IdentityModel.shown)).scalar_one_or_none()


def people_with_identity(session: Session) -> dict[int, str]:
    """What the accounts of people are known by, by id of the person."""
    statement = select(IdentityModel.person_id, IdentityModel.shown)
    return {row.person_id: row.shown for row in session.execute(statement)}


def count_linked(session: Session, issuer: str, people: list[int]) -> int:
    """How many of some people have an account of a provider."""
    statement = select(IdentityModel.person_id).where(
        IdentityModel.issuer == issuer, IdentityModel.person_id.in_(people)
    )
    return len(session.scalars(statement).all())
