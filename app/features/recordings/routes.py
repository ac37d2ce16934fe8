"""Recordings: brought in, shown frame by frame, cut into shots, made groups of."""

from __future__ import annotations

from typing import Annotated

from anyio import to_thread
from fastapi import APIRouter, Path, Query, Request, Response

from app.features.datasets.service import dataset_id
from app.features.groups.view_routes import CLIENT_GONE, FRAME, SECONDS, round_up_and_clamp_width
from app.features.jobs.queries import Job
from app.features.jobs.schemas import describe_job_response_for_openapi, make_job_response
from app.features.recordings.jobs import (
    InstantOptions,
    request_groups_of_instants,
    request_index,
    request_recording_import,
)
from app.features.recordings.schemas import (
    InstantsRequest,
    NewRecording,
    RecordingChange,
    RecordingDocument,
    RecordingList,
    ShotList,
    ShotsEdit,
)
from app.features.recordings.service import (
    Recording,
    get_recording,
    list_recordings,
    remove_recording,
    set_clock_readings,
)
from app.features.recordings.shots import RecordingShots, format_shots_csv, get_shots, replace_shots
from app.http.cursor import paged
from app.http.deps import (
    Actor,
    AppServices,
    AppStore,
    DryRun,
    Id,
    IfMatch,
    SeesWhole,
    is_not_modified,
)
from app.http.documents import (
    make_document_responder,
    make_document_response,
    make_empty_response,
    respond_with,
)
from app.http.errors import add_current_state_to_conflicts
from app.http.permissions import Action, OwnedKind, RoleScope, may
from app.http.problem import responses
from app.http.request_limits import TRANSFER, limit
from app.http.route import Route
from app.json_text import MAX_ID, digest_content
from app.media.images import JPEG

router = APIRouter(prefix="/recordings", tags=["recordings"], route_class=Route)

CSV_FILE = "text/csv"
SHORTEST = 12
"""Characters of a sha256 that tell one film from another."""
TAGGED = {
    "headers": {"ETag": {"description": "Of the list of shots.", "schema": {"type": "string"}}}
}
Frame = Annotated[int, Path(ge=0, le=MAX_ID, description="Number of the frame, from 0.")]
Width = Annotated[
    int | None, Query(ge=1, le=100_000, description="Wanted width in pixels; never enlarged.")
]
Film = Annotated[
    str | None,
    Query(
        max_length=64,
        description="The first 12 characters of the recording's `sha256`, or more. With them the browser may keep the frame"
        " for an hour; without, or where they are those of another file, it asks each time whether the frame is the same.",
    ),
]
OfDataset = Annotated[
    str | None, Query(max_length=200, description="Name or id of the dataset; default: all.")
]


@router.get("", operation_id="listRecordings")
@may(Action.READ, dataset=OwnedKind.DATASET, where=RoleScope.SOMEWHERE, whole=True)
@paged()
def get_recordings(store: AppStore, sight: SeesWhole, dataset: OfDataset = None) -> RecordingList:
    """Recordings of a dataset, or of all that one sees."""
    found = list_recordings(store, None if dataset is None else dataset_id(store, dataset))
    return RecordingList(items=[one for one in found if sight.sees(one.dataset_id)])


@router.post("", **describe_job_response_for_openapi())
@may(
    Action.LEAD,
    body={
        "dataset": OwnedKind.NEW_DATASET,
        "source/upload": OwnedKind.UPLOAD,
        "source/folder": OwnedKind.FOLDER,
    },
)
@respond_with(make_job_response)
def add_recording(wanted: NewRecording, services: AppServices, actor: Actor) -> Job:
    """Bring a video file into a dataset; the job indexes it, and finds its shots.

    The file stays where it is. The same file again is the same recording, indexed anew.
    """
    return request_recording_import(
        services.jobs,
        services.store,
        services.settings,
        wanted.dataset,
        wanted.source.to_place_by_kind(),
        actor=actor,
    )


@router.get("/{recording}", operation_id="getRecording", response_model=RecordingDocument)
@may(Action.READ, recording=OwnedKind.RECORDING)
def get_one(recording: Id, store: AppStore) -> Recording:
    """One recording: how long it is, how many shots it has, whether it can be read."""
    return get_recording(store, recording)


@router.patch("/{recording}", response_model=RecordingDocument)
@may(Action.ANNOTATE, recording=OwnedKind.RECORDING)
@respond_with(make_document_responder(RecordingDocument.model_validate))
def change_recording(
    recording: Id, wanted: RecordingChange, store: AppStore, actor: Actor
) -> Recording:
    """Say what the clock of the match shows in frames of a recording; others follow from them.

    Groups that are taken afterwards have `match_half` and `match_seconds` in `metadata.recording`.
    """
    return set_clock_readings(store, recording, wanted.to_clock_readings(), actor=actor)


