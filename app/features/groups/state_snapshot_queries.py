"""State snapshot: everything that people and datasets said, as values, whether it comes from the log or the tables; and
the rows of the tables that the log can make anew, read whole and written whole.

``replay.replay_log`` makes one from the log, ``read_state_snapshot`` one from the tables; they are equal.
"""

from __future__ import annotations

from collections.abc import Collection, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field, replace
from typing import Any

from sqlalchemy import and_, delete, insert, or_, select, text

from app.db.dialects.dialect import DeferReferences, select_from_number_list
from app.db.json_columns import decompress_json
from app.db.session import Session
from app.errors import StorageError
from app.features.datasets.queries import list_dataset_rows, parse_stored_policy
from app.features.datasets.tables import (
    GroupChangeModel,
    GroupModel,
    ImportFindingModel,
    StationModel,
    UnassignedFrameModel,
    ViewModel,
)
from app.features.findings.queries import SEEN, DismissalModel
from app.features.groups.queries import StoredGroup, read_groups
from app.features.groups.view_queries import StoredStation, station_from_row
from app.features.queue.tables import QueueModel
from app.features.tables import Base
from app.features.verdicts.tables import VerdictModel
from app.soccer.annotation import Extras
from app.soccer.codec import extras_from_json, hash_group_inputs, paint_digests_to_json
from app.soccer.frames import ImageSize
from app.soccer.group import Group, Station, View
from app.soccer.policy import Policy
from app.wording import plural

_BATCH = 500
_MOST_NAMED = 10
Rows = Sequence[Mapping[str, Any]]


def iterate_stations(session: Session) -> Iterator[StoredStation]:
    """Every station."""
    rows = session.execute(select(*StationModel.__table__.columns))
    return map(station_from_row, rows)


def iterate_groups(session: Session) -> Iterator[StoredGroup]:
    """Every group by id, in batches."""
    ids = session.scalars(select(GroupModel.id).order_by(GroupModel.id)).all()
    for start in range(0, len(ids), _BATCH):
        yield from read_groups(session, ids[start : start + _BATCH]).values()


def iterate_verdicts(session: Session) -> Iterator[dict[str, Any]]:
    """Every verdict as values by column but its id, oldest first."""
    return _iterate_all_rows(session, VerdictModel)


def iterate_dismissals(session: Session) -> Iterator[dict[str, Any]]:
    """Every dismissal of a finding in the same way."""
    return _iterate_all_rows(session, DismissalModel)


def _iterate_all_rows(
    session: Session, model: type[VerdictModel] | type[DismissalModel]
) -> Iterator[dict[str, Any]]:
    columns = [item for item in model.__table__.columns if item.name != "id"]
    for row in session.execute(select(*columns).order_by(model.id)):
        yield dict(row._mapping)


def list_all_unassigned_frames(session: Session) -> Sequence[UnassignedFrameModel]:
    """The row of every unassigned frame."""
    return session.rows(UnassignedFrameModel, select(*UnassignedFrameModel.__table__.columns))


def list_all_import_findings(session: Session) -> Sequence[ImportFindingModel]:
    """The row of everything that imports noticed; what was computed or seen of pictures is not among it."""
    statement = select(*ImportFindingModel.__table__.columns)
    return session.rows(ImportFindingModel, statement.where(ImportFindingModel.kind.not_in(SEEN)))


def replace_all_rows(
    session: Session, *, stations: Rows, groups: Rows, views: Rows, noticed: Rows, unassigned: Rows
) -> list[str]:
    """Put rows in the place of all stations, groups, views and what imports noticed of them.

    Everything else stays where its groups and views are there afterwards, but for marks of changes, which
    triggers write anew; the queue is the caller's to refresh.

    Returns:
        Sentences: rows of which tables are left out, and of which groups or views that are no more.

    Raises:
        StorageError: Groups that are no more have solutions, verdicts or comments, which nothing may delete.
    """
    _require_groups_that_others_name(session, {row["id"] for row in groups})
    # Solutions and verdicts refer to groups, which are gone for a moment.
    session.execute(DeferReferences())
    noticed_by_imports = delete(ImportFindingModel).where(ImportFindingModel.kind.not_in(SEEN))
    with _preserve_dependent_rows(session) as left_out:
        session.execute(noticed_by_imports)
        for model in (QueueModel, UnassignedFrameModel, ViewModel):
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
    left_out.extend(_delete_lost_findings(session))
    return left_out


