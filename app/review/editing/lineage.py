"""Lineage: the states that a group (or static camera) went through, as the log tells them.

Two installations that edited the same group compare lineages: who stands in the other's past is
behind and can follow; two that are in nobody's past are in conflict.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field, replace
from typing import Any

from app.review.editing.ledger import Ledger, StationRecord
from app.review.editing.replay import apply_entry
from app.soccer.group import Group, Station, View
from app.soccer.pitch import Pitch
from app.store.codecs import (
    group_head_to_json,
    logged_camera,
    station_from_json,
    view_from_json,
)
from app.store.digest import digest, station_digest, view_digest
from app.store.groups import StoredGroup
from app.store.imports import shared_stations
from app.store.log import LogEntry, group_entries, groups_with_past, station_entries
from app.store.session import Session
from app.store.stations import StoredStation


@dataclass(frozen=True)
class Lineage:
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
class StationLineage:
    """Where a static camera comes from; as ``Lineage``."""

    base: Station
    states: tuple[str, ...]


def base_digest(group: Group) -> str:
    """Digest of what a dataset says about a group, without media and shared stations."""
    views = [
        [
            view_digest(view),
            view.station.key if view.station.shared else station_digest(view.station),
            view.extras.values(),
        ]
        for view in group.views
    ]
    return digest([group_head_to_json(group), views])


def pitch_size(pitch: Pitch) -> str:
    """The size of a pitch as lineages have it."""
    return f"{float(pitch.length)!r}x{float(pitch.width)!r}"


@dataclass
class _Walk:
    """One group's log on the way from its first entry to its last."""

    ledger: Ledger
    base: Group | None = None
    bases: dict[str, None] = field(default_factory=dict)
    views: dict[str, list[str]] = field(default_factory=dict)
    stations: dict[str, list[str]] = field(default_factory=dict)
    pitches: list[str] = field(default_factory=list)

    def take(self, entry: LogEntry, by_key: Mapping[str, Station]) -> None:
        assert entry.group_id is not None
        if entry.kind == "camera":
            self._camera(entry)
        apply_entry(self.ledger, entry)
        if entry.kind == "import":
            self.base = logged_group(entry.body["base"] or entry.body["group"], by_key)
        if self.base is not None:
            self.bases[base_digest(self.base)] = None
        self._note(self.ledger.group(entry.group_id))

    def _camera(self, entry: LogEntry) -> None:
        """A camera that came on its own is what the dataset brought, unless lines were edited."""
        assert entry.group_id is not None and entry.station_id is not None
        record = self.ledger.stations[entry.station_id]
        if self.base is None or station_digest(record.station) != record.source_digest:
            return
        items = self.ledger.groups[entry.group_id].views
        for item in (item for item in items if item.station_id == entry.station_id):
            view = self.base.view(item.view.key)
            if view is not None:
                station = view.station.with_given(*logged_camera(entry.body))
                self.base = self.base.with_view(replace(view, station=station))

    def _note(self, group: Group) -> None:
        _add(self.pitches, pitch_size(group.pitch))
        for view in group.views:
            _add(self.views.setdefault(view.key, []), view_digest(view))
            if not view.station.shared:
                _add(self.stations.setdefault(view.key, []), station_digest(view.station))


def _add(states: list[str], state: str) -> None:
    if not states or states[-1] != state:
        states.append(state)


class Lineages:
    """Lineages of the groups of one dataset, read in a session."""

    def __init__(self, session: Session, dataset_id: int):
        self._session, self._dataset_id = session, dataset_id
        self._shared = {item.id: item for item in shared_stations(session, dataset_id)}

    def of(self, groups: Iterable[StoredGroup]) -> dict[int, Lineage]:
        """Lineages by group id; what nobody touched since its import costs no look at it."""
        found = list(groups)
        touched = groups_with_past(self._session, [item.id for item in found])
        return {
            item.id: self._walked(item) if item.id in touched else _untouched(item)
            for item in found
        }

    def _walked(self, stored: StoredGroup) -> Lineage:
        ledger = Ledger()
        for number, item in self._shared.items():
            ledger.stations[number] = StationRecord(
                self._dataset_id, item.station, item.revision, item.source_digest
            )
        by_key = {item.station.key: item.station for item in self._shared.values()}
        walk = _Walk(ledger)
        for entry in group_entries(self._session, stored.id, verdicts=False):
            walk.take(entry, by_key)
        assert walk.base is not None
        return Lineage(
            base=walk.base,
            bases=tuple(walk.bases),
            views={key: tuple(states) for key, states in walk.views.items()},
            stations={key: tuple(states) for key, states in walk.stations.items()},
            pitches=tuple(walk.pitches),
        )


def _untouched(stored: StoredGroup) -> Lineage:
    group = stored.group
    return Lineage(
        base=group,
        bases=(base_digest(group),),
        views={view.key: (view_digest(view),) for view in group.views},
        stations={
            view.key: (station_digest(view.station),)
            for view in group.views
            if not view.station.shared
        },
        pitches=(pitch_size(group.pitch),),
    )


def station_lineage(session: Session, stored: StoredStation) -> StationLineage:
    """The lineage of a static camera."""
    ledger, base, states = Ledger(), stored.station, list[str]()
    for entry in station_entries(session, stored.id):
        known = ledger.stations.get(stored.id)
        unedited = known is None or station_digest(known.station) == known.source_digest
        apply_entry(ledger, entry)
        station = ledger.stations[stored.id].station
        if entry.kind == "station":
            base = station_from_json(entry.body["base"] or entry.body["station"])
        elif entry.kind == "camera" and unedited:
            base = station
        _add(states, station_digest(station))
    return StationLineage(base, tuple(states) or (stored.digest,))


def logged_group(value: Mapping[str, Any], shared: Mapping[str, Station]) -> Group:
    """A group from JSON in which a shared station is its key."""
    return Group(
        key=value["key"],
        views=tuple(_logged_view(view, shared) for view in value["views"]),
        match=value["match"],
        pitch=Pitch(*value["pitch"]),
        split=value["split"],
        label=value["label"],
    )


def _logged_view(value: Mapping[str, Any], shared: Mapping[str, Station]) -> View:
    said = value["station"]
    return view_from_json(value, shared[said] if isinstance(said, str) else None)
