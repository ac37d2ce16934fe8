"""Tracks of the ball over REST."""

from __future__ import annotations

from typing import Annotated, Literal

from fastapi import APIRouter, Query, Response

from app.features.jobs.queries import Job
from app.features.jobs.schemas import describe_job_response_for_openapi, make_job_response
from app.features.match_estimates.routes import MatchSelection
from app.features.tracks import service as tracks
from app.features.tracks.around import compute_track_excerpt, find_tracks_of_group
from app.features.tracks.jobs import TRACKS
from app.features.tracks.listing import TrackChoice, TrackOrder, choose_tracks
from app.features.tracks.schemas import (
    MOST_FRAMES,
    GroupTrackList,
    TrackDocument,
    TrackEdit,
    TrackExcerptDocument,
    TrackFrames,
    TrackList,
)
from app.features.tracks.service import Track
from app.http.cursor import paged
from app.http.deps import Actor, AppServices, AppStore, DatasetPath, Id, IfMatch
from app.http.documents import make_document_response, respond_with
from app.http.errors import add_current_state_to_conflicts
from app.http.permissions import Action, OwnedKind, may
from app.http.problem import responses
from app.http.request_limits import COMPUTE, limit
from app.http.route import Route
from app.json_text import MAX_ID

TAGGED = {"headers": {"ETag": {"description": "Of the track.", "schema": {"type": "string"}}}}
router = APIRouter(tags=["tracks"], route_class=Route)


@router.get("/datasets/{dataset}/tracks")
@may(Action.READ, dataset=OwnedKind.DATASET, whole=True)
@limit(COMPUTE)
@paged()
def list_tracks(
    dataset: DatasetPath,
    store: AppStore,
    verdict: Annotated[
        Literal["accepted", "rejected", "none"] | None,
        Query(description="Only those; `none`: nobody judged them."),
    ] = None,
    stale: Annotated[
        bool | None, Query(description="Only those whose groups have changed since, or have not.")
    ] = None,
    assigned: Annotated[
        str | None,
        Query(max_length=60, description="Only those in open batches of this person."),
    ] = None,
    batch: Annotated[
        int | None, Query(ge=1, le=MAX_ID, description="Only those in this open batch.")
    ] = None,
    sort: Annotated[
        TrackOrder,
        Query(
            description="`match` and frame (of a batch: its order), `worst`: the largest left-out "
            "error first, `gaps`: those of which least is known first."
        ),
    ] = "match",
) -> TrackList:
    """The tracks of a dataset, each with how well it predicts what was left out, and for whom it is."""
    choice = TrackChoice(verdict, stale, assigned, batch, sort)
    return TrackList.of(choose_tracks(store, dataset, choice))


@router.post("/datasets/{dataset}/tracks", **describe_job_response_for_openapi(409))
@may(Action.LEAD, dataset=OwnedKind.DATASET)
@respond_with(make_job_response)
def make_tracks(
    dataset: DatasetPath, request: MatchSelection, services: AppServices, actor: Actor
) -> Job:
    """Track the ball over the stretches of a match, or of all: static rigs, and shots of recordings.

    What changed nothing stays; a track that comes out differently has no verdict. Corrections stay.
    """
    return TRACKS.request(services.jobs, services.store, dataset, request.match, actor=actor)


@router.get("/tracks/{track}", responses={200: TAGGED})
@may(Action.READ, track=OwnedKind.TRACK)
def get_track(track: Id, store: AppStore, response: Response) -> TrackDocument:
    """A track without its frames."""
    found = TrackDocument.model_validate(tracks.get_track(store, track))
    response.headers["ETag"] = found.etag
    return found


@router.get("/tracks/{track}/frames", responses={200: TAGGED})
@may(Action.READ, track=OwnedKind.TRACK)
@limit(COMPUTE)
def get_track_frames(
    track: Id,
    store: AppStore,
    response: Response,
    first: Annotated[
        int, Query(ge=0, le=MAX_ID, description="Number of the first frame wanted.")
    ] = 0,
    last: Annotated[
        int | None,
        Query(ge=0, le=MAX_ID, description=f"Number of the last one; {MOST_FRAMES} come at most."),
    ] = None,
) -> TrackFrames:
    """The frames of a track in columns, with its events and with the balls that contradict it."""
    detail = tracks.read_track_detail(store, track)
    start = max(first, detail.track.first)
    end = min(detail.track.last if last is None else last, start + MOST_FRAMES - 1)
    found = TrackFrames.of(detail, start, end)
    response.headers["ETag"] = found.etag
    return found


@router.get("/tracks/{track}/around")
@may(Action.READ, track=OwnedKind.TRACK)
@limit(COMPUTE)
def get_track_around(
    track: Id,
    store: AppStore,
    frame: Annotated[
        int | None,
        Query(ge=0, le=MAX_ID, description="In the middle; default: the worst, else the first."),
    ] = None,
) -> TrackExcerptDocument:
    """The frames around one as they come out of the groups as they are now; nothing is stored.

    What an edit makes of the ball is known at once; the track is stale until it is made again.
    """
    return TrackExcerptDocument.of_excerpt(compute_track_excerpt(store, track, frame))


@router.get("/groups/{group}/tracks")
@may(Action.READ, group=OwnedKind.GROUP)
@paged()
def list_tracks_of_group(group: Id, store: AppStore) -> GroupTrackList:
    """The track that a group is in, and its frame there."""
    return GroupTrackList.model_validate({"items": find_tracks_of_group(store, group)})


def _make_track_response(track: Track) -> Response:
    found = TrackDocument.model_validate(track)
    return make_document_response(found, 200, {"ETag": found.etag})


@router.patch(
    "/tracks/{track}", response_model=TrackDocument, responses={**responses(409), 200: TAGGED}
)
@may(Action.REVIEW, track=OwnedKind.TRACK)
@respond_with(_make_track_response)
def change_track(
    track: Id, edit: TrackEdit, store: AppStore, actor: Actor, if_match: IfMatch
) -> Track:
    """Accept or reject a track, or say which events it has and has not."""
    with add_current_state_to_conflicts(
        lambda: TrackDocument.model_validate(tracks.get_track(store, track))
    ):
        return tracks.review_track(store, track, edit.to_track_review(), if_match, actor=actor)
