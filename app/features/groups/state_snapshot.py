"""Ledger: everything that was said, as values, whether it comes from the log or the tables.

``replay.replay_log`` makes one from the log, ``read_state_snapshot`` one from the tables; they are equal.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import Any

from app.db.json_columns import unpack
from app.db.session import Session
from app.features.datasets.queries import dataset_rows, policy_from_row
from app.features.groups.projection_queries import (
    all_dismissals,
    all_groups,
    all_import_findings,
    all_stations,
    all_unassigned,
    all_verdicts,
)
from app.features.groups.queries import StoredGroup
from app.soccer.annotation import Extras
from app.soccer.codec import extras_from_json, group_inputs_hash, paint_to_json
from app.soccer.frames import ImageSize
from app.soccer.group import Group, Station, View
from app.soccer.policy import Policy

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
        noticed: What imports noticed: (group or None, station or None, view, sentence).
    """

    datasets: dict[int, tuple[str, Policy]] = field(default_factory=dict)
    stations: dict[int, StationRecord] = field(default_factory=dict)
    groups: dict[int, GroupRecord] = field(default_factory=dict)
    verdicts: dict[int, list[dict[str, Any]]] = field(default_factory=dict)
    dismissals: dict[int, list[dict[str, Any]]] = field(default_factory=dict)
    unassigned: dict[tuple[int, str, str], Extras] = field(default_factory=dict)
    noticed: set[tuple[int | None, int | None, str | None, str]] = field(default_factory=set)

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
        return group_inputs_hash(self.group(group_id), self.groups[group_id].paint)


def without_station(view: View) -> View:
    """A view as a record holds it."""
    return replace(view, station=_ELSEWHERE)


def read_state_snapshot(session: Session) -> StateSnapshot:
    """The state snapshot as the tables have it."""
    snapshot = StateSnapshot()
    for row in dataset_rows(session):
        snapshot.datasets[row.id] = (row.name, policy_from_row(row.policy))
    for station in all_stations(session):
        snapshot.stations[station.id] = StationRecord(
            station.dataset_id, station.station, station.revision, station.source_digest
        )
    for group in all_groups(session):
        snapshot.groups[group.id] = _group_record(group)
    for values in all_verdicts(session):
        snapshot.verdicts.setdefault(values.pop("group_id"), []).append(values)
    for values in all_dismissals(session):
        snapshot.dismissals.setdefault(values.pop("group_id"), []).append(values)
    for unassigned in all_unassigned(session):
        place = (unassigned.dataset_id, unassigned.camera, unassigned.frame)
        snapshot.unassigned[place] = extras_from_json(unpack(unassigned.extras))
    for noticed in all_import_findings(session):
        snapshot.noticed.add((noticed.group_id, noticed.station_id, noticed.view, noticed.sentence))
    return snapshot


def _group_record(stored: StoredGroup) -> GroupRecord:
    views = [
        ViewRecord(
            stored.view_ids[view.key],
            stored.stations[view.key].id,
            without_station(view),
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
        paint=paint_to_json(stored.group.paint),
    )
