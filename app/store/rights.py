"""Rights of people, as the database has them: all that a request needs to know, in one statement.

Each statement of a request waits for its turn among the threads of the server, and every request of a
team asks for its sender's rights.
"""

from __future__ import annotations

import json
from collections.abc import Collection
from dataclasses import dataclass
from typing import Any

from sqlalchemy import ColumnElement, Exists, Select, case, exists, func, or_, select

from app.store.dialect.statements import pairs_of
from app.store.session import Session
from app.store.tables.people import DatasetRoleModel, PersonModel
from app.store.tables.takes import CopyDatasetModel, TakeModel
from app.store.tables.work import BatchGroupModel, BatchModel, BatchPersonModel
from app.store.takes import GOLD, INDEPENDENT
from app.store.work import OPEN


@dataclass(frozen=True)
class Rights:
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


def with_rights(
    statement: Select[*tuple[Any, ...]], leading: Collection[str]
) -> Select[*tuple[Any, ...]]:
    """A statement about people whose rows tell their rights, too.

    Args:
        statement: Selects from people, and from what each of them has.
        leading: The roles that lead a dataset: who has one sees everybody's copies of its groups.
    """
    return statement.add_columns(
        _roles().label("single"), _copies(leading).label("copies"), _blind().label("blind")
    )


def rights_in(row: Any) -> Rights:
    """The rights that a row of such a statement tells."""
    blind = ((batch, dataset, bool(waits)) for batch, dataset, waits in json.loads(row.blind))
    return Rights(dict(json.loads(row.single)), dict(json.loads(row.copies)), tuple(blind))


def rights_of(session: Session, person_id: int, leading: Collection[str]) -> Rights:
    """The rights of one person; none where there is nobody of that id."""
    statement = with_rights(select(PersonModel.id).where(PersonModel.id == person_id), leading)
    row = session.execute(statement).one_or_none()
    return Rights({}, {}) if row is None else rights_in(row)


def _roles() -> ColumnElement[Any]:
    mine = DatasetRoleModel.person_id == PersonModel.id
    pairs = pairs_of(DatasetRoleModel.dataset_id, DatasetRoleModel.role)
    return _list(select(pairs).where(mine))


def _copies(leading: Collection[str]) -> ColumnElement[Any]:
    """Their own, and those of what they lead: in that dataset, or where they have no other role
    there, in all."""
    table = CopyDatasetModel
    named = select(DatasetRoleModel.dataset_id).where(DatasetRoleModel.person_id == PersonModel.id)
    led = named.where(DatasetRoleModel.role.in_(leading))
    everywhere = PersonModel.role.in_(leading) & table.of_id.not_in(named.correlate(PersonModel))
    seen = or_(
        table.person == PersonModel.name, table.of_id.in_(led.correlate(PersonModel)), everywhere
    )
    return _list(select(pairs_of(table.dataset_id, table.of_id)).where(seen))


def _blind() -> ColumnElement[Any]:
    """The batches that name them, those in which they have begun a copy, and what is left there."""
    batch, take, group, part = BatchModel, TakeModel, BatchGroupModel, BatchPersonModel
    here, mine = take.batch_id == batch.id, take.person == PersonModel.name
    gold = batch.gold_every.is_not(None) | _there(here, take.kind == GOLD)
    copies = batch.gold_every.is_not(None) | ((batch.verdicts > 1) & (batch.blind | gold))
    named = (part.batch_id == batch.id, part.person_id == PersonModel.id)
    annotators = _there(part.batch_id == batch.id, part.part == "annotator")
    annotates = _there(*named, part.part == "annotator") | (_there(*named) & ~annotators)
    asked = select(func.count()).where(
        here, take.group_id == group.group_id, take.kind == INDEPENDENT
    )
    free = _there(
        group.batch_id == batch.id,
        group.settled.is_(None),
        group.handed_in.is_(None),
        ~_there(here, mine, take.group_id == group.group_id),
        asked.correlate(BatchModel, BatchGroupModel).scalar_subquery() < batch.verdicts,
    )
    begun = _there(here, mine, take.handed_in.is_(None), take.settled.is_(None))
    waits = case((free | begun, 1), else_=0)
    found = select(pairs_of(batch.id, batch.dataset_id, waits))
    return _list(found.where(batch.state == OPEN, copies, annotates | _there(here, mine)))


def _there(*where: ColumnElement[bool]) -> Exists:
    return exists().where(*where).correlate(BatchModel, BatchGroupModel, PersonModel)


def _list(statement: Select[Any]) -> ColumnElement[Any]:
    return statement.correlate(PersonModel).scalar_subquery()
