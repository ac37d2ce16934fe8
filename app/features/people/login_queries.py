"""Sessions, passkeys, accounts of single sign-on, tokens of scripts, and attempts to log in with what they wait for."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from functools import cache
from typing import Any, NamedTuple, cast

from sqlalchemy import (
    Index,
    LargeBinary,
    Select,
    Table,
    bindparam,
    delete,
    func,
    insert,
    select,
    update,
)
from sqlalchemy.orm import Mapped, mapped_column

from app.db.dialects.dialect import insert as insert_or_update
from app.db.session import Base, Session
from app.features.datasets.tables import DatasetModel
from app.features.groups.insert_queries import find_next_row_id, reserve_row_ids
from app.features.people.queries import MUST_ENROL, select_with_rights
from app.features.people.tables import (
    AccessTokenModel,
    IdentityModel,
    LoginModel,
    PasskeyModel,
    PersonModel,
)


class AttemptModel(Base):
    """A try that counts against a limit (``at``: seconds since 1970), where several processes count."""

    __tablename__ = "attempt"
    __table_args__ = (Index("attempt_whose", "whose", "at"), Index("attempt_at", "at"))

    id: Mapped[int] = mapped_column(primary_key=True)
    whose: Mapped[str]
    at: Mapped[float]


class PendingActionModel(Base):
    """What somebody has begun and finishes within minutes, maybe at another process.

    ``name`` is a hash, ``value`` is encrypted with a key of the home.
    """

    __tablename__ = "begun"
    __table_args__ = (Index("begun_ends", "ends"),)

    name: Mapped[str] = mapped_column(primary_key=True)
    value: Mapped[bytes] = mapped_column(LargeBinary)
    ends: Mapped[str]


KEPT_SECONDS = 3600.0
"""No limit looks back further."""
_BEGUN = cast(Table, PendingActionModel.__table__)


def find_blocking_attempt(session: Session, whose: str, since: float, most: int) -> float | None:
    """When the oldest try since a time was (both: seconds since 1970), where there are too many."""
    mine = (AttemptModel.whose == whose, AttemptModel.at > since)
    statement = select(func.count(), func.min(AttemptModel.at)).where(*mine)
    count, oldest = session.execute(statement).one()
    return float(oldest) if count >= most else None


def insert_login_attempt(session: Session, whose: str, at: float) -> None:
    """Count a try; those that no limit looks back to are forgotten."""
    session.execute(delete(AttemptModel).where(AttemptModel.at <= at - KEPT_SECONDS))
    session.execute(insert(AttemptModel), [{"whose": whose, "at": at}])


def store_pending_action(
    session: Session, name: str, value: bytes, ends: str, at: str, most: int
) -> None:
    """Keep what somebody has begun, in the place of what they had; what has ended goes.

    Args:
        session: One that writes.
        name: Of it.
        value: What it is.
        ends: Until when it is good, and ``at``, what time it is, as ISO text in UTC.
        most: So many are kept; beyond it the oldest makes room.
    """
    session.execute(delete(PendingActionModel).where(PendingActionModel.ends <= at))
    count = session.scalar(select(func.count()).select_from(PendingActionModel)) or 0
    if count >= most:
        oldest = (
            select(PendingActionModel.name)
            .order_by(PendingActionModel.ends)
            .limit(count - most + 1)
        )
        session.execute(delete(PendingActionModel).where(PendingActionModel.name.in_(oldest)))
    new = insert_or_update(_BEGUN).values(name=name, value=value, ends=ends)
    same = {"value": new.excluded.value, "ends": new.excluded.ends}
    session.execute(new.on_conflict_do_update(index_elements=[_BEGUN.c.name], set_=same))


def take_pending_action(session: Session, name: str, at: str) -> bytes | None:
    """What was begun under a name, which is gone then; None where nothing is that is good."""
    gone = delete(PendingActionModel).where(PendingActionModel.name == name)
    row = session.execute(
        gone.returning(PendingActionModel.value, PendingActionModel.ends)
    ).one_or_none()
    return None if row is None or row.ends <= at else bytes(row.value)


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
    """The session under a hash with its person, their rights (``rights_from_row``) and whether they
    ``must_enrol``, unless it has ended or the person is disabled.

    Args:
        session: A transaction.
        token_hash: SHA-256 of what the browser has.
        leading: The roles that lead a dataset.
        at: The time now.
        idle_since: A session that was used last before this time has ended.
    """
    given = {"token_hash": token_hash, "at": at, "idle_since": idle_since}
    return session.execute(_build_login_statement(tuple(leading)), given).one_or_none()


@cache
def _build_login_statement(leading: tuple[str, ...]) -> Select[*tuple[Any, ...]]:
    """Made once: it takes longer to put together than to answer."""
    return select_with_rights(_FOUND, leading).where(
        LoginModel.token_hash == bindparam("token_hash"),
        LoginModel.expires > bindparam("at"),
        LoginModel.seen > bindparam("idle_since"),
        PersonModel.disabled.is_(False),
    )


def list_sessions(
    session: Session, person_id: int, *, at: str, idle_since: str
) -> Sequence[LoginModel]:
    """The sessions of a person that have not ended, the one that was used last first."""
    statement = select(*LoginModel.__table__.columns).where(
        LoginModel.person_id == person_id, LoginModel.expires > at, LoginModel.seen > idle_since
    )
    return session.rows(LoginModel, statement.order_by(LoginModel.seen.desc()))


def update_login_last_use(session: Session, login_id: int, at: str) -> None:
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


def delete_expired_logins(session: Session, *, at: str, idle_since: str) -> None:
    """Forget the sessions that have ended by themselves."""
    session.execute(
        delete(LoginModel).where((LoginModel.expires <= at) | (LoginModel.seen <= idle_since))
    )


_ALL = select(*PasskeyModel.__table__.columns)


def insert_passkey(session: Session, values: dict[str, Any]) -> int:
    """Insert a passkey; returns its id."""
    done = session.execute(insert(PasskeyModel).returning(PasskeyModel.id), values)
    return int(done.scalar_one())


def find_passkey(session: Session, credential: str) -> PasskeyModel | None:
    """The passkey of a credential's id, in base64url."""
    return session.row(PasskeyModel, _ALL.where(PasskeyModel.credential == credential))