def _require_groups_that_others_name(session: Session, kept: Collection[int]) -> None:
    """Refuse to delete groups that rows name which stay without them."""
    gone = [number for number in session.scalars(select(GroupModel.id)) if number not in kept]
    if not gone:
        return
    replaced = {
        model.__table__
        for model in (ImportFindingModel, QueueModel, UnassignedFrameModel, ViewModel)
    }
    naming = [
        table.name
        for table in Base.metadata.sorted_tables
        if table not in replaced
        for key in table.foreign_keys
        if key.column.table is GroupModel.__table__
        and key.ondelete is None
        and session.scalar(
            select(key.parent).where(key.parent.in_(select_from_number_list(gone))).limit(1)
        )
    ]
    if naming:
        raise StorageError(
            f"the log does not have the groups {_name_some(gone)}, of which there are"
            f" rows in the tables {', '.join(naming)}; nothing was changed",
            hint="Restore a backup: touchline restore BACKUP.",
        )


@contextmanager
def _preserve_dependent_rows(session: Session) -> Iterator[list[str]]:
    """What goes with its group or view and is in no log comes back after this, where these did; yields
    the sentences about what does not, which are there afterwards."""
    dependent, left_out = _list_dependent_tables(), list[str]()
    for table in dependent:
        session.execute(text(f"CREATE TEMP TABLE kept_{table} AS SELECT * FROM {table}"))
    yield left_out
    for table, keys in dependent.items():
        for column, parent in keys:
            lost = text(
                f"DELETE FROM kept_{table} WHERE {column} NOT IN (SELECT id FROM {parent})"
                f" RETURNING {column}"
            )
            left_out.extend(_describe_lost_rows(table, parent, session.scalars(lost).all()))
        session.execute(text(f"INSERT INTO {table} SELECT * FROM kept_{table}"))
        session.execute(text(f"DROP TABLE kept_{table}"))


def _list_dependent_tables() -> dict[str, list[tuple[str, str]]]:
    """Names of the tables whose rows are deleted with the group or view that they are about, with the
    columns that name these and the tables of these."""
    gone, dependent = {"groups", "view"}, dict[str, list[tuple[str, str]]]()
    for table in Base.metadata.sorted_tables:
        keys = [
            (key.parent.name, key.column.table.name)
            for key in table.foreign_keys
            if key.column.table.name in gone and key.ondelete == "CASCADE"
        ]
        if keys and table is not GroupChangeModel.__table__:
            gone.add(table.name)
            dependent[table.name] = sorted(keys)
    return dependent


def _delete_lost_findings(session: Session) -> list[str]:
    """Delete what was computed or seen of groups and views that are no more."""
    model = ImportFindingModel
    views = select(ViewModel.id).where(
        ViewModel.group_id == model.group_id, ViewModel.key == model.view
    )
    there = select(GroupModel.id).where(GroupModel.id == model.group_id)
    lost = delete(model).where(
        model.kind.in_(SEEN),
        or_(~there.exists(), and_(model.view.is_not(None), ~views.exists())),
    )
    ids = session.scalars(lost.returning(model.group_id)).all()
    return _describe_lost_rows(model.__tablename__, "groups or views of groups", ids)


def _describe_lost_rows(table: str, of: str, ids: Sequence[int | None]) -> list[str]:
    if not ids:
        return []
    named = sorted({number for number in ids if number is not None})
    return [
        f"{plural(len(ids), 'row')} of the table {table} left out: the log does not have {of}"
        f" {_name_some(named)}"
    ]


def _name_some(ids: Sequence[int]) -> str:
    more = f" and {len(ids) - _MOST_NAMED:,} more" if len(ids) > _MOST_NAMED else ""
    return ", ".join(map(str, ids[:_MOST_NAMED])) + more


