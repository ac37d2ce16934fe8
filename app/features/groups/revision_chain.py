"""Revision chain: the digests of the states that a group or station went through, for merges between installations."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field, replace
from typing import Any

from app.db.log import (
    LogEntry,
    filter_groups_with_history,
    list_group_entries,
    list_station_entries,
)
from app.db.session import Session
from app.features.groups.queries import StoredGroup
from app.features.groups.replay import apply_entry
from app.features.groups.state_snapshot_queries import StateSnapshot, StationRecord
from app.features.groups.view_queries import StoredStation
from app.features.imports.queries import list_shared_stations
from app.soccer.codec import (
    camera_from_log_entry,
    digest_json,
    group_without_views_to_json,
    station_digest,
    station_from_json,
    view_digest,
    view_from_json,
)
from app.soccer.group import Group, Station, View
from app.soccer.pitch import Pitch


@dataclass(frozen=True)
class RevisionChain:
    """Where a group comes from.

    Attributes:
        base: The group as its dataset last brought it.
        bases: Digests of everything that its dataset brought, oldest first.
        views: Digests of the states of each view, oldest first; the last is the present one, and
            one that came back stands there again.
        stations: The same of the stations that views have for themselves, by view.
        pitches: The same of its pitch, as the sizes themselves.
    """

    base: Group
    bases: tuple[str, ...]
    views: Mapping[str, tuple[str, ...]]
    stations: Mapping[str, tuple[str, ...]]
    pitches: tuple[str, ...]


@dataclass(frozen=True)
class StationRevisionChain:
    """Where a static camera comes from; as ``RevisionChain``."""

    base: Station
    states: tuple[str, ...]


def digest_imported_group(group: Group) -> str:
    """Digest of what a dataset says about a group, without media and shared stations."""
    views = [
        [
            view_digest(view),
            view.station.key if view.station.shared else station_digest(view.station),
            view.extras.to_plain_values(),
        ]
        for view in group.views
    ]
    return digest_json([group_without_views_to_json(group), views])


def format_pitch_size(pitch: Pitch) -> str:
    """The size of a pitch as revision chains have it."""
    return f"{float(pitch.length)!r}x{float(pitch.width)!r}"


@dataclass
class _GroupLogReplay:
    """One group's log on the way from its first entry to its last."""

    snapshot: StateSnapshot
    base: Group | None = None
    bases: dict[str, None] = field(default_factory=dict)
    views: dict[str, list[str]] = field(default_factory=dict)
    stations: dict[str, list[str]] = field(default_factory=dict)
    pitches: list[str] = field(default_factory=list)

    def add_entry(self, entry: LogEntry, by_key: Mapping[str, Station]) -> None:
        assert entry.group_id is not None
        if entry.kind == "camera":
            self._add_camera(entry)
        apply_entry(self.snapshot, entry)
        if entry.kind == "import":
            self.base = parse_logged_group(entry.body["base"] or entry.body["group"], by_key)
        if self.base is not None:
            self.bases[digest_imported_group(self.base)] = None
        self._record_states(self.snapshot.group(entry.group_id))

    def _add_camera(self, entry: LogEntry) -> None:
        """A camera that came on its own is what the dataset brought, unless lines were edited."""
        assert entry.group_id is not None and entry.station_id is not None
        record = self.snapshot.stations[entry.station_id]
        if self.base is None or station_digest(record.station) != record.source_digest:
            return
        items = self.snapshot.groups[entry.group_id].views
        for item in (item for item in items if item.station_id == entry.station_id):
            view = self.base.view(item.view.key)
            if view is not None:
                station = view.station.with_given_camera(*camera_from_log_entry(entry.body))
                self.base = self.base.with_view(replace(view, station=station))

    def _record_states(self, group: Group) -> None:
        _append_if_new(self.pitches, format_pitch_size(group.pitch))
        for view in group.views:
            _append_if_new(self.views.setdefault(view.key, []), view_digest(view))
            if not view.station.shared:
                _append_if_new(self.stations.setdefault(view.key, []), station_digest(view.station))


def _append_if_new(states: list[str], state: str) -> None:
    if not states or states[-1] != state:
        states.append(state)


class RevisionChains:
    """Lineages of the groups of one dataset, read in a session."""

    def __init__(self, session: Session, dataset_id: int):
        self._session, self._dataset_id = session, dataset_id
        self._shared = {item.id: item for item in list_shared_stations(session, dataset_id)}

    def read_chains_by_group_id(self, groups: Iterable[StoredGroup]) -> dict[int, RevisionChain]:
        """Lineages by group id; what nobody touched since its import costs no look at it."""
        found = list(groups)
        touched = filter_groups_with_history(self._session, [item.id for item in found])
        return {
            item.id: self._build_chain_from_log(item)
            if item.id in touched
            else _build_chain_of_unedited_group(item)
            for item in found
        }

    def _build_chain_from_log(self, stored: StoredGroup) -> RevisionChain:
        snapshot = StateSnapshot()
        for number, item in self._shared.items():
            snapshot.stations[number] = StationRecord(
                self._dataset_id, item.station, item.revision, item.source_digest
            )
        by_key = {item.station.key: item.station for item in self._shared.values()}
        walk = _GroupLogReplay(snapshot)
        for entry in list_group_entries(self._session, stored.id, verdicts=False):
            walk.add_entry(entry, by_key)
        assert walk.base is not None
        return RevisionChain(
            base=walk.base,
            bases=tuple(walk.bases),
            views={key: tuple(states) for key, states in walk.views.items()},
            stations={key: tuple(states) for key, states in walk.stations.items()},
            pitches=tuple(walk.pitches),
        )


def _build_chain_of_unedited_group(stored: StoredGroup) -> RevisionChain:
    group = stored.group
    return RevisionChain(
        base=group,
        bases=(digest_imported_group(group),),
        views={view.key: (view_digest(view),) for view in group.views},
        stations={
            view.key: (station_digest(view.station),)
            for view in group.views
            if not view.station.shared
        },
        pitches=(format_pitch_size(group.pitch),),
    )


def read_station_revision_chain(session: Session, stored: StoredStation) -> StationRevisionChain:
    """The revision chain of a static camera."""
    snapshot, base, states = StateSnapshot(), stored.station, list[str]()
    for entry in list_station_entries(session, stored.id):
        known = snapshot.stations.get(stored.id)
        unedited = known is None or station_digest(known.station) == known.source_digest
        apply_entry(snapshot, entry)
        station = snapshot.stations[stored.id].station
        if entry.kind == "station":
            base = station_from_json(entry.body["base"] or entry.body["station"])
        elif entry.kind == "camera" and unedited:
            base = station
        _append_if_new(states, station_digest(station))
    return StationRevisionChain(base, tuple(states) or (stored.digest,))


def parse_logged_group(value: Mapping[str, Any], shared: Mapping[str, Station]) -> Group:
    """A group from JSON in which a shared station is its key."""
    return Group(
        key=value["key"],
        views=tuple(_parse_logged_view(view, shared) for view in value["views"]),
        match=value["match"],
        pitch=Pitch(*value["pitch"]),
        split=value["split"],
        label=value["label"],
    )


def _parse_logged_view(value: Mapping[str, Any], shared: Mapping[str, Station]) -> View:
    station = value["station"]
    return view_from_json(value, shared[station] if isinstance(station, str) else None)
