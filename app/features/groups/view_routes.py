"""Views: their lines, their ball, whether they take part, and their frame."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import replace
from functools import partial
from typing import Annotated

from anyio import to_thread
from fastapi import APIRouter, Body, Query, Request, Response

from app.errors import ImageError, NotFoundError, StorageError, TooLargeError
from app.features.groups.edit import (
    Edit,
    SetCalibrationSource,
    SetLines,
    SetPictureGeometry,
    SetViewInclusion,
    make_set_ball_edit,
)
from app.features.groups.edit_schemas import BallEdit, LinesEdit, ViewEdit
from app.features.groups.routes import CHANGED, load_group_document_of_view
from app.features.groups.schemas import (
    GroupDocument,
    NeighbourFrameList,
    describe_frame_offset,
    make_group_response,
)
from app.features.groups.state import GroupState
from app.features.groups.submit import (
    ViewLocation,
    find_view_location,
    require_followed_groups,
    submit_view_edit,
)
from app.features.groups.view_paint import NO_FRAME_HINT
from app.features.groups.view_queries import find_dataset_of_view
from app.features.solutions.service import Solve, solve_and_encode
from app.http.cursor import paged
from app.http.deps import Actor, AppServices, Id, IfMatch, Services, is_not_modified
from app.http.documents import respond_with
from app.http.errors import add_current_state_to_conflicts
from app.http.permissions import Action, OwnedKind, may
from app.http.problem import Responses, responses
from app.http.request_limits import TRANSFER, is_large_request, limit
from app.http.route import Route
from app.media.frames import EncodedPicture, FrameProvider
from app.soccer.group import FARTHEST, Media
from app.worker_process import WorkerEnded

router = APIRouter(prefix="/views", tags=["views"], route_class=Route)

WIDTH_STEP = 16
"""Asked widths are rounded up to a multiple, so that few sizes fill the cache."""
MIN_WIDTH, MAX_WIDTH = 16, 4096
SECONDS = 3600
CLIENT_GONE = 499
"""What the log calls the answer that nobody reads."""
NO_NEIGHBOURS = "This dataset has no frames before or after this one."
AS_STORED = "Touchline-As-Stored"
FRAME: Responses = {
    200: {
        "description": "The frame as JPEG, PNG or WebP.",
        "content": {
            kind: {"schema": {"type": "string", "format": "binary"}}
            for kind in ("image/jpeg", "image/png", "image/webp")
        },
        "headers": {
            "ETag": {"description": "Of these bytes.", "schema": {"type": "string"}},
            AS_STORED: {
                "description": "`true` where these are the bytes of the file: not scaled, not turned,"
                " and not of a video. Absent elsewhere.",
                "schema": {"type": "string"},
            },
        },
    },
    304: {"description": "Not changed."},
}


@router.patch("/{view}/lines", response_model=GroupDocument, responses=CHANGED)
@may(Action.ANNOTATE, view=OwnedKind.VIEW)
@respond_with(make_group_response)
def set_view_lines(
    view: Id,
    lines: LinesEdit,
    services: AppServices,
    actor: Actor,
    if_match: IfMatch,
    request: Request,
) -> GroupState:
    """Draw, move or delete markings; 409 names the station when the camera is static."""
    values = (lines.points(), tuple(lines.proposed), tuple(lines.not_visible))

    def make_edit(key: str) -> Edit:
        return SetLines(key, *values)

    apart = partial(services.large.solve, solve_and_encode)
    solve = apart if is_large_request(request.scope) else solve_and_encode
    return _submit_view_edit(services, view, make_edit, if_match, actor, solve)


@router.patch("/{view}/ball", response_model=GroupDocument, responses=CHANGED)
@may(Action.ANNOTATE, view=OwnedKind.VIEW)
@respond_with(make_group_response)
def set_view_ball(
    view: Id,
    ball: Annotated[BallEdit | None, Body(description="null: no ball is annotated.")],
    services: AppServices,
    actor: Actor,
    if_match: IfMatch,
) -> GroupState:
    """Say where the ball is in this view, that it is out of view, or that there is none."""
    value = None if ball is None else ball.ball()
    if ball is not None and ball.followed_from is not None:
        require_followed_groups(
            services.store,
            lambda session: find_dataset_of_view(session, view),
            {"/followed_from": ball.followed_from},
        )
    return _submit_view_edit(
        services, view, lambda key: make_set_ball_edit(key, value), if_match, actor
    )


@router.patch("/{view}", response_model=GroupDocument, responses=CHANGED)
@may(Action.ANNOTATE, view=OwnedKind.VIEW)
@respond_with(make_group_response)
def change_view(
    view: Id, change: ViewEdit, services: AppServices, actor: Actor, if_match: IfMatch
) -> GroupState:
    """Leave the view out and say why, take it in again, choose its calibration, say its picture."""

    def make_edit(key: str) -> Edit:
        if "calibration" in change.model_fields_set:
            return SetCalibrationSource(key, change.calibration)
        if "picture" in change.model_fields_set:
            picture = change.picture
            return SetPictureGeometry(key, None if picture is None else picture.picture())
        return SetViewInclusion(key, change.included, change.reason, change.note)

    return _submit_view_edit(services, view, make_edit, if_match, actor)


def _submit_view_edit(
    services: Services,
    view: int,
    edit_of: Callable[[str], Edit],
    if_match: str,
    actor: str,
    solve: Solve = solve_and_encode,
) -> GroupState:
    store, paint = services.store, services.paint
    with add_current_state_to_conflicts(lambda: load_group_document_of_view(store, view)):
        return submit_view_edit(
            store, view, edit_of, if_match=if_match, actor=actor, paint=paint, solve=solve
        )


@router.get("/{view}/image", response_class=Response, responses={**responses(413), **FRAME})
@may(Action.READ, view=OwnedKind.VIEW)
@limit(TRANSFER)
async def get_image(
    view: Id,
    services: AppServices,
    request: Request,
    width: Annotated[
        int | None,
        Query(ge=1, le=100_000, description="Wanted width in pixels; never enlarged."),
    ] = None,
    offset: Annotated[
        int,
        Query(
            ge=-FARTHEST,
            le=FARTHEST,
            description="So many frames later of the same camera; `neighbours` lists which exist.",
        ),
    ] = 0,
) -> Response:
    """The frame of a view, or one just before or after it, scaled down when a width is given."""
    found = await to_thread.run_sync(find_view_location, services.store, view)
    if offset:
        around = await _find_neighbour_frame_media(request, services.frames, found)
        if around is None:
            return Response(status_code=CLIENT_GONE)
        found = replace(found, media=_find_frame_at_offset(found, around, offset))
    picture = await _read_picture(request, services.frames, found, round_up_and_clamp_width(width))
    if picture is None:
        return Response(status_code=CLIENT_GONE)
    etag = f'"{picture.digest}"'
    headers = {"ETag": etag, "Cache-Control": f"private, max-age={SECONDS}"}
    if width is None and picture.as_stored:
        headers[AS_STORED] = "true"
    if is_not_modified(request, etag):
        return Response(status_code=304, headers=headers)
    return Response(picture.data, media_type=picture.kind, headers=headers)


@router.get("/{view}/neighbours", response_model=NeighbourFrameList)
@may(Action.READ, view=OwnedKind.VIEW)
@limit(TRANSFER)
@paged()
async def get_frames_around(
    view: Id, services: AppServices, request: Request
) -> NeighbourFrameList | Response:
    """The frames of the same camera just before and after a view's, where they are on disk.

    Only videos and folders of frames that are numbered by time have them: the files of most
    datasets are numbered by action.
    """
    found = await to_thread.run_sync(find_view_location, services.store, view)
    around = await _find_neighbour_frame_media(request, services.frames, found)
    if around is None:
        return Response(status_code=CLIENT_GONE)
    return NeighbourFrameList.of(view, sorted(around), NO_NEIGHBOURS)


async def _find_neighbour_frame_media(
    request: Request, frames: FrameProvider, view: ViewLocation
) -> dict[int, Media] | None:
    """Where the frames before and after a view's lie, by how many frames later.

    None where nobody waits for it any more.
    """
    if view.media is None:
        return {}
    try:
        if view.media.frame is not None:
            indexing = await to_thread.run_sync(frames.request_frame_preparation, view.media)
            if indexing is not None and not await indexing.result_unless_client_gone(
                request.is_disconnected
            ):
                return None
        task = frames.request_neighbours(view.media, view.group_key, view.static)
        found: dict[int, Media] | None = await task.result_unless_client_gone(
            request.is_disconnected
        )
    except (WorkerEnded, NotFoundError, ImageError, TooLargeError, StorageError):
        return {}
    return found


def _find_frame_at_offset(view: ViewLocation, around: dict[int, Media], offset: int) -> Media:
    """The frame so many frames later."""
    if not around:
        raise NotFoundError(f"there are no frames before or after view {view.key}")
    if offset not in around:
        raise NotFoundError(f"view {view.key}: there is no frame {describe_frame_offset(offset)}")
    return around[offset]


async def _read_picture(
    request: Request, frames: FrameProvider, view: ViewLocation, width: int | None
) -> EncodedPicture | None:
    """The frame, or None where nobody waits for it any more.

    What is wrong with it is said with the view that it belongs to.
    """
    if view.media is None:
        raise NotFoundError("this view has no readable frame", hint=NO_FRAME_HINT)
    with add_view_to_errors(view.key):
        found = await to_thread.run_sync(frames.read_cached, view.media, width, view.flipped)
        if found is not None:
            return found
        fetching = await to_thread.run_sync(frames.request_frame_preparation, view.media)
        if fetching is not None and not await fetching.result_unless_client_gone(
            request.is_disconnected
        ):
            return None
        task = frames.request_picture(view.media, width, view.flipped)
        made: EncodedPicture | None = await task.result_unless_client_gone(request.is_disconnected)
        return made


@contextmanager
def add_view_to_errors(key: str) -> Iterator[None]:
    """Say what is wrong with a frame with the view that it belongs to."""
    try:
        yield
    except (NotFoundError, ImageError, TooLargeError, StorageError) as error:
        # The cause decides between a full disk and one that fails.
        cause = error.__cause__ or error
        raise type(error)(f"view {key}: {error.message}", hint=error.hint) from cause


def round_up_and_clamp_width(width: int | None) -> int | None:
    """The width that is made for a width that is asked for."""
    if width is None:
        return None
    stepped = -(-width // WIDTH_STEP) * WIDTH_STEP
    return min(max(stepped, MIN_WIDTH), MAX_WIDTH)
