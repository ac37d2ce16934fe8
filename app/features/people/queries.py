"""People in the database: accounts, roles in datasets, second factors.

One statement reads all that a request needs to know of its person.
"""

from __future__ import annotations

import json
from collections.abc import Collection, Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

from sqlalchemy import (
    ColumnElement,
    Exists,
    Select,
    case,
    delete,
    exists,
    func,
    insert,
    or_,
    select,
    update,
)

from app.db.dialects.dialect import json_pairs_of
from app.db.session import Session, now
from app.features.batches.queries import OPEN
from app.features.batches.tables import BatchGroupModel, BatchModel, BatchPersonModel
from app.features.datasets.tables import DatasetModel
from app.features.independent_annotations.queries import GOLD, INDEPENDENT, is_abandoned
from app.features.independent_annotations.tables import CopyDatasetModel, IndependentAnnotationModel
from app.features.people.tables import (
    DatasetRoleModel,
    IdentityModel,
    LoginModel,
    OneTimeLinkModel,
    PasskeyModel,
    PersonModel,
    RecoveryCodeModel,
    SecondFactorModel,
    TeamSettingModel,
)


class PersonRow(NamedTuple):
    """A person with when they were ``seen`` last in a session that still is."""

    id: int
    name: str
    role: str
    password: str | None
    disabled: bool
    created: str
    created_by: str
    seen: str | None


_PEOPLE = select(*PersonModel.__table__.columns)
_SEEN = (
    select(func.max(LoginModel.seen))
    .where(LoginModel.person_id == PersonModel.id)
    .scalar_subquery()
)


def list_people_rows(session: Session) -> Sequence[PersonRow]:
    """Every person by name, with when they were ``seen`` last in a session that still is."""
    statement = _PEOPLE.add_columns(_SEEN.label("seen")).order_by(PersonModel.name)
    return session.rows(PersonRow, statement)


def find_person_by_name(session: Session, name: str) -> PersonModel | None:
    """The person of a name."""
    return session.row(PersonModel, _PEOPLE.where(PersonModel.name == name))


def find_person_by_id(session: Session, person_id: int) -> PersonModel | None:
    """The person of an id."""
    return session.row(PersonModel, _PEOPLE.where(PersonModel.id == person_id))


def count_people(session: Session) -> int:
    """How many accounts there are."""
    return session.scalar(select(func.count()).select_from(PersonModel)) or 0


