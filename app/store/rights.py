"""Rights of people, as the database has them: all that a request needs to know, in one statement.

Each statement of a request waits for its turn among the threads of the server, and every request of a
team asks for its sender's rights.
"""

from __future__ import annotations

import json
from collections.abc import Collection
from dataclasses import dataclass
from typing import Any

from sqlalchemy import ColumnElement, Select, or_, select

from app.store.dialect.statements import pairs_of
from app.store.session import Session
from app.store.tables.people import DatasetRoleModel, PersonModel
from app.store.tables.takes import CopyDatasetModel


@dataclass(frozen=True)
class Rights:
    """What a person is in single datasets.

    Attributes:
        roles: Their role by the dataset's id.
        copies: Of each dataset of copies that they may see, of which dataset it holds copies.
    """

    roles: dict[int, str]
    copies: dict[int, int]


def with_rights(
    statement: Select[*tuple[Any, ...]], leading: Collection[str]
) -> Select[*tuple[Any, ...]]:
    """A statement about people whose rows tell their rights, too.

    Args:
        statement: Selects from people, and from what each of them has.
        leading: The roles that lead a dataset: who has one sees everybody's copies of its groups.
    """
    return statement.add_columns(_roles().label("single"), _copies(leading).label("copies"))


def rights_in(row: Any) -> Rights:
    """The rights that a row of such a statement tells."""
    return Rights(dict(json.loads(row.single)), dict(json.loads(row.copies)))


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


def _list(statement: Select[Any]) -> ColumnElement[Any]:
    return statement.correlate(PersonModel).scalar_subquery()
