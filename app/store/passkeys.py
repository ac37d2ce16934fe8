"""Passkeys of people in the database: public keys alone, which open nothing."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from sqlalchemy import delete, insert, select, update

from app.store.session import Session
from app.store.tables.people import PasskeyModel

_ALL = select(*PasskeyModel.__table__.columns)


def insert_passkey(session: Session, values: dict[str, Any]) -> int:
    """Insert a passkey; returns its id."""
    done = session.execute(insert(PasskeyModel).returning(PasskeyModel.id), values)
    return int(done.scalar_one())


def find_passkey(session: Session, credential: str) -> Any | None:
    """The passkey of a credential's id, in base64url."""
    return session.execute(_ALL.where(PasskeyModel.credential == credential)).one_or_none()


def passkeys_of(session: Session, person_id: int) -> Sequence[Any]:
    """The passkeys of a person, the oldest first."""
    mine = _ALL.where(PasskeyModel.person_id == person_id)
    return session.execute(mine.order_by(PasskeyModel.id)).all()


def use_passkey(session: Session, passkey_id: int, sign_count: int, at: str) -> None:
    """Note that a passkey was used, and how often its device says that it was."""
    statement = update(PasskeyModel).where(PasskeyModel.id == passkey_id)
    session.execute(statement.values(sign_count=sign_count, used=at))


def delete_passkey(session: Session, passkey_id: int, person_id: int) -> str | None:
    """Forget a passkey of a person; returns its name, None where there is none."""
    statement = delete(PasskeyModel).where(
        PasskeyModel.id == passkey_id, PasskeyModel.person_id == person_id
    )
    return session.execute(statement.returning(PasskeyModel.name)).scalar_one_or_none()


def delete_passkeys(session: Session, person_id: int) -> bool:
    """Forget every passkey of a person; whether there was one."""
    statement = delete(PasskeyModel).where(PasskeyModel.person_id == person_id)
    return bool(session.scalars(statement.returning(PasskeyModel.id)).all())
