"""Removal: everything of a dataset is found and deleted, and its ids are remembered as used."""

from __future__ import annotations

from collections.abc import Sequence

from sqlalchemy import (
    ColumnElement,
    Select,
    Table,
    delete,
    func,
    or_,
    select,
    update,
)

from app.store.datasets import next_dataset_id
from app.store.dialect.statements import DeferReferences, insert_or_replace
from app.store.session import Session
from app.store.sight import COPIES
from app.store.tables import Base
from app.store.tables.dismissals import DismissalModel
from app.store.tables.groups import DatasetModel, GroupModel, StationModel
from app.store.tables.saved_views import COPIES_USED, UsedIdModel
from app.store.tables.solutions import SolutionModel
from app.store.tables.verdicts import VerdictModel

_TABLES = Base.metadata.tables
_COUNTED = {
    "groups": "groups",
    "views": "view",
    "verdicts": "verdict",
    "saved_views": "saved_view",
    "versions": "version",
    "predictions": "prediction_set",
    "evaluations": "evaluation",
}
"""What a person is told of, by the name of its table."""
_ACCESS = ("dataset_role", "access_token", "webhook")
"""Who may, or hears, what in a dataset; nothing that was said of its groups."""


def count_contents(session: Session, dataset_id: int) -> dict[str, int]:
    """How many groups, views, verdicts, versions and so on a dataset has."""
    counts = {}
    for word, name in _COUNTED.items():
        table = _TABLES[name]
        statement = select(func.count()).select_from(table).where(_belongs(table, dataset_id))
        counts[word] = session.scalar(statement) or 0
    return counts


def solutions_of(session: Session, dataset_id: int) -> list[int]:
    """Ids of the solutions of a dataset's groups."""
    mine = SolutionModel.group_id.in_(_groups(dataset_id))
    return list(session.scalars(select(SolutionModel.id).where(mine)))


def delete_solutions(session: Session, ids: Sequence[int]) -> None:
    """Delete solutions; the calibrations that they rested on may be spare then."""
    session.execute(delete(SolutionModel).where(SolutionModel.id.in_(ids)))


def keep_used_ids(session: Session) -> None:
    """No id is ever given again: the log speaks of what had it."""
    used = dict(session.execute(select(UsedIdModel.table, UsedIdModel.id)).all())
    newest = {
        table.name: session.scalar(select(func.max(table.c.id)))
        for table in Base.metadata.sorted_tables
        if list(table.primary_key.columns.keys()) == ["id"]
    }
    newest[DatasetModel.__tablename__] = next_dataset_id(session) - 1
    copies = next_dataset_id(session, copies=True) - 1
    newest[COPIES_USED] = copies if copies > COPIES else None
    for name, identity in newest.items():
        if identity and identity >= used.get(name, 0):
            statement = insert_or_replace(UsedIdModel)
            session.execute(statement, [{"table": name, "id": identity}])


def move_access(session: Session, dataset_id: int) -> int:
    """Let roles, tokens and webhooks of a dataset be those of the next that is made; returns its id.

    It has to be made in the same transaction.
    """
    session.execute(DeferReferences())
    heir_id = next_dataset_id(session)
    for name in _ACCESS:
        table = _TABLES[name]
        mine = table.c.dataset_id == dataset_id
        session.execute(update(table).where(mine).values(dataset_id=heir_id))
    return heir_id


def delete_rows(session: Session, dataset_id: int) -> None:
    """Delete everything that was said, from the leaves to the dataset itself.

    Tables that cascade (versions, predictions, evaluations) follow the rows that they hang on.
    """
    session.execute(DeferReferences())
    dataset, groups = _TABLES[DatasetModel.__tablename__], _TABLES[GroupModel.__tablename__]
    # The database lets verdicts and dismissals go while their group still tells whose they are.
    judged = [_TABLES[model.__tablename__] for model in (VerdictModel, DismissalModel)]
    for table in judged:
        session.execute(delete(table).where(_belongs(table, dataset_id)))
    for table in filter(_hangs_on, reversed(Base.metadata.sorted_tables)):
        if table not in (dataset, groups, *judged):
            session.execute(delete(table).where(_belongs(table, dataset_id)))
    session.execute(delete(groups).where(_belongs(groups, dataset_id)))
    session.execute(delete(dataset).where(dataset.c.id == dataset_id))


def _belongs(table: Table, dataset_id: int) -> ColumnElement[bool]:
    """Whether a row belongs to the dataset: by its own column, its group's or its station's."""
    if "dataset_id" in table.c:
        return table.c.dataset_id == dataset_id
    stations = select(StationModel.id).where(StationModel.dataset_id == dataset_id)
    owners = {"group_id": _groups(dataset_id), "station_id": stations}
    return or_(*(table.c[name].in_(ids) for name, ids in owners.items() if name in table.c))


def _groups(dataset_id: int) -> Select[int]:
    return select(GroupModel.id).where(GroupModel.dataset_id == dataset_id)


def _hangs_on(table: Table) -> bool:
    """Whether rows refer to a dataset or a group and do not go with it by themselves."""
    return any(
        key.column.table.name in (DatasetModel.__tablename__, GroupModel.__tablename__)
        and key.ondelete is None
        for key in table.foreign_keys
    )
