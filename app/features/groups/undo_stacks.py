"""What can be undone and redone of a group or station, from the states that the log tells of."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

from app.db.json_columns import Json
from app.db.log import (
    LogEntry,
    filter_groups_with_history,
    list_group_entries,
    list_group_steps,
    list_newest_steps,
    list_station_entries,
    list_station_steps,
    read_entry,
)
from app.db.session import Session
from app.errors import ConflictError
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

GROUP_KINDS = {"edit": "edit", "undo": "undo", "redo": "redo"}
STATION_KINDS = {"station_edit": "edit", "station_undo": "undo", "station_redo": "redo"}

_FIRST_LOOK, _FURTHER = 8, 8
"""Steps that are read of a group's history at first, and how many times more when they say too little."""


@dataclass(frozen=True)
class UndoStacks:
    """Ids of log entries: the last of ``done`` is what undo takes back, of ``undone`` what redo
    does again. Of a long history ``done`` may hold the newest alone, and then at least two."""

    done: tuple[int, ...] = ()
    undone: tuple[int, ...] = ()

    @property
    def can_undo(self) -> bool:
        """Whether there is an edit to take back."""
        return bool(self.done)

    @property
    def can_redo(self) -> bool:
        """Whether there is an edit to do again."""
        return bool(self.undone)

    def push_entry(self, kind: str, log_id: int = 0) -> UndoStacks:
        """The stacks after one more entry: an undo moves the last edit over, a redo moves it
        back, and a fresh edit clears what was undone."""
        if kind == "edit":
            return UndoStacks((*self.done, log_id))
        if kind == "undo":
            return UndoStacks(self.done[:-1], (*self.undone, self.done[-1]))
        return UndoStacks((*self.done, self.undone[-1]), self.undone[:-1])


def make_undo_entry_body(session: Session, stacks: UndoStacks, kind: str, where: str) -> Json:
    """Body of the entry that an undo or a redo writes: the edit that it makes, and back.

    Args:
        session: Any session.
        stacks: Of the group or station.
        kind: ``undo`` or ``redo``.
        where: What it is asked for, as people call it.

    Raises:
        ConflictError: There is nothing to undo, or to do again.
    """
    steps = stacks.done if kind == "undo" else stacks.undone
    if not steps:
        raise ConflictError(f"there is nothing to {kind} {where}")
    body = read_entry(session, steps[-1]).body
    made, back = ("inverse", "edit") if kind == "undo" else ("edit", "inverse")
    return {"edit": body[made], "inverse": body[back], "of": steps[-1]}


def read_stacks(session: Session, group_ids: Sequence[int]) -> Mapping[int, UndoStacks]:
    """The stacks of each group."""
    if len(group_ids) == 1:
        return {group_ids[0]: _read_stacks_from_newest_steps(session, group_ids[0])}
    steps: dict[int, list[tuple[str, int]]] = {number: [] for number in group_ids}
    for row in list_group_steps(session, group_ids, GROUP_KINDS):
        steps[row.group_id].append((GROUP_KINDS[row.kind], row.id))
    return {number: _build_stacks(taken) for number, taken in steps.items()}


def _read_stacks_from_newest_steps(session: Session, group_id: int) -> UndoStacks:
    """The stacks of one group from as little of its history as tells them."""
    most = _FIRST_LOOK
    while True:
        rows = list_newest_steps(session, group_id, GROUP_KINDS, most)
        steps = [(GROUP_KINDS[row.kind], row.id) for row in reversed(rows)]
        stacks = (
            _build_stacks(steps) if len(rows) < most else _build_stacks_from_newest_steps(steps)
        )
        if stacks is not None:
            return stacks
        most *= _FURTHER


def _build_stacks_from_newest_steps(steps: Sequence[tuple[str, int]]) -> UndoStacks | None:
    """The stacks after the newest steps, or None where older ones must be known to tell them.

    An edit leaves nothing undone, whatever was before; so all that follows from it is known, as
    long as no undo reaches below it. Two edits on the stack also tell what is left after an undo.
    """
    first = next((at for at, (kind, _) in enumerate(steps) if kind == "edit"), len(steps))
    try:
        stacks = _build_stacks(steps[first:])
    except IndexError:
        return None
    return stacks if len(stacks.done) > 1 else None


def read_station_stacks(session: Session, station_id: int) -> UndoStacks:
    """The stacks of a shared station."""
    rows = list_station_steps(session, station_id, STATION_KINDS)
    return _build_stacks((STATION_KINDS[row.kind], row.id) for row in rows)


def _build_stacks(steps: Iterable[tuple[str, int]]) -> UndoStacks:
    """The stacks after all steps (kind, id of the entry): ``UndoStacks.then`` of each, in one go."""
    done: list[int] = []
    undone: list[int] = []
    for kind, log_id in steps:
        if kind == "undo":
            undone.append(done.pop())
        elif kind == "redo":
            done.append(undone.pop())
        else:
            done.append(log_id)
            undone.clear()
    return UndoStacks(tuple(done), tuple(undone))


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
            view.extras.values(),
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

    def of(self, groups: Iterable[StoredGroup]) -> dict[int, RevisionChain]:
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