def list_passkeys(session: Session, person_id: int) -> Sequence[PasskeyModel]:
    """The passkeys of a person, the oldest first."""
    mine = _ALL.where(PasskeyModel.person_id == person_id)
    return session.rows(PasskeyModel, mine.order_by(PasskeyModel.id))


def update_passkey_use(session: Session, passkey_id: int, sign_count: int, at: str) -> None:
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


_ALL_IDENTITIES = select(*IdentityModel.__table__.columns)


def find_identity(session: Session, issuer: str, subject: str) -> IdentityModel | None:
    """The account of a subject at a provider, where it is somebody's."""
    same = (IdentityModel.issuer == issuer, IdentityModel.subject == subject)
    return session.row(IdentityModel, _ALL_IDENTITIES.where(*same))


def find_person_identity(session: Session, person_id: int) -> IdentityModel | None:
    """The account of a person."""
    return session.row(IdentityModel, _ALL_IDENTITIES.where(IdentityModel.person_id == person_id))


def put_identity(session: Session, values: dict[str, Any]) -> None:
    """Make an account a person's, in the place of the one that they had."""
    delete_identity(session, values["person_id"])
    session.execute(insert(IdentityModel), values)


def update_identity_use(session: Session, person_id: int, shown: str, at: str) -> None:
    """Note that a person came by their account, and what it is known by now."""
    statement = update(IdentityModel).where(IdentityModel.person_id == person_id)
    session.execute(statement.values(shown=shown, used=at))


