"""Ball runs: followed from a click, mended by others, accepted, and taken back."""

from __future__ import annotations

from typing import Annotated

from fastapi import APIRouter, Path, Response

from app.features.recordings.ball_run_schemas import (
    BallClickRequest,
    BallRunDocument,
    BallRunFrames,
    BallRunList,
    BallRunReviewRequest,
)
from app.features.recordings.ball_runs import (
    StoredRun,
    add_ball_run,
    extend_ball_run,
    get_ball_run,
    list_ball_runs,
    remove_ball_run,
    review_ball_run,
)
from app.http.cursor import paged
from app.http.deps import Actor, AppServices, AppStore, Id, IfMatch
from app.http.documents import make_document_response, make_empty_response, respond_with
from app.http.errors import add_current_state_to_conflicts
from app.http.permissions import Action, OwnedKind, may
from app.http.problem import responses
from app.http.request_limits import COMPUTE, limit
from app.http.route import Route
from app.json_text import MAX_ID

router = APIRouter(
    prefix="/recordings/{recording}/ball-runs", tags=["recordings"], route_class=Route
)

TAGGED = {"headers": {"ETag": {"description": "Of the run.", "schema": {"type": "string"}}}}
LOCATION = {"Location": {"description": "Its address.", "schema": {"type": "string"}}}
RunId = Annotated[int, Path(ge=1, le=MAX_ID, description="Id of the ball run.")]


def _make_run_response(found: StoredRun, status: int = 200, **headers: str) -> Response:
    return make_document_response(BallRunFrames.of(found), status, {"ETag": found.etag, **headers})


def _make_created_response(found: StoredRun) -> Response:
    return _make_run_response(
        found, 201, Location=f"/api/v1/recordings/{found.recording}/ball-runs/{found.id}"
    )


@router.get("", operation_id="listBallRuns")
@may(Action.READ, recording=OwnedKind.RECORDING)
@paged()
def get_runs(recording: Id, services: AppServices) -> BallRunList:
    """The balls that were followed in a recording."""
    # Asked first: what is over by then is in the list.
    following = services.balls.list_frames_being_followed(recording)
    items = [BallRunDocument.of(one) for one in list_ball_runs(services.store, recording)]
    return BallRunList(items=items, following=following)


@router.post(
    "",
    response_model=BallRunFrames,
    status_code=201,
    responses={
        **responses(409),
        201: {"description": "The run.", "headers": {**TAGGED["headers"], **LOCATION}},
    },
)
@may(Action.ANNOTATE, recording=OwnedKind.RECORDING)
@limit(COMPUTE)
@respond_with(_make_created_response)
def follow_ball(
    recording: Id, wanted: BallClickRequest, services: AppServices, actor: Actor
) -> StoredRun:
    """Follow the ball from a click, forwards and backwards through the shot, until it is lost.

    The click is put onto the ball's centre. Cameras over time and boxes that a detector predicted help where there are
    any. Nothing becomes an annotation before a person accepts it.
    """
    click = wanted.to_ball_click()
    return add_ball_run(services.store, services.balls, recording, click, actor=actor)


@router.get(
    "/{run}", operation_id="getBallRun", response_model=BallRunFrames, responses={200: TAGGED}
)
@may(Action.READ, recording=OwnedKind.RECORDING)
def get_one(recording: Id, run: RunId, store: AppStore) -> Response:
    """One ball run, with its frames."""
    return _make_run_response(get_ball_run(store, recording, run))


@router.post(
    "/{run}/clicks", response_model=BallRunFrames, responses={**responses(409), 200: TAGGED}
)
@may(Action.ANNOTATE, recording=OwnedKind.RECORDING)
@limit(COMPUTE)
@respond_with(_make_run_response)
def mend_ball_run(
    recording: Id,
    run: RunId,
    wanted: BallClickRequest,
    services: AppServices,
    actor: Actor,
    if_match: IfMatch,
) -> StoredRun:
    """Say where the ball is in one more frame, and follow it from there, up to where both agree."""
    store, click = services.store, wanted.to_ball_click()
    with add_current_state_to_conflicts(
        lambda: BallRunFrames.of(get_ball_run(store, recording, run))
    ):
        return extend_ball_run(store, services.balls, recording, run, click, if_match, actor=actor)


@router.patch("/{run}", response_model=BallRunFrames, responses={**responses(409), 200: TAGGED})
@may(Action.ANNOTATE, recording=OwnedKind.RECORDING)
@respond_with(_make_run_response)
def change_ball_run(
    recording: Id,
    run: RunId,
    wanted: BallRunReviewRequest,
    services: AppServices,
    actor: Actor,
    if_match: IfMatch,
) -> StoredRun:
    """Accept a ball run, or take that back; confirm frames of it that are uncertain.

    Accepted, each view that shows one of its frames gets the ball, but for uncertain frames that nobody confirmed. A ball
    that somebody else said stays. Taken back, exactly those balls go; where a view with one of them cannot be edited, the
    run stays accepted, and `refused` counts those views.
    """
    store = services.store
    with add_current_state_to_conflicts(
        lambda: BallRunFrames.of(get_ball_run(store, recording, run))
    ):
        return review_ball_run(
            store, recording, run, wanted.to_review(), if_match, actor=actor, paint=services.paint
        )


@router.delete(
    "/{run}",
    status_code=204,
    response_class=Response,
    responses={204: {"description": "It is gone."}},
)
@may(Action.ANNOTATE, recording=OwnedKind.RECORDING)
@respond_with(make_empty_response)
def delete_ball_run(recording: Id, run: RunId, store: AppStore, actor: Actor) -> None:
    """Delete a ball run; balls that views have from it stay."""
    remove_ball_run(store, recording, run, actor=actor)
