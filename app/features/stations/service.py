"""Stations: the lines of a static camera, edited once for all views that share it."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import NotRequired, TypedDict, Unpack

from app.db.json_columns import Json
from app.db.log import NewLogEntry, append_entries
from app.db.session import Session, now
from app.db.store import Store
from app.errors import ConflictError, NotFoundError
from app.features.datasets.queries import read_dataset_name
from app.features.groups.edit import SetStationLines, StationEdit, replace_station_in_group
from app.features.groups.edit_codec import (
    edit_and_inverse_to_json,
    require_point_limits,
    station_edit_from_json,
)
from app.features.groups.queries import StoredGroup
from app.features.groups.revision_queries import refresh_inputs_hashes
from app.features.groups.state import (
    GroupState,
    read_group_without_solution,
    read_state,
    require_etag,
    station_etag,
)
from app.features.groups.undo import make_undo_entry_body
from app.features.groups.undo_stacks import read_station_stacks
from app.features.groups.view_queries import (
    StoredStation,
    list_groups_of_station,
    read_stations,
    save_station,
)
from app.features.people.visibility_queries import has_hidden_groups
from app.features.queue.refresh_queries import refresh_queue
from app.features.solutions.queries import EncodedSolution, SolutionKey, insert_solutions
from app.features.solutions.service import read_known_calibrations, solve_and_encode
from app.soccer.codec import hash_group_inputs
from app.soccer.group import Group, Station
from app.soccer.solution import Calibration


@dataclass(frozen=True)
class StationState:
    """A station as it is now.

    ``groups`` are the ids of the groups that it takes part in, ``visible_groups`` of those that whoever asks may see.
    ``shown`` is one of them as it was saved with a step of the station.
    """

    id: int
    dataset_id: int
    dataset: str
    revision: int
    etag: str
    station: Station
    groups: tuple[int, ...]
    visible_groups: tuple[int, ...]
    can_undo: bool
    can_redo: bool
    stored: StoredStation
    shown: GroupState | None = None


@dataclass(frozen=True)
class _StationChange:
    kind: str
    body: Json
    station: Station


class _EditOptions(TypedDict):
    """How a step is taken.

    Attributes:
        if_match: ETag of the station that it builds on.
        actor: Who says so.
        shown: One of its groups, which is solved and saved with it.
    """

    if_match: str
    actor: str
    shown: NotRequired[int | None]


_Plan = Callable[[Session, StationState], _StationChange]
_Trial = tuple[StoredGroup, Group, Mapping[str, Calibration]]


def load_station(store: Store, station_id: int) -> StationState:
    """A station as it is now.

    Raises:
        NotFoundError: There is no such station.
    """
    with store.read() as session:
        return _read_state(session, station_id)


def submit_station_edit(
    store: Store,
    station_id: int,
    edit: StationEdit,
    **how: Unpack[_EditOptions],
) -> StationState:
    """Save an edit of a static camera; its groups are then stale until they are solved again.

    ``recompute.solve_dataset`` solves them; the inputs hashes of all are in step already.

    Args:
        store: The database.
        station_id: The station.
        edit: What to change.
        how: ETag of the station that the edit builds on (``if_match``), who says so (``actor``), the
            group that is solved and saved with it (``shown``).

    Raises:
        StaleRevisionError: ``if_match`` is not the station's present ETag.
        ConflictError: The station belongs to a single view alone, which is where it is edited.
        InputError: The edit says something impossible.
    """

    return _change_station(store, station_id, _plan_edit(edit), **how)


def submit_station_edits(
    store: Store,
    edits: Sequence[tuple[StationState, StationEdit]],
    *,
    actor: str,
    check: Callable[[Session], None] | None = None,
) -> None:
    """Save edits of several static cameras that belong together: all of them, or none.

    Args:
        store: The database.
        edits: What each camera was when its edit was thought of, and the edit.
        actor: Who says so.
        check: Raises where what else they rest on has changed; nothing is saved then.

    Raises:
        StaleRevisionError: One of the cameras has changed since.
    """

    steps = [(state.id, _plan_edit(edit), state.etag) for state, edit in edits]
    with store.write() as session:
        if check is not None:
            check(session)
        _save_planned_changes(session, steps, actor)


def undo_stations(
    store: Store,
    states: Sequence[StationState],
    edits: Sequence[tuple[StationState, StationEdit]] = (),
    *,
    actor: str,
) -> int:
    """Take the last edit of several static cameras back, of all or none; returns how many.

    ``edits`` are saved with it, as ``submit_station_edits`` does, and count: of cameras whose last
    edit is another than the one to take back.
    """
    steps = [(state.id, _plan_undo_or_redo("undo"), state.etag) for state in states]
    steps += [(state.id, _plan_edit(edit), state.etag) for state, edit in edits]
    count = len(steps)
    with store.write() as session:
        _save_planned_changes(session, steps, actor)
        session.respond(count)
    return count


def _save_planned_changes(
    session: Session, steps: Iterable[tuple[int, _Plan, str]], actor: str
) -> None:
    groups: set[int] = set()
    for station_id, plan, etag in steps:
        state, change = _plan_change(session, station_id, plan, etag)
        if change.station != state.station:
            _save_change(session, state, change, actor)
            groups.update(state.groups)
    refresh_queue(session, sorted(groups))


def undo_station(store: Store, station_id: int, **how: Unpack[_EditOptions]) -> StationState:
    """Take the last edit of a static camera back; raises ConflictError without one."""
    return _change_station(store, station_id, _plan_undo_or_redo("undo"), **how)


def redo_station(store: Store, station_id: int, **how: Unpack[_EditOptions]) -> StationState:
    """Do again what undo took back last; raises ConflictError without such an edit."""
    return _change_station(store, station_id, _plan_undo_or_redo("redo"), **how)


def _change_station(
    store: Store,
    station_id: int,
    plan: _Plan,
    *,
    if_match: str,
    actor: str,
    shown: int | None = None,
) -> StationState:
    with store.read() as session:
        state, change = _plan_change(session, station_id, plan, if_match)
        if change.station == state.station:
            return state
        trial = None if shown is None else _make_trial_group(session, shown, change.station)
    solutions = [] if trial is None else [_solve_trial(*trial)]
    with store.write() as session:
        # Planned once more: others may have edited it while the group was solved.
        state, change = _plan_change(session, station_id, plan, if_match)
        _save_change(session, state, change, actor)
        insert_solutions(session, solutions)
        refresh_queue(session, state.groups)
        saved = None if shown is None else read_state(session, shown)
        if saved is not None:
            session.respond(saved)
    return replace(load_station(store, station_id), shown=saved)


def _plan_change(
    session: Session, station_id: int, plan: _Plan, if_match: str
) -> tuple[StationState, _StationChange]:
    state = _read_state(session, station_id)
    if not state.station.shared:
        raise ConflictError(
            f"camera {state.station.key} is not a static camera: it belongs to one view alone",
            hint="Edit the lines of that view instead.",
        )
    require_etag(state.etag, if_match, f"camera {state.station.key}")
    return state, plan(session, state)


def _make_trial_group(session: Session, group_id: int, station: Station) -> _Trial:
    """A group with another station, and what is known of its calibrations."""
    stored = read_group_without_solution(session, group_id).stored
    view = next(view for view in stored.group.views if view.station.key == station.key)
    group = replace_station_in_group(stored.group, view, station)
    return stored, group, read_known_calibrations(session, [group], stored.policy)


def _solve_trial(
    stored: StoredGroup, group: Group, known: Mapping[str, Calibration]
) -> tuple[SolutionKey, EncodedSolution]:
    key = SolutionKey(stored.id, hash_group_inputs(group), stored.policy.hash)
    return key, solve_and_encode(group, stored.policy, known)[1]


def _save_change(session: Session, state: StationState, change: _StationChange, actor: str) -> None:
    save_station(session, state.stored, change.station)
    refresh_inputs_hashes(session, state.groups)
    entry = NewLogEntry(
        change.kind, actor, now(), change.body, state.dataset_id, station_id=state.id
    )
    append_entries(session, [entry])


def _read_state(session: Session, station_id: int) -> StationState:
    stored = read_stations(session, [station_id]).get(station_id)
    if stored is None:
        raise NotFoundError(f"there is no static camera with id {station_id}")
    stacks = read_station_stacks(session, station_id)
    groups = visible = list_groups_of_station(session, station_id)
    if has_hidden_groups(stored.dataset_id):
        visible = list_groups_of_station(session, station_id, stored.dataset_id)
    return StationState(
        id=stored.id,
        dataset_id=stored.dataset_id,
        dataset=read_dataset_name(session, stored.dataset_id),
        revision=stored.revision,
        etag=station_etag(stored),
        station=stored.station,
        groups=tuple(groups),
        visible_groups=tuple(visible),
        can_undo=stacks.can_undo,
        can_redo=stacks.can_redo,
        stored=stored,
    )


def _plan_edit(edit: StationEdit) -> _Plan:
    def plan(_session: Session, state: StationState) -> _StationChange:
        station = state.station
        if isinstance(edit, SetStationLines):
            require_point_limits(f"camera {station.key}", station.lines, edit.lines)
        body = edit_and_inverse_to_json(edit, edit.inverse(station))
        return _StationChange("station_edit", body, edit.apply(station))

    return plan


def _plan_undo_or_redo(kind: str) -> _Plan:
    """Undo or redo."""

    def plan(session: Session, state: StationState) -> _StationChange:
        stacks = read_station_stacks(session, state.id)
        body = make_undo_entry_body(session, stacks, kind, "for this camera")
        station = station_edit_from_json(body["edit"]).apply(state.station)
        return _StationChange(f"station_{kind}", body, station)

    return plan