def count_people_who_can_log_in(
    session: Session, role: str, *, but: int | None = None, only_issuer: str | None = None
) -> int:
    """How many people of a role can log in, one of them left out.

    ``only_issuer`` is the provider by which alone people log in; None: there are other ways.
    """
    linked = exists().where(IdentityModel.person_id == PersonModel.id)
    can = (
        or_(PersonModel.password.is_not(None), linked)
        if only_issuer is None
        else linked.where(IdentityModel.issuer == only_issuer)
    )
    statement = select(func.count()).where(
        PersonModel.role == role, PersonModel.disabled.is_(False), can
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
    delete_person_links(session, person_id)
    values = {"token_hash": token_hash, "person_id": person_id, "created": now()}
    session.execute(insert(OneTimeLinkModel), {**values, "created_by": by, "expires": expires})


def find_link(session: Session, token_hash: str, at: str) -> OneTimeLinkModel | None:
    """A link that is still good at a time."""
    statement = select(*OneTimeLinkModel.__table__.columns).where(
        OneTimeLinkModel.token_hash == token_hash, OneTimeLinkModel.expires > at
    )
    return session.row(OneTimeLinkModel, statement)


def delete_person_links(session: Session, person_id: int | None) -> None:
    """End every link of a person, or those of nobody."""
    theirs = OneTimeLinkModel.person_id
    whose = theirs.is_(None) if person_id is None else theirs == person_id
    session.execute(delete(OneTimeLinkModel).where(whose))


def list_people_with_valid_links(session: Session, at: str) -> set[int]:
    """Ids of the people who have a link that is good at a time."""
    statement = select(OneTimeLinkModel.person_id).where(OneTimeLinkModel.expires > at)
    return {found for found in session.scalars(statement) if found is not None}


@dataclass(frozen=True)
class DatasetRights:
    """What a person is in single datasets.

    Attributes:
        roles: Their role by the dataset's id.
        copies: Of each dataset of copies that they may see, of which dataset it holds copies.
        blind: The open batches of which they annotate copies without seeing what others make of the
            groups: id of the batch, of its dataset, and whether something is left for them.
    """

    roles: dict[int, str]
    copies: dict[int, int]
    blind: tuple[tuple[int, int, bool], ...] = ()


def select_with_rights(
    statement: Select[*tuple[Any, ...]], leading: Collection[str]
) -> Select[*tuple[Any, ...]]:
    """A statement about people whose rows tell their rights, too.

    Args:
        statement: Selects from people, and from what each of them has.
        leading: The roles that lead a dataset: who has one sees everybody's copies of its groups.
    """
    return statement.add_columns(
        _roles_column().label("single"),
        _copies_column(leading).label("copies"),
        _blind_batches_column().label("blind"),
    )


def rights_from_row(row: Any) -> DatasetRights:
    """The rights that a row of such a statement tells."""
    blind = ((batch, dataset, bool(waits)) for batch, dataset, waits in json.loads(row.blind))
    return DatasetRights(dict(json.loads(row.single)), dict(json.loads(row.copies)), tuple(blind))


def find_rights(session: Session, person_id: int, leading: Collection[str]) -> DatasetRights:
    """The rights of one person; none where there is nobody of that id."""
    statement = select_with_rights(
        select(PersonModel.id).where(PersonModel.id == person_id), leading
    )
    row = session.execute(statement).one_or_none()
    return DatasetRights({}, {}) if row is None else rights_from_row(row)


def _roles_column() -> ColumnElement[Any]:
    mine = DatasetRoleModel.person_id == PersonModel.id
    pairs = json_pairs_of(DatasetRoleModel.dataset_id, DatasetRoleModel.role)
    return _scalar_subquery(select(pairs).where(mine))


def _copies_column(leading: Collection[str]) -> ColumnElement[Any]:
    """Their own, and those of what they lead: in that dataset, or where they have no other role
    there, in all."""
    table = CopyDatasetModel
    named = select(DatasetRoleModel.dataset_id).where(DatasetRoleModel.person_id == PersonModel.id)
    led = named.where(DatasetRoleModel.role.in_(leading))
    everywhere = PersonModel.role.in_(leading) & table.of_id.not_in(named.correlate(PersonModel))
    seen = or_(
        table.person == PersonModel.name, table.of_id.in_(led.correlate(PersonModel)), everywhere
    )
    return _scalar_subquery(select(json_pairs_of(table.dataset_id, table.of_id)).where(seen))


def _blind_batches_column() -> ColumnElement[Any]:
    """The batches that name them, those in which they have begun a copy, and what is left there."""
    batch, annotation, group, part = (
        BatchModel,
        IndependentAnnotationModel,
        BatchGroupModel,
        BatchPersonModel,
    )
    here, mine = annotation.batch_id == batch.id, annotation.person == PersonModel.name
    gold = batch.gold_every.is_not(None) | _build_correlated_exists(here, annotation.kind == GOLD)
    copies = batch.gold_every.is_not(None) | ((batch.verdicts > 1) & (batch.blind | gold))
    named = (part.batch_id == batch.id, part.person_id == PersonModel.id)
    annotators = _build_correlated_exists(part.batch_id == batch.id, part.part == "annotator")
    annotates = _build_correlated_exists(*named, part.part == "annotator") | (
        _build_correlated_exists(*named) & ~annotators
    )
    own_count = select(func.count()).where(
        here,
        annotation.group_id == group.group_id,
        annotation.kind == INDEPENDENT,
        ~is_abandoned(),
    )
    free = _build_correlated_exists(
        group.batch_id == batch.id,
        group.settled.is_(None),
        group.submitted.is_(None),
        ~_build_correlated_exists(here, mine, annotation.group_id == group.group_id),
        own_count.correlate(BatchModel, BatchGroupModel).scalar_subquery() < batch.verdicts,
    )
    begun = _build_correlated_exists(
        here, mine, annotation.submitted.is_(None), annotation.settled.is_(None)
    )
    waits = case((free | begun, 1), else_=0)
    found = select(json_pairs_of(batch.id, batch.dataset_id, waits))
    return _scalar_subquery(
        found.where(batch.state == OPEN, copies, annotates | _build_correlated_exists(here, mine))
    )


def _build_correlated_exists(*where: ColumnElement[bool]) -> Exists:
    return exists().where(*where).correlate(BatchModel, BatchGroupModel, PersonModel)


def _scalar_subquery(statement: Select[Any]) -> ColumnElement[Any]:
    return statement.correlate(PersonModel).scalar_subquery()


class DatasetRoleRow(NamedTuple):
    """A role of a person in one dataset, ``dataset`` by name."""

    person_id: int
    dataset_id: int
    dataset: str
    role: str


def list_dataset_roles(session: Session) -> Sequence[DatasetRoleRow]:
    """The roles that people have in single datasets, by name of the dataset."""
    statement = (
        select(
            DatasetRoleModel.person_id,
            DatasetRoleModel.dataset_id,
            DatasetModel.name.label("dataset"),
            DatasetRoleModel.role,
        )
        .join(DatasetModel, DatasetModel.id == DatasetRoleModel.dataset_id)
        .order_by(DatasetModel.name)
    )
    return session.rows(DatasetRoleRow, statement)


class MemberRow(NamedTuple):
    """A person with the role that they have ``everywhere``, and in one dataset."""

    id: int
    name: str
    everywhere: str
    role: str | None


def read_members(
    session: Session, dataset_id: int, person_id: int | None = None
) -> Sequence[MemberRow]:
    """One person, or all who are not disabled, with their roles in a dataset."""
    one = PersonModel.disabled.is_(False) if person_id is None else PersonModel.id == person_id
    here = (DatasetRoleModel.person_id == PersonModel.id) & (
        DatasetRoleModel.dataset_id == dataset_id
    )
    statement = (
        select(
            PersonModel.id,
            PersonModel.name,
            PersonModel.role.label("everywhere"),
            DatasetRoleModel.role,
        )
        .outerjoin(DatasetRoleModel, here)
        .where(one)
        .order_by(PersonModel.name)
    )
    return session.rows(MemberRow, statement)


def set_dataset_role(
    session: Session, person_id: int, dataset_id: int, role: str | None, *, by: str
) -> None:
    """Give a person a role in a dataset; None: what they are everywhere counts there again."""
    mine = (DatasetRoleModel.person_id == person_id) & (DatasetRoleModel.dataset_id == dataset_id)
    session.execute(delete(DatasetRoleModel).where(mine))
    if role is not None:
        values = {"person_id": person_id, "dataset_id": dataset_id, "role": role}
        session.execute(insert(DatasetRoleModel), {**values, "given": now(), "given_by": by})


REQUIRED = "require_second_factor"
_MINE = SecondFactorModel.__table__


def find_second_factor(session: Session, person_id: int) -> SecondFactorModel | None:
    """The second factor of a person, one that was not confirmed too."""
    statement = select(*_MINE.c).where(SecondFactorModel.person_id == person_id)
    return session.row(SecondFactorModel, statement)


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


def save_used_totp_step(session: Session, person_id: int, step: int) -> bool:
    """Note that the code of a step of time was used; whether it is later than every one before."""
    statement = (
        update(SecondFactorModel)
        .where(SecondFactorModel.person_id == person_id, SecondFactorModel.last_step < step)
        .values(last_step=step)
    )
    return session.execute(statement.returning(SecondFactorModel.person_id)).first() is not None


def delete_recovery_code(session: Session, person_id: int, code_hash: str) -> bool:
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


def is_second_factor_required(session: Session) -> bool:
    """Whether everybody needs a second factor."""
    return read_team_setting(session, REQUIRED) == "on"


def set_second_factor_required(session: Session, on: bool) -> None:
    """Let everybody need one, or not."""
    write_team_setting(session, REQUIRED, "on" if on else "off")


def read_team_setting(session: Session, name: str) -> str | None:
    """A setting that an admin made for everybody; None: nobody did."""
    return session.scalar(select(TeamSettingModel.value).where(TeamSettingModel.name == name))


def write_team_setting(session: Session, name: str, value: str | None) -> None:
    """Make a setting for everybody; None takes it away."""
    session.execute(delete(TeamSettingModel).where(TeamSettingModel.name == name))
    if value is not None:
        session.execute(insert(TeamSettingModel), {"name": name, "value": value})


def has_second_factor(session: Session, person_id: int) -> bool:
    """Whether somebody has an authenticator that is confirmed, or a passkey."""
    return bool(session.scalar(select(_second_factor_condition(person_id))))


def _second_factor_condition(person_id: int | ColumnElement[int]) -> ColumnElement[bool]:
    confirmed = SecondFactorModel.confirmed.is_(True)
    return or_(
        exists().where(SecondFactorModel.person_id == person_id, confirmed),
        exists().where(PasskeyModel.person_id == person_id),
    )


def list_people_with_second_factor(session: Session) -> set[int]:
    """Ids of the people who have one."""
    confirmed = SecondFactorModel.confirmed.is_(True)
    found = set(session.scalars(select(SecondFactorModel.person_id).where(confirmed)))
    return found | set(session.scalars(select(PasskeyModel.person_id)))


MUST_ENROL: ColumnElement[bool] = exists().where(
    TeamSettingModel.name == REQUIRED, TeamSettingModel.value == "on"
) & ~_second_factor_condition(PersonModel.__table__.c.id)
"""Of a row of people: whether everybody needs a second factor, and they have none yet."""
