"""Links of a recording's replays to its live shots."""

from __future__ import annotations

from typing import Annotated

from fastapi import APIRouter, Path, Response

from app.features.jobs.queries import Job
from app.features.jobs.schemas import describe_job_response_for_openapi, make_job_response
from app.features.recordings.link_frames import LinkedFrames, find_linked_frames
from app.features.recordings.link_schemas import (
    InstantsEdit,
    LinkByBallRequest,
    LinkDocument,
    LinkList,
    LiveShotSuggestions,
    NewShotLink,
)
from app.features.recordings.link_suggestions import suggest_live_shots
from app.features.recordings.link_values import ShotLink, format_links_csv
from app.features.recordings.links import add_link, get_link, list_links, remove_link, set_instants
from app.features.recordings.routes import CSV_FILE
from app.features.tracks.link_ball import request_link_by_ball
from app.http.cursor import paged
from app.http.deps import Actor, AppServices, AppStore, Id, IfMatch
from app.http.documents import make_document_response, make_empty_response, respond_with
from app.http.errors import add_current_state_to_conflicts
from app.http.permissions import Action, OwnedKind, may
from app.http.problem import responses
from app.http.route import Route
from app.json_text import MAX_ID

router = APIRouter(prefix="/recordings/{recording}", tags=["recordings"], route_class=Route)

TAGGED = {"headers": {"ETag": {"description": "Of the link.", "schema": {"type": "string"}}}}
LOCATION = {"Location": {"description": "Its address.", "schema": {"type": "string"}}}
LinkId = Annotated[int, Path(ge=1, le=MAX_ID, description="Id of the link.")]
ReplayFrame = Annotated[int, Path(ge=0, le=MAX_ID, description="Any frame of the replay.")]


def _make_link_response(found: ShotLink, status: int = 200, **headers: str) -> Response:
    shown = LinkDocument.model_validate(found)
    return make_document_response(shown, status, {"ETag": found.etag, **headers})


def _make_created_response(found: ShotLink) -> Response:
    at = f"/api/v1/recordings/{found.live.recording}/links/{found.id}"
    return _make_link_response(found, 201, Location=at)


@router.get("/links", operation_id="listLinks")
@may(Action.READ, recording=OwnedKind.RECORDING)
@paged()
def get_links(recording: Id, store: AppStore) -> LinkList:
    """The links of a recording, in which it has the live shot or the replay."""
    return LinkList(
        items=[LinkDocument.model_validate(one) for one in list_links(store, recording)]
    )


@router.get(
    "/links.csv",
    response_class=Response,
    responses={
        200: {"content": {CSV_FILE: {}}, "description": "A row for each link, or piece of one."},
    },
)
@may(Action.READ, recording=OwnedKind.RECORDING)
def get_links_file(recording: Id, store: AppStore) -> Response:
    """The same as CSV: a row for each, or for each piece of one whose speed changes."""
    headers = {"Content-Disposition": 'attachment; filename="touchline-links.csv"'}
    text = format_links_csv(list_links(store, recording))
    return Response(text, headers=headers, media_type=CSV_FILE)


@router.post(
    "/links",
    operation_id="addLink",
    response_model=LinkDocument,
    status_code=201,
    responses={
        **responses(409),
        201: {
            "description": "The link; the same two shots again are the same link.",
            "headers": {**TAGGED["headers"], **LOCATION},
        },
    },
)
@may(
    Action.ANNOTATE,
    recording=OwnedKind.RECORDING,
    body={"replay/recording": OwnedKind.RECORDING},
)
@respond_with(_make_created_response)
def add_one(recording: Id, wanted: NewShotLink, store: AppStore, actor: Actor) -> ShotLink:
    """Link a replay to the live shot of this recording that it shows again, without an instant yet."""
    live, replay = wanted.live, wanted.replay
    return add_link(
        store,
        (recording, live.first, live.last),
        (replay.recording, replay.first, replay.last),
        actor=actor,
    )


@router.get("/links/suggestions/{frame}", responses=responses(409))
@may(Action.READ, recording=OwnedKind.RECORDING)
@paged()
def suggest_live(recording: Id, frame: ReplayFrame, store: AppStore) -> LiveShotSuggestions:
    """Live shots that the replay at a frame may show, the likeliest first, and why."""
    return LiveShotSuggestions(items=suggest_live_shots(store, recording, frame))


@router.get("/links/{link}", operation_id="getLink", responses={200: TAGGED})
@may(Action.READ, recording=OwnedKind.RECORDING)
def get_one(recording: Id, link: LinkId, store: AppStore, response: Response) -> LinkDocument:
    """One link: its instants, and the map of the times that follows from them."""
    found = get_link(store, recording, link)
    response.headers["ETag"] = found.etag
    return LinkDocument.model_validate(found)


@router.get("/links/{link}/frames", responses=responses(409))
@may(Action.READ, recording=OwnedKind.RECORDING)
def get_linked_frames(recording: Id, link: LinkId, store: AppStore) -> LinkedFrames:
    """Which frame of the replay shows the same as each live frame."""
    return find_linked_frames(store, get_link(store, recording, link))


@router.put(
    "/links/{link}/instants",
    operation_id="setInstants",
    response_model=LinkDocument,
    responses={**responses(409), 200: TAGGED},
)
@may(Action.ANNOTATE, recording=OwnedKind.RECORDING)
@respond_with(_make_link_response)
def put_instants(
    recording: Id,
    link: LinkId,
    wanted: InstantsEdit,
    store: AppStore,
    actor: Actor,
    if_match: IfMatch,
) -> ShotLink:
    """Replace the instants of a link; the map of its times follows at once.

    One says where the replay begins, at a speed that is assumed; two say the speed, too; more make both better, and
    tell where the speed changes.
    """
    with add_current_state_to_conflicts(
        lambda: LinkDocument.model_validate(get_link(store, recording, link))
    ):
        return set_instants(
            store,
            recording,
            link,
            wanted.to_frame_pairs(),
            wanted.assumed_speed,
            if_match,
            actor=actor,
        )


@router.post("/links/{link}/ball", **describe_job_response_for_openapi())
@may(
    Action.LEAD,
    recording=OwnedKind.RECORDING,
    body={"live_upload": OwnedKind.UPLOAD, "replay_upload": OwnedKind.UPLOAD},
)
@respond_with(make_job_response)
def link_by_ball(
    recording: Id, link: LinkId, wanted: LinkByBallRequest, services: AppServices, actor: Actor
) -> Job:
    """Find the times of a link from the ball, near its instants: rays of the same instant meet.

    Both shots need cameras over time, or groups with given cameras. What the ball does not tell is refused in words.
    """
    uploads = {"live": wanted.live_upload, "replay": wanted.replay_upload}
    return request_link_by_ball(
        services.jobs, services.store, recording, link, uploads, actor=actor
    )


@router.delete(
    "/links/{link}",
    status_code=204,
    response_class=Response,
    responses={204: {"description": "It is gone."}},
)
@may(Action.ANNOTATE, recording=OwnedKind.RECORDING)
@respond_with(make_empty_response)
def delete_link(recording: Id, link: LinkId, store: AppStore, actor: Actor) -> None:
    """Remove a link and its instants; groups that were taken of it stay."""
    remove_link(store, recording, link, actor=actor)
