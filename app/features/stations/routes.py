"""Stations: the lines of static cameras, edited once for every view that shares them."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import Annotated

from fastapi import APIRouter, Query, Response
from pydantic import BaseModel, Field

from app.db.idempotency import without_pending_response
from app.errors import NotFoundError
from app.features.groups.edit import SetStationCalibrationSource, SetStationLines
from app.features.groups.edit_schemas import LinesEdit, StationCalibrationSourceEdit
from app.features.groups.routes import CHANGED, load_group_document
from app.features.groups.schemas import (
    DatasetReference,
    GroupDocument,
    LineDocuments,
    lines_to_document,
    make_group_response,
)
from app.features.groups.state import GroupState
from app.features.groups.submit import solve_and_store_group
from app.features.solve.jobs import request_solve_job
from app.features.stations.service import (
    StationState,
    load_station,
    redo_station,
    submit_station_edit,
    undo_station,
)
from app.http.deps import Actor, AppServices, AppStore, Id, IfMatch, Services
from app.http.documents import respond_with
from app.http.errors import add_current_state_to_conflicts
from app.http.permissions import Action, OwnedKind, may
from app.http.problem import responses
from app.http.route import Route
from app.json_text import MAX_ID
from app.soccer.choices import CalibrationChoice

router = APIRouter(prefix="/stations", tags=["stations"], route_class=Route)
GroupOfStation = Annotated[
    int | None,
    Query(
        ge=1,
        le=MAX_ID,
        description="The group to answer with; default: the first that the station takes part in.",
    ),
]


class StationDetail(BaseModel):
    """A camera station: the lines that all its views share."""

    id: int
    dataset: DatasetReference
    key: str
    shared: bool
    width: int
    height: int
    calibration: CalibrationChoice
    has_given: bool
    has_given_covariance: bool = Field(
        description="Whether its given camera says how far it may be off; an accepted rig does."
    )
    flipped: bool
    lines: LineDocuments
    proposed: list[str] = Field(
        description="Markings whose points were accepted as they were proposed from the paint."
    )
    not_visible: list[str] = Field(
        description="Markings that a person says its pictures do not show: JaC does not count them."
    )
    groups: int = Field(description="How many groups it takes part in.")
    revision: int
    etag: str
    can_undo: bool
    can_redo: bool

    @staticmethod
    def of(state: StationState) -> StationDetail:
        """The document of a station's state."""
        station = state.station
        return StationDetail.model_validate(
            {
                **vars(station),
                **vars(state),
                **vars(station.size),
                "dataset": DatasetReference(id=state.dataset_id, name=state.dataset),
                "has_given": station.given is not None,
                "has_given_covariance": station.given_covariance is not None,
                "lines": lines_to_document(station.lines),
                "groups": len(state.visible_groups),
            }
        )


@router.get(
    "/{station}",
    responses={
        200: {"headers": {"ETag": {"description": "The station's.", "schema": {"type": "string"}}}},
    },
)
@may(Action.READ, station=OwnedKind.STATION)
def get_station(station: Id, store: AppStore, response: Response) -> StationDetail:
    """A station with its lines and its own ETag."""
    state = load_station(store, station)
    response.headers["ETag"] = state.etag
    return StationDetail.of(state)


@router.patch("/{station}/lines", response_model=GroupDocument, responses=CHANGED)
@may(Action.ANNOTATE, station=OwnedKind.STATION, group=OwnedKind.GROUP)
@respond_with(make_group_response)
def set_station_lines(
    station: Id,
    lines: LinesEdit,
    services: AppServices,
    actor: Actor,
    if_match: IfMatch,
    group: GroupOfStation = None,
) -> GroupState:
    """Change the lines of a static camera; If-Match takes the station's ETag.

    The group that is answered is solved at once, the others in the background.
    """
    edit = SetStationLines(lines.points(), tuple(lines.proposed), tuple(lines.not_visible))
    change = partial(submit_station_edit, edit=edit)
    return _change_station(services, station, group, change, if_match, actor)


@router.patch("/{station}", response_model=GroupDocument, responses=CHANGED)
@may(Action.ANNOTATE, station=OwnedKind.STATION, group=OwnedKind.GROUP)
@respond_with(make_group_response)
def change_station(
    station: Id,
    change: StationCalibrationSourceEdit,
    services: AppServices,
    actor: Actor,
    if_match: IfMatch,
    group: GroupOfStation = None,
) -> GroupState:
    """Choose whether the given calibration counts or the lines; If-Match as for lines."""
    edited = partial(submit_station_edit, edit=SetStationCalibrationSource(change.calibration))
    return _change_station(services, station, group, edited, if_match, actor)


@router.post(
    "/{station}/undo",
    operation_id="undoStation",
    response_model=GroupDocument,
    responses={**CHANGED, **responses(413, 415)},
)
@may(Action.ANNOTATE, station=OwnedKind.STATION, group=OwnedKind.GROUP)
@respond_with(make_group_response)
def undo(
    station: Id,
    services: AppServices,
    actor: Actor,
    if_match: IfMatch,
    group: GroupOfStation = None,
) -> GroupState:
    """Take the last edit of a static camera back; 409 when there is none."""
    return _change_station(services, station, group, undo_station, if_match, actor)


@router.post(
    "/{station}/redo",
    operation_id="redoStation",
    response_model=GroupDocument,
    responses={**CHANGED, **responses(413, 415)},
)
@may(Action.ANNOTATE, station=OwnedKind.STATION, group=OwnedKind.GROUP)
@respond_with(make_group_response)
def redo(
    station: Id,
    services: AppServices,
    actor: Actor,
    if_match: IfMatch,
    group: GroupOfStation = None,
) -> GroupState:
    """Do again what was undone last; 409 when there is nothing."""
    return _change_station(services, station, group, redo_station, if_match, actor)


def _change_station(
    services: Services,
    station: int,
    group: int | None,
    change: Callable[..., StationState],
    if_match: str,
    actor: str,
) -> GroupState:
    """Change a station with the group in view, and queue the others."""
    store = services.store
    shown = _choose_shown_group(load_station(store, station), group)
    with add_current_state_to_conflicts(lambda: load_group_document(store, shown)):
        state = change(store, station, if_match=if_match, actor=actor, shown=shown)
    with without_pending_response():
        request_solve_job(services.jobs, store, state.dataset_id, actor=actor, edited=True)
    return state.shown or solve_and_store_group(store, shown)


def _choose_shown_group(state: StationState, group: int | None) -> int:
    """The group to answer with.

    Raises:
        NotFoundError: No view of that group is from the station.
    """
    chosen = group if group is not None else next(iter(state.visible_groups), None)
    if chosen is None or chosen not in state.visible_groups:
        raise NotFoundError(f"static camera {state.station.key} has no view in that group")
    return chosen
