"""Stations: the lines of a static camera, edited once for all views that share it."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from sqlalchemy import select
from sqlalchemy.orm import Session

from app.errors import ConflictError, NotFoundError
from app.review.editing.codec import edit_to_json, station_edit_from_json
from app.review.editing.edit import StationEdit
from app.review.editing.idempotency import Request, is_repeated, remember
from app.review.editing.state import require_etag, station_etag
from app.review.editing.undo import read_station_stacks
from app.soccer.group import Station
from app.store.clock import now
from app.store.codecs import Json
from app.store.groups import (
    StoredStation,
    groups_of_station,
    read_stations,
    refresh_inputs_hashes,
    save_station,
)
from app.store.log import Entry, append, read_log
from app.store.models import DatasetModel, LogModel
from app.store.queue import refresh_queue
from app.store.session import Store


@dataclass(frozen=True)
class StationState:
    """A station as it is now; ``groups`` are the ids of the groups that it takes part in."""

    id: int
    dataset_id: int
    dataset: str
    revision: int
    etag: str
    station: Station
    groups: tuple[int, ...]
    can_undo: bool
    can_redo: bool
    stored: StoredStation


@dataclass(frozen=True)
class _Change:
    kind: str
    body: Json
    station: Station


def load_station(store: Store, station_id: int) -> StationState:
    """A station as it is now.

    Raises:
        NotFoundError: There is no such station.
    """
    with store.read() as session:
        return _read(session, station_id)


def submit_station(
    store: Store,
    station_id: int,
    edit: StationEdit,
    *,
    if_match: str,
    actor: str,
    idempotency_key: str | None = None,
) -> StationState:
    """Save an edit of a static camera; its groups are then stale until they are solved again.

    ``recompute.solve_dataset`` solves them; the inputs hashes of all are in step already.

    Raises:
        StaleRevisionError: ``if_match`` is not the station's present ETag.
        ConflictError: The station belongs to one view alone, which is where it is edited.
        InputError: The edit says something impossible.
    """

    def plan(_session: Session, state: StationState) -> _Change:
        station = state.station
        body = {"edit": edit_to_json(edit), "inverse": edit_to_json(edit.inverse(station))}
        return _Change("station_edit", body, edit.apply(station))

    request = Request(idempotency_key, actor, ["station", station_id, edit_to_json(edit)])
    return _change(store, station_id, plan, if_match, request)


def undo_station(
    store: Store, station_id: int, *, if_match: str, actor: str, idempotency_key: str | None = None
) -> StationState:
    """Take the last edit of a static camera back; raises ConflictError without one."""
    request = Request(idempotency_key, actor, ["undo", "station", station_id])
    return _change(store, station_id, _plan_undo, if_match, request)


def redo_station(
    store: Store, station_id: int, *, if_match: str, actor: str, idempotency_key: str | None = None
) -> StationState:
    """Do again what undo took back last; raises ConflictError without such an edit."""
    request = Request(idempotency_key, actor, ["redo", "station", station_id])
    return _change(store, station_id, _plan_redo, if_match, request)


def _change(
    store: Store,
    station_id: int,
    plan: Callable[[Session, StationState], _Change],
    if_match: str,
    request: Request,
) -> StationState:
    with store.write() as session:
        state = _read(session, station_id)
        if not state.station.shared:
            raise ConflictError(
                f"station {state.station.key} belongs to one view",
                hint="Edit the lines of that view instead.",
            )
        if not is_repeated(session, request):
            require_etag(state.etag, if_match, f"camera {state.station.key}")
            change = plan(session, state)
            if change.station != state.station:
                _save(session, state, change, request)
    return load_station(store, station_id)


def _save(session: Session, state: StationState, change: _Change, request: Request) -> None:
    at = now()
    save_station(session, state.stored, change.station)
    refresh_inputs_hashes(session, state.groups)
    entry = Entry(
        change.kind, request.actor, at, change.body, state.dataset_id, station_id=state.id
    )
    (log_id,) = append(session, [entry])
    remember(session, request, log_id, at)
    refresh_queue(session, state.groups)


def _read(session: Session, station_id: int) -> StationState:
    stored = read_stations(session, [station_id]).get(station_id)
    if stored is None:
        raise NotFoundError(f"there is no station {station_id}")
    name = session.scalar(select(DatasetModel.name).where(DatasetModel.id == stored.dataset_id))
    stacks = read_station_stacks(session, station_id)
    return StationState(
        id=stored.id,
        dataset_id=stored.dataset_id,
        dataset=name or "",
        revision=stored.revision,
        etag=station_etag(stored),
        station=stored.station,
        groups=tuple(groups_of_station(session, station_id)),
        can_undo=stacks.can_undo,
        can_redo=stacks.can_redo,
        stored=stored,
    )


def _plan_undo(session: Session, state: StationState) -> _Change:
    done = read_station_stacks(session, state.id).done
    if not done:
        raise ConflictError("there is nothing to undo for this camera")
    return _again(session, state, "station_undo", done[-1], forward="inverse", backward="edit")


def _plan_redo(session: Session, state: StationState) -> _Change:
    undone = read_station_stacks(session, state.id).undone
    if not undone:
        raise ConflictError("there is nothing to redo for this camera")
    return _again(session, state, "station_redo", undone[-1], forward="edit", backward="inverse")


def _again(
    session: Session, state: StationState, kind: str, log_id: int, *, forward: str, backward: str
) -> _Change:
    (entry,) = read_log(session, LogModel.id == log_id)
    body = {"edit": entry.body[forward], "inverse": entry.body[backward], "of": log_id}
    station = station_edit_from_json(body["edit"]).apply(state.station)
    return _Change(kind, body, station)
