"""The projection: every row that the log can make anew, read whole and written whole."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from typing import Any

from sqlalchemy import delete, insert, select, text

from app.db.dialects.dialect import DeferReferences
from app.db.session import Session
from app.features.datasets.tables import (
    GroupModel,
    ImportFindingModel,
    StationModel,
    UnassignedFrameModel,
    ViewModel,
)
from app.features.findings.queries import SEEN, DismissalModel
from app.features.groups.queries import StoredGroup, read_groups
from app.features.groups.view_queries import StoredStation, stored_station
from app.features.queue.tables import QueueModel
from app.features.tables import Base
from app.features.verdicts.tables import VerdictModel

_BATCH = 500
Rows = Sequence[Mapping[str, Any]]


def all_stations(session: Session) -> Iterator[StoredStation]:
    """Every station."""
    rows = session.execute(select(*StationModel.__table__.columns))
    return map(stored_station, rows)


def all_groups(session: Session) -> Iterator[StoredGroup]:
    """Every group by id, in batches."""
    ids = session.scalars(select(GroupModel.id).order_by(GroupModel.id)).all()
    for start in range(0, len(ids), _BATCH):
        yield from read_groups(session, ids[start : start + _BATCH]).values()


def all_verdicts(session: Session) -> Iterator[dict[str, Any]]:
    """Every verdict as values by column but its id, oldest first."""
    return _all_rows(session, VerdictModel)


def all_dismissals(session: Session) -> Iterator[dict[str, Any]]:
    """Every dismissal of a finding in the same way."""
    return _all_rows(session, DismissalModel)


def _all_rows(
    session: Session, model: type[VerdictModel] | type[DismissalModel]
) -> Iterator[dict[str, Any]]:
    columns = [item for item in model.__table__.columns if item.name != "id"]
    for row in session.execute(select(*columns).order_by(model.id)):
        yield dict(row._mapping)


def all_unassigned(session: Session) -> Sequence[UnassignedFrameModel]:
    """The row of every unassigned frame."""
    return session.rows(UnassignedFrameModel, select(*UnassignedFrameModel.__table__.columns))


def all_import_findings(session: Session) -> Sequence[ImportFindingModel]:
    """The row of everything that imports noticed; what was computed or seen of pictures is not among it."""
    statement = select(*ImportFindingModel.__table__.columns)
    return session.rows(ImportFindingModel, statement.where(ImportFindingModel.kind.not_in(SEEN)))


def replace_all_rows(
    session: Session, *, stations: Rows, groups: Rows, views: Rows, noticed: Rows, unassigned: Rows
) -> None:
    """Put rows in the place of all stations, groups, views and what hangs on them.

    Datasets, verdicts, dismissals and solutions stay, and so do predictions and proposals of views that are
    there afterwards; the queue is the caller's to refresh.
    """
    # Solutions and verdicts refer to groups, which are gone for a moment.
    session.execute(DeferReferences())
    with _preserve_view_rows(session):
        for model in (QueueModel, ImportFindingModel, UnassignedFrameModel, ViewModel):
            session.execute(delete(model))
        session.execute(delete(GroupModel))
        session.execute(delete(StationModel))
        for table, rows in (
            (StationModel, stations),
            (GroupModel, groups),
            (ViewModel, views),
            (ImportFindingModel, noticed),
            (UnassignedFrameModel, unassigned),
        ):
            if rows:
                session.execute(insert(table), rows)


@contextmanager
def _preserve_view_rows(session: Session) -> Iterator[None]:
    """What goes with its view and is in no log comes back after this, where its view did."""
    for table in _tables_of_views():
        session.execute(text(f"CREATE TEMP TABLE kept_{table} AS SELECT * FROM {table}"))
    yield
    for table in _tables_of_views():
        session.execute(
            text(
                f"INSERT INTO {table} SELECT * FROM kept_{table}"
                " WHERE view_id IN (SELECT id FROM view)"
            )
        )
        session.execute(text(f"DROP TABLE kept_{table}"))


def _tables_of_views() -> list[str]:
    """Names of the tables whose rows are deleted with the view that they are about."""
    return [
        table.name
        for table in Base.metadata.sorted_tables
        if any(
            key.column.table is ViewModel.__table__ and key.ondelete == "CASCADE"
            for key in table.foreign_keys
        )
    ]
