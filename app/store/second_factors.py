"""Second factors of people in the database, and whether everybody needs one.

An authenticator is one, and so is a passkey; the recovery codes are for either.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from sqlalchemy import ColumnElement, delete, exists, func, insert, or_, select, update

from app.store.session import Session
from app.store.tables.people import (
    PasskeyModel,
    PersonModel,
    RecoveryCodeModel,
    SecondFactorModel,
    TeamSettingModel,
)

REQUIRED = "require_second_factor"
_MINE = SecondFactorModel.__table__


def find_second_factor(session: Session, person_id: int) -> Any | None:
    """The second factor of a person, one that was not confirmed too."""
    statement = select(*_MINE.c).where(SecondFactorModel.person_id == person_id)
    return session.execute(statement).one_or_none()


def put_second_factor(session: Session, person_id: int, salt: str, at: str) -> None:
    """Begin with a second factor, in the place of one that was not confirmed."""
    delete_second_factor(session, person_id)
    values = {"salt": salt, "confirmed": False, "last_step": 0, "created": at}
    session.execute(insert(SecondFactorModel), {"person_id": person_id, **values})


def confirm_second_factor(session: Session, person_id: int, hashes: Sequence[str]) -> None:
    """From now on it is asked for; the recovery codes of these hashes take its place once each."""
    mine = SecondFactorModel.person_id == person_id
    session.execute(update(SecondFactorModel).where(mine).values(confirmed=True))
    put_recovery_codes(session, person_id, hashes)


def put_recovery_codes(session: Session, person_id: int, hashes: Sequence[str]) -> None:
    """The recovery codes of a person, in the place of those that they had."""
    delete_recovery_codes(session, person_id)
    rows = [{"person_id": person_id, "code_hash": code_hash} for code_hash in hashes]
    session.execute(insert(RecoveryCodeModel), rows)


def delete_recovery_codes(session: Session, person_id: int) -> None:
    """Forget the recovery codes of a person."""
    session.execute(delete(RecoveryCodeModel).where(RecoveryCodeModel.person_id == person_id))


def use_step(session: Session, person_id: int, step: int) -> bool:
    """Note that the code of a step of time was used; whether it is later than every one before."""
    statement = (
        update(SecondFactorModel)
        .where(SecondFactorModel.person_id == person_id, SecondFactorModel.last_step < step)
        .values(last_step=step)
    )
    return session.execute(statement.returning(SecondFactorModel.person_id)).first() is not None


def use_recovery_code(session: Session, person_id: int, code_hash: str) -> bool:
    """Take a recovery code; whether it was there."""
    statement = delete(RecoveryCodeModel).where(
        RecoveryCodeModel.person_id == person_id, RecoveryCodeModel.code_hash == code_hash
    )
    return session.execute(statement.returning(RecoveryCodeModel.id)).first() is not None


def count_recovery_codes(session: Session, person_id: int) -> int:
    """How many are left."""
    mine = RecoveryCodeModel.person_id == person_id
    return session.scalar(select(func.count()).where(mine)) or 0


def delete_second_factor(session: Session, person_id: int) -> bool:
    """Forget the authenticator of a person; whether there was one."""
    statement = delete(SecondFactorModel).where(SecondFactorModel.person_id == person_id)
    return session.execute(statement.returning(SecondFactorModel.person_id)).first() is not None


def is_required(session: Session) -> bool:
    """Whether everybody needs a second factor."""
    found = session.scalar(select(TeamSettingModel.value).where(TeamSettingModel.name == REQUIRED))
    return found == "on"


def set_required(session: Session, on: bool) -> None:
    """Let everybody need one, or not."""
    session.execute(delete(TeamSettingModel).where(TeamSettingModel.name == REQUIRED))
    values = {"name": REQUIRED, "value": "on" if on else "off"}
    session.execute(insert(TeamSettingModel), values)


def has_second_factor(session: Session, person_id: int) -> bool:
    """Whether somebody has an authenticator that is confirmed, or a passkey."""
    return bool(session.scalar(select(_theirs(person_id))))


def _theirs(person_id: int | ColumnElement[int]) -> ColumnElement[bool]:
    confirmed = SecondFactorModel.confirmed.is_(True)
    return or_(
        exists().where(SecondFactorModel.person_id == person_id, confirmed),
        exists().where(PasskeyModel.person_id == person_id),
    )


def people_with_second_factor(session: Session) -> set[int]:
    """Ids of the people who have one."""
    confirmed = SecondFactorModel.confirmed.is_(True)
    found = set(session.scalars(select(SecondFactorModel.person_id).where(confirmed)))
    return found | set(session.scalars(select(PasskeyModel.person_id)))


MUST_ENROL: ColumnElement[bool] = exists().where(
    TeamSettingModel.name == REQUIRED, TeamSettingModel.value == "on"
) & ~_theirs(PersonModel.__table__.c.id)
"""Of a row of people: whether everybody needs a second factor, and they have none yet."""
