"""Tokens of scripts in the database."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from functools import cache
from typing import Any

from sqlalchemy import Select, bindparam, delete, func, insert, select, update

from app.store.rights import with_rights
from app.store.session import Session
from app.store.tables.groups import DatasetModel
from app.store.tables.people import AccessTokenModel, PersonModel

_ALL = (
    select(
        *(column for column in AccessTokenModel.__table__.c if column.name != "token_hash"),
        PersonModel.name.label("person"),
        PersonModel.role,
        DatasetModel.name.label("dataset"),
    )
    .join(PersonModel, PersonModel.id == AccessTokenModel.person_id)
    .join(DatasetModel, DatasetModel.id == AccessTokenModel.dataset_id, isouter=True)
)


def insert_access_token(session: Session, values: dict[str, Any]) -> int:
    """Insert a token; returns its id."""
    done = session.execute(insert(AccessTokenModel).returning(AccessTokenModel.id), values)
    return int(done.scalar_one())


def find_access_token(
    session: Session, token_hash: str, at: str, leading: Collection[str]
) -> Any | None:
    """The token under a hash with its person and their rights (``rights_in``), unless it has expired
    or the person is disabled; ``leading`` are the roles that lead a dataset."""
    given = {"token_hash": token_hash, "at": at}
    return session.execute(_found(tuple(leading)), given).one_or_none()


@cache
def _found(leading: tuple[str, ...]) -> Select[*tuple[Any, ...]]:
    return with_rights(_ALL, leading).where(
        AccessTokenModel.token_hash == bindparam("token_hash"),
        AccessTokenModel.expires > bindparam("at"),
        PersonModel.disabled.is_(False),
    )


def access_tokens(session: Session, person_id: int | None = None) -> Sequence[Any]:
    """The tokens of a person, or of everybody, expired ones too; the newest of each first."""
    statement = _ALL.order_by(PersonModel.name, AccessTokenModel.id.desc())
    mine = AccessTokenModel.person_id == person_id
    return session.execute(statement if person_id is None else statement.where(mine)).all()


def count_access_tokens(session: Session) -> dict[int, int]:
    """How many tokens each person has, by their id."""
    statement = select(AccessTokenModel.person_id, func.count()).group_by(
        AccessTokenModel.person_id
    )
    return {row[0]: row[1] for row in session.execute(statement)}


def touch_access_token(session: Session, token_id: int, at: str) -> None:
    """Note that a token was used."""
    session.execute(update(AccessTokenModel).where(AccessTokenModel.id == token_id).values(used=at))


def delete_access_token(session: Session, token_id: int) -> None:
    """End a token."""
    session.execute(delete(AccessTokenModel).where(AccessTokenModel.id == token_id))


def delete_access_tokens(session: Session, person_id: int) -> None:
    """End every token of a person."""
    session.execute(delete(AccessTokenModel).where(AccessTokenModel.person_id == person_id))


def delete_expired_token(session: Session, person_id: int, name: str, at: str) -> None:
    """Make room for a token of that name, where the one that has it is no longer valid."""
    session.execute(
        delete(AccessTokenModel).where(
            AccessTokenModel.person_id == person_id,
            AccessTokenModel.name == name,
            AccessTokenModel.expires <= at,
        )
    )