@router.delete(
    "/{recording}",
    status_code=204,
    response_class=Response,
    responses={204: {"description": "It is gone."}},
)
@may(Action.LEAD, recording=OwnedKind.RECORDING)
@respond_with(make_empty_response)
def delete_recording(recording: Id, store: AppStore, actor: Actor) -> None:
    """Forget a recording and its shots; its file stays, and so do the groups made of it."""
    remove_recording(store, recording, actor=actor)


@router.get(
    "/{recording}/frames/{frame}",
    response_class=Response,
    responses={**responses(409, 413), **FRAME},
)
@may(Action.READ, recording=OwnedKind.RECORDING)
@limit(TRANSFER)
async def get_recording_frame(
    recording: Id,
    frame: Frame,
    services: AppServices,
    request: Request,
    width: Width = None,
    v: Film = None,
) -> Response:
    """A frame as JPEG, scaled down when a width is given; exactly the one of that number."""
    found = await to_thread.run_sync(get_recording, services.store, recording)
    sha256, wide = found.require_readable(), round_up_and_clamp_width(width)
    etag = f'"{digest_content(f"{sha256} {frame} {wide}".encode())}"'
    # The address has to change with the file: an id may be that of another film within the hour.
    is_named = v is not None and len(v) >= SHORTEST and sha256.startswith(v)
    kept = f"max-age={SECONDS}" if is_named else "no-cache"
    headers = {"ETag": etag, "Cache-Control": f"private, {kept}"}
    if is_not_modified(request, etag):
        return Response(status_code=304, headers=headers)
    task = services.recordings.request_frame(found, frame, wide)
    data = await task.result_unless_client_gone(request.is_disconnected)
    if data is None:
        return Response(status_code=CLIENT_GONE)
    services.recordings.request_frames_beside(found, frame)
    return Response(data, media_type=JPEG, headers=headers)


def _make_shots_response(found: RecordingShots) -> Response:
    return make_document_response(ShotList.of(found), 200, {"ETag": found.etag})


@router.get("/{recording}/shots", responses={**responses(409), 200: TAGGED})
@may(Action.READ, recording=OwnedKind.RECORDING)
@paged()
def list_shots(recording: Id, store: AppStore, response: Response) -> ShotList:
    """The shots of a recording in their order, with their times."""
    found = ShotList.of(get_shots(store, recording))
    response.headers["ETag"] = found.etag
    return found


@router.get(
    "/{recording}/shots.csv",
    response_class=Response,
    responses={
        **responses(409),
        200: {"content": {CSV_FILE: {}}, "description": "A row for each shot."},
    },
)
@may(Action.READ, recording=OwnedKind.RECORDING)
def get_shots_file(recording: Id, store: AppStore) -> Response:
    """The same as CSV, a row for each shot."""
    headers = {"Content-Disposition": 'attachment; filename="touchline-shots.csv"'}
    return Response(
        format_shots_csv(get_shots(store, recording)), headers=headers, media_type=CSV_FILE
    )


@router.put(
    "/{recording}/shots", response_model=ShotList, responses={**responses(409), 200: TAGGED}
)
@may(Action.ANNOTATE, recording=OwnedKind.RECORDING)
@respond_with(_make_shots_response)
def set_shots(
    recording: Id, wanted: ShotsEdit, store: AppStore, actor: Actor, if_match: IfMatch
) -> RecordingShots:
    """Replace the list of shots: split, merged, of another kind, kept or dropped."""
    with add_current_state_to_conflicts(lambda: ShotList.of(get_shots(store, recording))):
        return replace_shots(store, recording, wanted.to_shots(), if_match, actor=actor)


@router.post("/{recording}/shots", **describe_job_response_for_openapi())
@may(Action.LEAD, recording=OwnedKind.RECORDING)
@respond_with(make_job_response)
def find_shots(recording: Id, services: AppServices, actor: Actor) -> Job:
    """Find the shots of a recording anew, in place of the list that it has.

    A file that has changed, or whose index is gone or of an older version, is indexed again; the list stays if it is the
    same file.
    """
    found = get_recording(services.store, recording)
    return request_index(services.jobs, services.store, found, shots=True, actor=actor)


@router.post("/{recording}/groups", **describe_job_response_for_openapi(409))
@may(Action.LEAD, recording=OwnedKind.RECORDING)
@respond_with(make_job_response)
def take_instants(
    recording: Id,
    wanted: InstantsRequest,
    services: AppServices,
    actor: Actor,
    dry_run: DryRun = False,
) -> Job:
    """Make a group of each of these frames, which are kept without loss.

    With `linked`, the frames of linked replays that show the same are further views; each has in `metadata.recording` by
    how many seconds it is off (`off_s`), and whether it is repeated or blended. A frame that is a group already stays as
    it is, but for a group of one view that gets linked ones. The recording may be gone afterwards.
    """
    options = InstantOptions(wanted.propose, wanted.linked, dry_run or wanted.dry_run)
    return request_groups_of_instants(
        services.jobs, services.store, recording, wanted.frames, options, actor=actor
    )
