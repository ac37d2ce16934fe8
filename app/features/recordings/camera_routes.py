"""Cameras over time of recordings: tracked by a job, read a stretch at a time, and written for other tools."""

from __future__ import annotations

from typing import Annotated

from fastapi import APIRouter, Path, Query, Request, Response

from app.errors import NotFoundError
from app.features.jobs.queries import Job
from app.features.jobs.schemas import describe_job_response_for_openapi, make_job_response
from app.features.recordings.camera_jobs import request_camera_half_turn, request_camera_tracking
from app.features.recordings.camera_schemas import (
    CameraFormat,
    CamerasDocument,
    CamerasHalfTurnRequest,
    CamerasList,
    FrameCamerasDocument,
    TrackCamerasRequest,
)
from app.features.recordings.cameras import (
    MEDIA_TYPES,
    export_shot_cameras,
    get_pitch_of_recording,
    get_shot_cameras,
    list_shot_cameras,
    read_cameras,
)
from app.http.cursor import paged
from app.http.deps import Actor, AppServices, AppStore, Id, is_not_modified
from app.http.documents import make_document_response, respond_with
from app.http.headers import make_content_disposition
from app.http.permissions import Action, OwnedKind, may
from app.http.problem import Responses, responses
from app.http.request_limits import TRANSFER, limit
from app.http.route import Route
from app.json_text import MAX_ID

router = APIRouter(prefix="/recordings", tags=["recordings"], route_class=Route)

Frame = Annotated[
    int, Path(ge=0, le=MAX_ID, description="Number of a frame of the stretch, from 0.")
]
Before = Annotated[
    bool, Query(description="Those that the present ones took the place of, if they are kept.")
]
TAGGED = {"headers": {"ETag": {"description": "Of these cameras.", "schema": {"type": "string"}}}}
FILE: Responses = {
    200: {
        "description": "The file: a zip, or an npz.",
        "content": {
            kind: {"schema": {"type": "string", "format": "binary"}}
            for kind in sorted(set(MEDIA_TYPES.values()))
        },
    }
}


@router.get("/{recording}/cameras")
@may(Action.READ, recording=OwnedKind.RECORDING)
@paged()
def list_cameras(recording: Id, store: AppStore) -> CamerasList:
    """The stretches of a recording that have a camera for each frame, and what became of their frames."""
    found = list_shot_cameras(store, recording)
    return CamerasList(items=[CamerasDocument.model_validate(one) for one in found])


@router.post("/{recording}/cameras", **describe_job_response_for_openapi(409))
@may(Action.LEAD, recording=OwnedKind.RECORDING)
@respond_with(make_job_response)
def track_cameras(
    recording: Id, wanted: TrackCamerasRequest, services: AppServices, actor: Actor
) -> Job:
    """Follow the camera of a stretch without a cut: a camera for each of its frames.

    Lines that were drawn in groups of its frames are known. The cameras take the place of those that share a
    frame with them; groups of its frames get them as given, unless somebody has given or drawn another one.
    """
    return request_camera_tracking(
        services.jobs, services.store, recording, wanted.first, wanted.last, actor=actor
    )


@router.get(
    "/{recording}/cameras/{frame}",
    response_model=FrameCamerasDocument,
    responses={**responses(409), 200: TAGGED},
)
@may(Action.READ, recording=OwnedKind.RECORDING)
def get_cameras(
    recording: Id, frame: Frame, store: AppStore, request: Request, before: Before = False
) -> Response:
    """The camera of each frame of the stretch that has a frame."""
    found = get_shot_cameras(store, recording, frame)
    digest = found.digest_before if before else found.digest
    if digest is None:
        raise NotFoundError("no earlier cameras of these frames are kept")
    pitch = get_pitch_of_recording(store, recording)
    tag = f'"{digest}-{pitch.length:g}-{pitch.width:g}"'
    headers = {"ETag": tag, "Cache-Control": "private, no-cache"}
    if is_not_modified(request, tag):
        return Response(status_code=304, headers=headers)
    frames = read_cameras(store.settings, digest)
    return make_document_response(FrameCamerasDocument.of(frames, pitch), 200, headers)


@router.patch("/{recording}/cameras/{frame}", **describe_job_response_for_openapi(409))
@may(Action.LEAD, recording=OwnedKind.RECORDING)
@respond_with(make_job_response)
def turn_cameras(
    recording: Id, frame: Frame, wanted: CamerasHalfTurnRequest, services: AppServices, actor: Actor
) -> Job:
    """Turn the cameras of the stretch that has a frame by half a turn of the pitch, or back.

    Its paint is the same from the other side, so that a camera which stands opposite is tracked turned. Groups of its
    frames follow, unless somebody has given or drawn another camera. Lines that are drawn in a frame say which side it is.
    """
    return request_camera_half_turn(
        services.jobs, services.store, recording, frame, wanted.turned, actor=actor
    )


@router.get(
    "/{recording}/cameras/{frame}/file",
    response_class=Response,
    responses={**responses(409), **FILE},
)
@may(Action.READ, recording=OwnedKind.RECORDING)
@limit(TRANSFER)
def get_cameras_file(
    recording: Id,
    frame: Frame,
    store: AppStore,
    form: Annotated[
        CameraFormat, Query(alias="format", description="Which file is written.")
    ] = "soccernet",
) -> Response:
    """The cameras of a stretch for other tools.

    `soccernet`: `camera_<frame>.json` each and `track.json`, zipped; `npz`: K, R, t and k, a row a frame from 0;
    `opentrackio`: a sample a frame, zipped.
    """
    found = get_shot_cameras(store, recording, frame)
    name, content = export_shot_cameras(store, found, form)
    headers = {
        "Content-Disposition": make_content_disposition(name),
        "Cache-Control": "private, no-cache",
    }
    return Response(content, media_type=MEDIA_TYPES[form], headers=headers)