_ELSEWHERE = Station("", ImageSize(0, 0))
"""Stands in a view for the station that is kept under its id."""


@dataclass
class StationRecord:
    """A station with its count of revisions and what its dataset last brought."""

    dataset_id: int
    station: Station
    revision: int
    source_digest: str


@dataclass
class ViewRecord:
    """A view without its station, which ``station_id`` names."""

    id: int
    station_id: int
    view: View
    source_digest: str


@dataclass
class GroupRecord:
    """A group without its views, which follow in order.

    ``paint`` are the digests of what was read of their pictures; the log holds no more of it.
    """

    dataset_id: int
    number: int
    revision: int
    changed: str
    source_hash: str
    head: Group
    views: list[ViewRecord]
    paint: dict[str, str] = field(default_factory=dict)


@dataclass
class StateSnapshot:
    """The present state of what was said, by the ids of the database.

    Attributes:
        verdicts: By group, oldest first, as logged.
        dismissals: Of findings, in the same way.
        unassigned: By dataset, camera and frame.
        noticed: What imports noticed, by (group or None, station or None): pairs (view or None, sentence).
    """

    datasets: dict[int, tuple[str, Policy]] = field(default_factory=dict)
    stations: dict[int, StationRecord] = field(default_factory=dict)
    groups: dict[int, GroupRecord] = field(default_factory=dict)
    verdicts: dict[int, list[dict[str, Any]]] = field(default_factory=dict)
    dismissals: dict[int, list[dict[str, Any]]] = field(default_factory=dict)
    unassigned: dict[tuple[int, str, str], Extras] = field(default_factory=dict)
    noticed: dict[tuple[int | None, int | None], set[tuple[str | None, str]]] = field(
        default_factory=dict
    )

    def group(self, group_id: int) -> Group:
        """A group whole but for the paint of its pictures, with the stations as they are now."""
        record = self.groups[group_id]
        views = (
            replace(item.view, station=self.stations[item.station_id].station)
            for item in record.views
        )
        return replace(record.head, views=tuple(views))

    def inputs_hash(self, group_id: int) -> str:
        """Digest of everything that solving the group reads."""
        return hash_group_inputs(self.group(group_id), self.groups[group_id].paint)


def strip_station_from_view(view: View) -> View:
    """A view as a record holds it."""
    return replace(view, station=_ELSEWHERE)


def read_state_snapshot(session: Session) -> StateSnapshot:
    """The state snapshot as the tables have it."""
    snapshot = StateSnapshot()
    for row in list_dataset_rows(session):
        snapshot.datasets[row.id] = (row.name, parse_stored_policy(row.policy))
    for station in iterate_stations(session):
        snapshot.stations[station.id] = StationRecord(
            station.dataset_id, station.station, station.revision, station.source_digest
        )
    for group in iterate_groups(session):
        snapshot.groups[group.id] = _make_group_record(group)
    for values in iterate_verdicts(session):
        snapshot.verdicts.setdefault(values.pop("group_id"), []).append(values)
    for values in iterate_dismissals(session):
        snapshot.dismissals.setdefault(values.pop("group_id"), []).append(values)
    for unassigned in list_all_unassigned_frames(session):
        place = (unassigned.dataset_id, unassigned.camera, unassigned.frame)
        snapshot.unassigned[place] = extras_from_json(decompress_json(unassigned.extras))
    for noticed in list_all_import_findings(session):
        of_place = snapshot.noticed.setdefault((noticed.group_id, noticed.station_id), set())
        of_place.add((noticed.view, noticed.sentence))
    return snapshot


def _make_group_record(stored: StoredGroup) -> GroupRecord:
    views = [
        ViewRecord(
            stored.view_ids[view.key],
            stored.stations[view.key].id,
            strip_station_from_view(view),
            stored.view_digests[view.key][1],
        )
        for view in stored.group.views
    ]
    return GroupRecord(
        dataset_id=stored.dataset_id,
        number=stored.number,
        revision=stored.revision,
        changed=stored.changed,
        source_hash=stored.source_hash,
        head=replace(stored.group, views=(), paint={}),
        views=views,
        paint=paint_digests_to_json(stored.group.paint),
    )