def delete_identity(session: Session, person_id: int) -> str | None:
    """Take a person's account from them; returns what it was known by, None where there was none."""
    statement = delete(IdentityModel).where(IdentityModel.person_id == person_id)
    return session.execute(statement.returning(IdentityModel.shown)).scalar_one_or_none()


def read_identity_labels(session: Session) -> dict[int, str]:
    """The labels of linked accounts, by id of the person."""
    statement = select(IdentityModel.person_id, IdentityModel.shown)
    return {row.person_id: row.shown for row in session.execute(statement)}


def count_linked_people(session: Session, issuer: str, people: list[int]) -> int:
    """How many of some people have an account of a provider."""
    statement = select(IdentityModel.person_id).where(
        IdentityModel.issuer == issuer, IdentityModel.person_id.in_(people)
    )
    return len(session.scalars(statement).all())


class TokenRow(NamedTuple):
    """A token of a script with the name and role of its person, and the name of its ``dataset``."""

    id: int
    person_id: int
    dataset_id: int | None
    name: str
    start: str
    scopes: str
    created: str
    expires: str
    used: str | None
    person: str
    role: str
    dataset: str | None


_ALL_TOKENS = (
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
    identity = find_next_row_id(session, AccessTokenModel)
    session.execute(insert(AccessTokenModel), [{"id": identity, **values}])
    return identity


def find_access_token(
    session: Session, token_hash: str, at: str, leading: Collection[str]
) -> Any | None:
    """The token under a hash with its person and their rights (``rights_from_row``), unless it has expired
    or the person is disabled; ``leading`` are the roles that lead a dataset."""
    given = {"token_hash": token_hash, "at": at}
    return session.execute(_access_token_statement(tuple(leading)), given).one_or_none()


@cache
def _access_token_statement(leading: tuple[str, ...]) -> Select[*tuple[Any, ...]]:
    return select_with_rights(_ALL_TOKENS, leading).where(
        AccessTokenModel.token_hash == bindparam("token_hash"),
        AccessTokenModel.expires > bindparam("at"),
        PersonModel.disabled.is_(False),
    )


def list_access_tokens(session: Session, person_id: int | None = None) -> Sequence[TokenRow]:
    """The tokens of a person, or of everybody, expired ones too; the newest of each first."""
    statement = _ALL_TOKENS.order_by(PersonModel.name, AccessTokenModel.id.desc())
    mine = AccessTokenModel.person_id == person_id
    return session.rows(TokenRow, statement if person_id is None else statement.where(mine))


def count_access_tokens(session: Session) -> dict[int, int]:
    """How many tokens each person has, by their id."""
    statement = select(AccessTokenModel.person_id, func.count()).group_by(
        AccessTokenModel.person_id
    )
    return {row[0]: row[1] for row in session.execute(statement)}


def update_access_token_last_use(session: Session, token_id: int, at: str) -> None:
    """Note that a token was used."""
    session.execute(update(AccessTokenModel).where(AccessTokenModel.id == token_id).values(used=at))


def delete_access_token(session: Session, token_id: int) -> None:
    """End a token."""
    reserve_row_ids(session, AccessTokenModel)
    session.execute(delete(AccessTokenModel).where(AccessTokenModel.id == token_id))


def delete_access_tokens(session: Session, person_id: int) -> None:
    """End every token of a person."""
    reserve_row_ids(session, AccessTokenModel)
    session.execute(delete(AccessTokenModel).where(AccessTokenModel.person_id == person_id))


def delete_expired_token(session: Session, person_id: int, name: str, at: str) -> None:
    """Make room for a token of that name, where the one that has it is no longer valid."""
    reserve_row_ids(session, AccessTokenModel)
    session.execute(
        delete(AccessTokenModel).where(
            AccessTokenModel.person_id == person_id,
            AccessTokenModel.name == name,
            AccessTokenModel.expires <= at,
        )
    )
