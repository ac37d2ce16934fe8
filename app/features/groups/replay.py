"""Replay: everything that was said, rebuilt from the log alone, and the tables from that."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Mapping
from dataclasses import replace
from typing import Any

from app.db.home_paths import find_stored_path
from app.db.json_columns import compress_json
from app.db.log import LogEntry, read_log, verify_chain
from app.db.session import Session
from app.db.store import Store
from app.features.findings.queries import DISMISSAL
from app.features.groups.edit_codec import edit_from_json, station_edit_from_json
from app.features.groups.insert_queries import group_to_columns, station_to_columns, view_to_columns
from app.features.groups.reimport import KIND
from app.features.groups.state_snapshot_queries import (
    GroupRecord,
    StateSnapshot,
    StationRecord,
    ViewRecord,
    replace_all_rows,
    strip_station_from_view,
)
from app.features.match_estimates.queries import NOISE, POSITION
from app.features.paint.queries import PAINT
from app.features.pitches.queries import PITCH
from app.features.queue.refresh_queries import refresh_queue
from app.soccer.codec import (
    camera_from_log_entry,
    extras_from_json,
    policy_from_json,
    positions_from_json,
    station_digest,
    station_from_json,
    view_digest,
    view_from_json,
)
from app.soccer.group import Group, Station
from app.soccer.pitch import Pitch


def replay_log(session: Session) -> StateSnapshot:
    """The state snapshot that follows from the log, whose chain is verified first.

    Raises:
        StorageError: The log is not what was written.
    """
    verify_chain(session)
    snapshot, numbers = StateSnapshot(), Counter[int]()
    for entry in read_log(session):
        assert entry.kind != "import" or entry.dataset_id is not None
        if entry.kind == "import" and entry.group_id not in snapshot.groups:
            numbers[entry.dataset_id or 0] += 1
        apply_entry(snapshot, entry, numbers[entry.dataset_id or 0])
    for record in snapshot.groups.values():
        for item in record.views:
            if item.view.media is not None:
                path = find_stored_path(session, item.view.media.path)
                item.view = replace(item.view, media=replace(item.view.media, path=path))
    return snapshot


def apply_entry(snapshot: StateSnapshot, entry: LogEntry, number: int = 0) -> None:
    """Bring one entry of the log into the state snapshot; ``number`` is that of a group that is new."""
    if entry.kind == "import" and entry.group_id not in snapshot.groups:
        _replay_new_group(snapshot, entry, number)
    else:
        _STEPS[entry.kind](snapshot, entry)


def rebuild_tables(store: Store) -> list[str]:
    """Write groups, views, stations and what imports noticed of them anew from the log.

    Everything else stays as far as its groups and views do. Returns sentences about the rows of other
    tables that do not: ``replace_all_rows``.
    """
    with store.write() as session:
        snapshot = replay_log(session)
        left_out = replace_all_rows(session, **_build_rows_by_table(snapshot))
        refresh_queue(session, list(snapshot.groups))
    return left_out


def _replay_dataset(snapshot: StateSnapshot, entry: LogEntry) -> None:
    assert entry.dataset_id is not None
    policy = policy_from_json(entry.body["policy"])
    snapshot.datasets[entry.dataset_id] = (entry.body["name"], policy)


def _replay_policy(snapshot: StateSnapshot, entry: LogEntry) -> None:
    assert entry.dataset_id is not None
    name, _ = snapshot.datasets[entry.dataset_id]
    snapshot.datasets[entry.dataset_id] = (name, policy_from_json(entry.body["policy"]))


def _replay_station_import(snapshot: StateSnapshot, entry: LogEntry) -> None:
    assert entry.station_id is not None and entry.dataset_id is not None
    station, base = entry.body["station"], entry.body["base"]
    _save_station(
        snapshot,
        entry.dataset_id,
        entry.station_id,
        station_from_json(station),
        station_from_json(station if base is None else base),
    )
    _replay_import_findings(snapshot, None, entry.station_id, [[None, entry.body["kept"]]])


def _save_station(
    snapshot: StateSnapshot,
    dataset_id: int,
    station_id: int,
    station: Station,
    base: Station | None,
) -> None:
    old = snapshot.stations.get(station_id)
    digest = station_digest(base) if base is not None else (old.source_digest if old else "")
    revision = old.revision + 1 if old else 1
    snapshot.stations[station_id] = StationRecord(dataset_id, station, revision, digest)


def _replay_new_group(snapshot: StateSnapshot, entry: LogEntry, number: int) -> None:
    assert entry.group_id is not None and entry.dataset_id is not None
    snapshot.groups[entry.group_id] = GroupRecord(
        entry.dataset_id, number, 0, "", "", Group("", ()), []
    )
    _replay_group_import(snapshot, entry)


def _replay_group_import(snapshot: StateSnapshot, entry: LogEntry) -> None:
    assert entry.group_id is not None
    record, body = snapshot.groups[entry.group_id], entry.body
    base = {view["key"]: view for view in (body["base"] or body["group"])["views"]}
    gone = {item.station_id for item in record.views}
    record.views = []
    for value in body["group"]["views"]:
        view_id, station_id = body["ids"][value["key"]]
        gone.discard(station_id)
        item = _replay_imported_view(snapshot, record, value, base[value["key"]], station_id)
        record.views.append(replace(item, id=view_id))
    for station_id in gone:
        if not snapshot.stations[station_id].station.shared:
            del snapshot.stations[station_id]
    record.head, record.paint = (
        _parse_group_without_views(body["group"]),
        dict(body["group"].get("paint", {})),
    )
    record.source_hash = body["source_hash"]
    record.revision, record.changed = record.revision + 1, entry.at
    _replay_import_findings(snapshot, entry.group_id, None, body.get("kept", []))


def _replay_imported_view(
    snapshot: StateSnapshot,
    record: GroupRecord,
    value: Mapping[str, Any],
    base: Mapping[str, Any],
    station_id: int,
) -> ViewRecord:
    shared = isinstance(value["station"], str)
    if not shared:
        own, source = station_from_json(value["station"]), station_from_json(base["station"])
        _save_station(snapshot, record.dataset_id, station_id, own, source)
    station = snapshot.stations[station_id].station
    source_digest = view_digest(view_from_json(base, station))
    return ViewRecord(
        0, station_id, strip_station_from_view(view_from_json(value, station)), source_digest
    )


def _parse_group_without_views(value: Mapping[str, Any]) -> Group:
    return Group(
        key=value["key"],
        views=(),
        match=value["match"],
        pitch=Pitch(*value["pitch"]),
        split=value["split"],
        label=value["label"],
        positions=positions_from_json(value.get("positions")),
    )


def _replay_edit(snapshot: StateSnapshot, entry: LogEntry) -> None:
    assert entry.group_id is not None
    record, group = snapshot.groups[entry.group_id], snapshot.group(entry.group_id)
    changed = edit_from_json(entry.body["edit"]).apply(group)
    for item, before, after in zip(record.views, group.views, changed.views, strict=True):
        item.view = strip_station_from_view(after)
        if after.station != before.station:
            _save_station(snapshot, record.dataset_id, item.station_id, after.station, None)
    record.head = replace(record.head, pitch=changed.pitch, positions=changed.positions)
    record.revision, record.changed = record.revision + 1, entry.at


def _replay_noise(snapshot: StateSnapshot, entry: LogEntry) -> None:
    # What is accepted for a dataset changes none of its groups by itself.
    if entry.group_id is not None:
        _replay_edit(snapshot, entry)


def _replay_paint(snapshot: StateSnapshot, entry: LogEntry) -> None:
    assert entry.group_id is not None
    record = snapshot.groups[entry.group_id]
    record.paint = dict(entry.body["edit"]["paint"])
    record.revision, record.changed = record.revision + 1, entry.at


def _replay_station_edit(snapshot: StateSnapshot, entry: LogEntry) -> None:
    assert entry.station_id is not None
    record = snapshot.stations[entry.station_id]
    station = station_edit_from_json(entry.body["edit"]).apply(record.station)
    _save_station(snapshot, record.dataset_id, entry.station_id, station, None)


def _replay_given_camera(snapshot: StateSnapshot, entry: LogEntry) -> None:
    assert entry.station_id is not None
    record = snapshot.stations[entry.station_id]
    edited = station_digest(record.station) != record.source_digest
    station = record.station.with_given_camera(*camera_from_log_entry(entry.body))
    base = None if edited else station
    _save_station(snapshot, record.dataset_id, entry.station_id, station, base)
    if entry.group_id is not None:
        group = snapshot.groups[entry.group_id]
        group.revision, group.changed = group.revision + 1, entry.at


def _replay_verdict(snapshot: StateSnapshot, entry: LogEntry) -> None:
    assert entry.group_id is not None
    snapshot.verdicts.setdefault(entry.group_id, []).append(dict(entry.body))


def _replay_dismissal(snapshot: StateSnapshot, entry: LogEntry) -> None:
    assert entry.group_id is not None
    # One that was brought from elsewhere says itself whose it is.
    dismissal = {"actor": entry.actor, "at": entry.at, **entry.body}
    snapshot.dismissals.setdefault(entry.group_id, []).append(dismissal)


def _replay_dataset_deletion(snapshot: StateSnapshot, entry: LogEntry) -> None:
    """Everything of the dataset goes; its entries before this one still tell what it was."""
    gone = entry.dataset_id
    assert gone is not None
    del snapshot.datasets[gone]
    groups = {key for key, record in snapshot.groups.items() if record.dataset_id == gone}
    stations = {key for key, record in snapshot.stations.items() if record.dataset_id == gone}
    for key in groups:
        del snapshot.groups[key]
        snapshot.verdicts.pop(key, None)
        snapshot.dismissals.pop(key, None)
    for key in stations:
        del snapshot.stations[key]
    for place in [place for place in snapshot.unassigned if place[0] == gone]:
        del snapshot.unassigned[place]
    snapshot.noticed = {
        place: said
        for place, said in snapshot.noticed.items()
        if place[0] not in groups and place[1] not in stations
    }


def _replay_unassigned_frames(snapshot: StateSnapshot, entry: LogEntry) -> None:
    assert entry.dataset_id is not None
    for camera, frame, extras in entry.body["frames"]:
        snapshot.unassigned[entry.dataset_id, camera, frame] = extras_from_json(extras)


def _replay_import_findings(
    snapshot: StateSnapshot,
    group_id: int | None,
    station_id: int | None,
    kept: list[list[str | None]],
) -> None:
    """Each import replaces what the ones before it noticed in the same place."""
    said = {(view, sentence) for view, sentence in kept if sentence is not None}
    snapshot.noticed.pop((group_id, station_id), None)
    if said:
        snapshot.noticed[group_id, station_id] = said


def _build_rows_by_table(snapshot: StateSnapshot) -> dict[str, list[dict[str, Any]]]:
    """Rows of the tables, as ``replace_all_rows`` takes them."""
    stations = [
        {
            **station_to_columns(item.station),
            "id": key,
            "dataset_id": item.dataset_id,
            "revision": item.revision,
            "source_digest": item.source_digest,
        }
        for key, item in snapshot.stations.items()
    ]
    views = [
        {
            **view_to_columns(item.view, place),
            "id": item.id,
            "group_id": key,
            "station_id": item.station_id,
            "source_digest": item.source_digest,
        }
        for key, record in snapshot.groups.items()
        for place, item in enumerate(record.views)
    ]
    noticed = [
        {"group_id": group, "station_id": station, "view": view, "kind": KIND, "sentence": sentence}
        for group, station, view, sentence in sorted(
            ((*place, *item) for place, said in snapshot.noticed.items() for item in said), key=repr
        )
    ]
    unassigned = [
        {
            "dataset_id": key[0],
            "camera": key[1],
            "frame": key[2],
            "extras": compress_json(extras.to_plain_values()),
        }
        for key, extras in snapshot.unassigned.items()
    ]
    groups = [_build_group_row(snapshot, key) for key in snapshot.groups]
    return {
        "stations": stations,
        "groups": groups,
        "views": views,
        "noticed": noticed,
        "unassigned": unassigned,
    }


def _build_group_row(snapshot: StateSnapshot, group_id: int) -> dict[str, Any]:
    record = snapshot.groups[group_id]
    return {
        **group_to_columns(snapshot.group(group_id), record.paint),
        "id": group_id,
        "dataset_id": record.dataset_id,
        "number": record.number,
        "revision": record.revision,
        "changed": record.changed,
        "source_hash": record.source_hash,
    }


_STEPS: dict[str, Callable[[StateSnapshot, LogEntry], None]] = {
    "dataset": _replay_dataset,
    "dataset_deleted": _replay_dataset_deletion,
    "policy": _replay_policy,
    "station": _replay_station_import,
    "import": _replay_group_import,
    "edit": _replay_edit,
    "undo": _replay_edit,
    "redo": _replay_edit,
    PITCH: _replay_edit,
    POSITION: _replay_edit,
    NOISE: _replay_noise,
    PAINT: _replay_paint,
    "station_edit": _replay_station_edit,
    "station_undo": _replay_station_edit,
    "station_redo": _replay_station_edit,
    "camera": _replay_given_camera,
    "verdict": _replay_verdict,
    DISMISSAL: _replay_dismissal,
    "spare": _replay_unassigned_frames,
    # What a batch did stands in the verdicts themselves.
    "verdict_batch": lambda _snapshot, _entry: None,
    "verdict_batch_undo": lambda _snapshot, _entry: None,
    # Versions have tables of their own, which nothing rebuilds and nothing changes.
    "freeze": lambda _snapshot, _entry: None,
    # What was taken over from a person's own annotation stands in the edits and the verdict.
    "take": lambda _snapshot, _entry: None,
    "agreement": lambda _snapshot, _entry: None,
    # Gold groups, guidelines, comments, accounts and work that is given out have tables of their own.
    "gold": lambda _snapshot, _entry: None,
    "guideline": lambda _snapshot, _entry: None,
    "comment": lambda _snapshot, _entry: None,
    # Jobs and other deeds change nothing that was said.
    "job": lambda _snapshot, _entry: None,
    "deed": lambda _snapshot, _entry: None,
    "person": lambda _snapshot, _entry: None,
    "work": lambda _snapshot, _entry: None,
}
