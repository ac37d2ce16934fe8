"""History of a group: its entries in the log with what each changed."""

from __future__ import annotations

import heapq
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, replace

from app.db.log import LogEntry as LogEntry
from app.db.log import list_group_entries, list_station_entries
from app.db.session import Session
from app.db.store import Store
from app.errors import NotFoundError
from app.features.groups.queries import StoredGroup
from app.features.groups.replay import apply_entry
from app.features.groups.state import require_group
from app.features.groups.state_snapshot_queries import StateSnapshot, StationRecord
from app.features.groups.view_queries import StoredStation
from app.features.people.visibility_queries import (
    COPIES,
    hides_groups_from_reader,
    sees_independent_work,
    show_entries_under_aliases,
)
from app.soccer.group import Group, Station, View
from app.soccer.pitch import Pitch

STATION_EDITS = ("station_edit", "station_undo", "station_redo")
"""Kinds of entries in which somebody changed a static camera, and with it all its groups."""
ABOUT_COPIES = frozenset({"take", "agreement"})
"""Kinds of entries that say what people made of a group independently."""


@dataclass(frozen=True)
class ChangedView:
    """A view before an entry and after it; None where it was not there.

    Attributes:
        id: Of the view as it is now; None where it is gone.
        index: Its place among the views, from 0.
    """

    key: str
    id: int | None
    index: int
    before: View | None
    after: View | None


@dataclass(frozen=True)
class EntryChanges:
    """What an entry has changed of a group: the views that differ, and the pitch.

    ``first`` says that there was nothing before it.
    """

    entry: LogEntry
    views: tuple[ChangedView, ...]
    pitch_before: Pitch | None
    pitch_after: Pitch
    first: bool


def read_history(store: Store, group_id: int) -> list[LogEntry]:
    """Everything that was said about a group and changed of its static cameras, oldest first.

    Whoever annotates blind is told the places of entries in it instead of their ids.

    Raises:
        NotFoundError: There is no such group.
    """
    with store.read() as session:
        stored = require_group(session, group_id)
        entries = _show_entries(session, stored, _read_group_history(session, stored))
        if not hides_groups_from_reader():
            return entries
        return [replace(entry, id=place) for place, entry in enumerate(entries, start=1)]


def read_entry_changes(store: Store, group_id: int, entry_id: int) -> EntryChanges:
    """What one entry has changed of a group, found by saying everything again up to it.

    Raises:
        NotFoundError: There is no such group, or no such entry of it.
    """
    with store.read() as session:
        stored = require_group(session, group_id)
        if hides_groups_from_reader():
            place, entries = entry_id - 1, _read_group_history(session, stored)
            entry_id = entries[place].id if place < len(entries) else 0
        snapshot = _make_static_camera_snapshot(stored)
        before: Group | None = None
        for entry in _merge_group_and_station_entries(session, stored):
            known = group_id in snapshot.groups
            if entry.id == entry_id:
                before = snapshot.group(group_id) if known else None
            apply_entry(snapshot, entry)
            if entry.id == entry_id and group_id in snapshot.groups:
                (shown,) = _show_entries(session, stored, [entry])
                return _compare_group_versions(
                    shown, before, snapshot.group(group_id), stored.view_ids
                )
    raise NotFoundError(f"group {group_id} has no entry {entry_id}")


def read_group_before_entry(session: Session, stored: StoredGroup, entry_id: int) -> Group:
    """A group as it was before an entry of the log, but for the paint of its pictures."""
    snapshot = _make_static_camera_snapshot(stored)
    for entry in _merge_group_and_station_entries(session, stored):
        if entry.id >= entry_id:
            break
        apply_entry(snapshot, entry)
    return snapshot.group(stored.id)


def read_station_before_entry(session: Session, stored: StoredStation, entry_id: int) -> Station:
    """A static camera as it was before an entry of the log."""
    snapshot = StateSnapshot()
    _add_station_to_snapshot(snapshot, stored)
    for entry in list_station_entries(session, stored.id):
        if entry.id >= entry_id:
            break
        apply_entry(snapshot, entry)
    return snapshot.stations[stored.id].station


def _show_entries(
    session: Session, stored: StoredGroup, entries: Iterable[LogEntry]
) -> list[LogEntry]:
    """Entries as whoever asks may read them."""
    shown = show_entries_under_aliases(session, entries)
    if stored.dataset_id > COPIES or sees_independent_work(stored.dataset_id):
        return shown
    # Whose annotations there are, and whether they agree, annotators are not to know.
    return [replace(entry, body=None) if entry.kind in ABOUT_COPIES else entry for entry in shown]


def _read_group_history(session: Session, stored: StoredGroup) -> list[LogEntry]:
    """The entries of a group's history."""
    entries = list(_merge_group_and_station_entries(session, stored))
    first = next(entry.id for entry in entries if entry.group_id is not None)
    return [
        entry
        for entry in entries
        if entry.group_id is not None or (entry.kind in STATION_EDITS and entry.id > first)
    ]


def _merge_group_and_station_entries(session: Session, stored: StoredGroup) -> Iterator[LogEntry]:
    shared = [
        list_station_entries(session, item.id)
        for item in stored.stations.values()
        if item.station.shared
    ]
    return heapq.merge(list_group_entries(session, stored.id), *shared, key=lambda entry: entry.id)


def _make_static_camera_snapshot(stored: StoredGroup) -> StateSnapshot:
    """A state snapshot of the static cameras alone, as they are now; their own entries tell what they were."""
    snapshot = StateSnapshot()
    for item in stored.stations.values():
        if item.station.shared:
            _add_station_to_snapshot(snapshot, item)
    return snapshot


def _add_station_to_snapshot(snapshot: StateSnapshot, stored: StoredStation) -> None:
    snapshot.stations[stored.id] = StationRecord(
        stored.dataset_id, stored.station, stored.revision, stored.source_digest
    )


def _compare_group_versions(
    entry: LogEntry, before: Group | None, after: Group, view_ids: Mapping[str, int]
) -> EntryChanges:
    old = {} if before is None else {view.key: view for view in before.views}
    new = {view.key: view for view in after.views}
    keys = list(dict.fromkeys([*new, *old]))
    changed = tuple(
        ChangedView(key, view_ids.get(key), index, old.get(key), new.get(key))
        for index, key in enumerate(keys)
        if old.get(key) != new.get(key)
    )
    pitch = None if before is None else before.pitch
    return EntryChanges(entry, changed, pitch, after.pitch, before is None)
