"""Deleting a dataset: everything that belongs to it goes, the log stays and says so.

See docs/decisions/0008-deleting-a-dataset.md.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

from sqlalchemy import (
    Column,
    ColumnElement,
    Select,
    Table,
    delete,
    func,
    insert,
    or_,
    select,
    text,
    true,
)

from app.errors import ConflictError
from app.review.datasets.dataset import dataset_id, read_dataset
from app.store.clock import now
from app.store.log import Entry, append
from app.store.models import (
    DatasetModel,
    GroupModel,
    QueueModel,
    SolutionModel,
    StationModel,
    VerdictModel,
)
from app.store.session import Session, Store
from app.store.tables import Base
from app.store.view_models import UsedIdModel

KIND = "dataset_deleted"
CHUNK = 500
"""Solutions a transaction."""
CALIBRATIONS = 5000
"""Calibrations a transaction; each looks through all solutions that are left."""
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


@dataclass(frozen=True)
class DatasetContents:
    """What belongs to a dataset; ``counts`` by groups, views, verdicts, versions and so on."""

    id: int
    name: str
    counts: dict[str, int]


def read_contents(store: Store, dataset: str | int) -> DatasetContents:
    """What deleting a dataset would take away.

    Raises:
        NotFoundError: There is no such dataset.
    """
    with store.read() as session:
        return _contents(session, read_dataset(session, dataset).id)


def delete_dataset(
    store: Store, dataset: str | int, *, confirm: str, actor: str
) -> DatasetContents:
    """Delete a dataset with everything that belongs to it; returns what that was.

    What was computed goes first, in short transactions: killed in between, it is computed again.
    What was said goes at the end, all at once. The log keeps every entry and gains one.

    Args:
        store: The database.
        dataset: Name or id.
        confirm: The name, once more.
        actor: Who wants it.

    Raises:
        NotFoundError: There is no such dataset.
        ConflictError: ``confirm`` is another name; nothing is deleted.
    """
    found = read_contents(store, dataset)
    if confirm != found.name:
        raise ConflictError(
            f'the dataset is called "{found.name}"',
            hint="Send its name as confirm: deleting cannot be undone.",
            pointer="/confirm",
        )
    identity = dataset_id(store, found.id)
    calibrations = _delete_solutions(store, identity)
    with store.write() as session:
        contents = _contents(session, identity)
        _keep_ids(session)
        body = {"name": contents.name, "counts": contents.counts}
        append(session, [Entry(KIND, actor, now(), body, identity)])
        _delete_rows(session, identity)
    _delete_calibrations(store, calibrations)
    return contents


def _contents(session: Session, identity: int) -> DatasetContents:
    name = read_dataset(session, identity).name
    counts = {
        word: _count(session, Base.metadata.tables[table], identity)
        for word, table in _COUNTED.items()
        if table in Base.metadata.tables
    }
    return DatasetContents(identity, name, counts)


def _count(session: Session, table: Table, identity: int) -> int:
    statement = select(func.count()).select_from(table).where(_belongs(table, identity))
    return session.scalar(statement) or 0


def _belongs(table: Table, identity: int) -> ColumnElement[bool]:
    """Whether a row belongs to the dataset: by its own column, its group's or its station's."""
    if "dataset_id" in table.c:
        return table.c.dataset_id == identity
    stations = select(StationModel.id).where(StationModel.dataset_id == identity)
    owners = {"group_id": _groups(identity), "station_id": stations}
    return or_(*(table.c[name].in_(ids) for name, ids in owners.items() if name in table.c))


def _groups(identity: int) -> Select[int]:
    return select(GroupModel.id).where(GroupModel.dataset_id == identity)


def _delete_solutions(store: Store, identity: int) -> set[str]:
    """Delete what was computed; returns the keys of the calibrations that it rested on."""
    keys: set[str] = set()
    with store.read() as session:
        statement = select(SolutionModel.id).where(SolutionModel.group_id.in_(_groups(identity)))
        solutions = list(session.scalars(statement))
    for start in range(0, len(solutions), CHUNK):
        with store.write() as session:
            chosen = SolutionModel.id.in_(solutions[start : start + CHUNK])
            keys.update(_calibration_keys(session, select(SolutionModel.id).where(chosen)))
            session.execute(delete(SolutionModel).where(chosen))
    return keys


def _calibration_keys(session: Session, solutions: Select[int]) -> Iterator[str]:
    """Keys of the calibrations that solutions rest on, each once."""
    names = func.json_each(SolutionModel.calibrations).table_valued("value")
    statement = select(names.c.value).distinct().select_from(SolutionModel).join(names, true())
    return iter(session.scalars(statement.where(SolutionModel.id.in_(solutions))))


def _delete_calibrations(store: Store, keys: set[str]) -> None:
    """Delete calibrations that no solution names any more, some thousand a transaction.

    While another dataset is being solved they stay: its solver may have read them already.
    """
    names = sorted(keys)
    for start in range(0, len(names), CALIBRATIONS):
        with store.write() as session:
            unsolved = select(QueueModel.group_id).where(QueueModel.solved.is_(False)).limit(1)
            if session.scalar(unsolved) is not None:
                return
            used = set(_calibration_keys(session, select(SolutionModel.id)))
            spare = [{"key": name} for name in names[start : start + CALIBRATIONS]]
            rows = [row for row in spare if row["key"] not in used]
            if rows:
                statement = text("DELETE FROM calibration WHERE key = :key")
                session.execute(statement, rows)


def _keep_ids(session: Session) -> None:
    """No id is ever given again: the log speaks of what had it."""
    for table in Base.metadata.sorted_tables:
        if list(table.primary_key.columns.keys()) == ["id"]:
            column: Column[Any] = table.c.id
            newest = session.scalar(select(func.max(column)))
            row = {"table": table.name, "id": newest or 0}
            statement = insert(UsedIdModel).prefix_with("OR REPLACE")
            if newest is not None and newest >= _used(session, table.name):
                session.execute(statement, [row])


def _used(session: Session, table: str) -> int:
    return session.scalar(select(UsedIdModel.id).where(UsedIdModel.table == table)) or 0


def _delete_rows(session: Session, identity: int) -> None:
    """Delete everything that was said, from the leaves to the dataset itself.

    Tables that cascade (versions, predictions, evaluations) follow the rows that they hang on.
    """
    session.execute(text("PRAGMA defer_foreign_keys = ON"))
    dataset = Base.metadata.tables[DatasetModel.__tablename__]
    groups = Base.metadata.tables[GroupModel.__tablename__]
    verdicts = Base.metadata.tables[VerdictModel.__tablename__]
    # The database lets verdicts go while their group still tells whose they are.
    session.execute(delete(verdicts).where(_belongs(verdicts, identity)))
    own = [table for table in reversed(Base.metadata.sorted_tables) if _hangs_on(table)]
    for table in own:
        if table not in (dataset, groups, verdicts):
            session.execute(delete(table).where(_belongs(table, identity)))
    session.execute(delete(groups).where(_belongs(groups, identity)))
    session.execute(delete(dataset).where(dataset.c.id == identity))


def _hangs_on(table: Table) -> bool:
    """Whether rows refer to a dataset or a group and do not go with it by themselves."""
    return any(
        key.column.table.name in (DatasetModel.__tablename__, GroupModel.__tablename__)
        and key.ondelete is None
        for key in table.foreign_keys
    )
