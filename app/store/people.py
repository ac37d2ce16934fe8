"""People in the database, and the links with which they set their passwords."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from sqlalchemy import delete, exists, func, insert, or_, select, update

from app.store.clock import now
from app.store.session import Session
from app.store.tables.people import IdentityModel, LoginModel, OneTimeLinkModel, PersonModel

_PEOPLE = select(*PersonModel.__table__.columns)
_SEEN = (
    select(func.max(LoginModel.seen))
    .where(LoginModel.person_id == PersonModel.id)
    .scalar_subquery()
)


def all_people(session: Session) -> Sequence[Any]:
    """Every person by name, with when they were ``seen`` last in a session that still is."""
    return session.execute(
        _PEOPLE.add_columns(_SEEN.label("seen")).order_by(PersonModel.name)
    ).all()


def person_by_name(session: Session, name: str) -> Any | None:
    """The person of a name."""
    return session.execute(_PEOPLE.where(PersonModel.name == name)).one_or_none()


def person_by_id(session: Session, person_id: int) -> Any | None:
    """The person of an id."""
    return session.execute(_PEOPLE.where(PersonModel.id == person_id)).one_or_none()


def count_people(session: Session) -> int:
    """How many accounts there are."""
    return session.scalar(select(func.count()).select_from(PersonModel)) or 0


def count_able(session: Session, role: str, *, but: int | None = None) -> int:
    """How many people of a role can log in, one of them left out."""
    statement = select(func.count()).where(
        PersonModel.role == role,
        PersonModel.disabled.is_(False),
        or_(
            PersonModel.password.is_not(None),
            exists().where(IdentityModel.person_id == PersonModel.id),
        ),
    )
    if but is not None:
        statement = statement.where(PersonModel.id != but)
    return session.scalar(statement) or 0


def insert_person(session: Session, name: str, role: str, *, by: str) -> int:
    """Insert a person; returns their id. Accounts are never deleted: the log names them."""
    values = {"name": name, "role": role, "password": None, "disabled": False}
    done = session.execute(
        insert(PersonModel).returning(PersonModel.id),
        {**values, "created": now(), "created_by": by},
    )
    return int(done.scalar_one())


def update_person(session: Session, person_id: int, **values: Any) -> None:
    """Write some columns of a person."""
    session.execute(update(PersonModel).where(PersonModel.id == person_id).values(**values))


def insert_link(
    session: Session, token_hash: str, person_id: int | None, *, by: str, expires: str
) -> None:
    """Insert a link; those that the same person (or nobody) had before are no longer valid."""
    forget_links(session, person_id)
    values = {"token_hash": token_hash, "person_id": person_id, "created": now()}
    session.execute(insert(OneTimeLinkModel), {**values, "created_by": by, "expires": expires})


def find_link(session: Session, token_hash: str, at: str) -> Any | None:
    """A link that is still good at a time."""
    statement = select(*OneTimeLinkModel.__table__.columns).where(
        OneTimeLinkModel.token_hash == token_hash, OneTimeLinkModel.expires > at
    )
    return session.execute(statement).one_or_none()


def forget_links(session: Session, person_id: int | None) -> None:
    """End every link of a person, or those of nobody."""
    theirs = OneTimeLinkModel.person_id
    whose = theirs.is_(None) if person_id is None else theirs == person_id
    session.execute(delete(OneTimeLinkModel).where(whose))


def people_with_links(session: Session, at: str) -> set[int]:
    """Ids of the people who have a link that is good at a time."""
    statement = select(OneTimeLinkModel.person_id).where(OneTimeLinkModel.expires > at)
    return {found for found in session.scalars(statement) if found is not None}
