"""The pitch model, and the pitches of a dataset's matches."""

from __future__ import annotations

from typing import Annotated

from fastapi import APIRouter, Query, Response

from app.features.datasets.service import get_dataset_head
from app.features.jobs.queries import Job
from app.features.jobs.schemas import JobDocument
from app.features.pitches.schemas import PitchChange, PitchDocument, PitchesDocument
from app.features.pitches.service import DatasetPitches, read_pitches
from app.features.solve.jobs import PitchJob, request_pitches, request_solve
from app.http.conflicts import current_state
from app.http.cursor import paged
from app.http.deps import Actor, AppServices, AppStore, DatasetPath, IfMatch
from app.http.job_responses import by_job, job_address, job_answer
from app.http.permissions import Action, OwnedKind, Where, may
from app.http.problem import Responses, responses
from app.http.respond import document, responds
from app.http.route import Route
from app.soccer.pitch import LENGTH_RANGE, WIDTH_RANGE, Pitch

pitch_router = APIRouter(tags=["pitch"], route_class=Route)


@pitch_router.get("/pitch", operation_id="getPitch", responses=responses())
@may(Action.READ, where=Where.SOMEWHERE)
def get_pitch(
    length: Annotated[float, Query(ge=LENGTH_RANGE[0], le=LENGTH_RANGE[1])] = 105.0,
    width: Annotated[float, Query(ge=WIDTH_RANGE[0], le=WIDTH_RANGE[1])] = 68.0,
) -> PitchDocument:
    """The 26 markings of a pitch of that size."""
    return PitchDocument.of(Pitch(length, width))


pitches_router = APIRouter(
    prefix="/datasets/{dataset}/pitches", tags=["datasets"], route_class=Route
)

TAGGED = {"ETag": {"description": "Of the sizes in use.", "schema": {"type": "string"}}}
LOCATED = {"Location": {"description": "Of the job.", "schema": {"type": "string"}}}
CHANGED: Responses = {
    202: {
        "description": "The job that solves what the change left stale.",
        "headers": {**TAGGED, **LOCATED},
    }
}


@pitches_router.get(
    "", operation_id="listPitches", responses={**responses(404), 200: {"headers": TAGGED}}
)
@may(Action.READ, dataset=OwnedKind.DATASET, whole=True)
@paged()
def list_pitches(dataset: DatasetPath, store: AppStore, response: Response) -> PitchesDocument:
    """How large the pitch of each match is taken to be, and how large its lines show it.

    The estimate is made after solving and kept until the lines change; where it differs beyond
    its uncertainty it is `proposed`, and the match's first group has the finding `pitch_size`.
    """
    state = read_pitches(store, dataset)
    response.headers.update(_etag_headers(state))
    return PitchesDocument.model_validate(state)


@pitches_router.post("", operation_id="estimatePitches", **by_job(404))
@may(Action.LEAD, dataset=OwnedKind.DATASET)
@responds(job_answer)
def estimate_pitches(dataset: DatasetPath, services: AppServices, actor: Actor) -> Job:
    """Estimate the pitches of the matches whose lines were not looked at as they are now.

    The job solves what is stale, too: it is the one that follows an import.
    """
    found = get_dataset_head(services.store, dataset)
    title = f"Estimate the pitches of {found.name}"
    return request_solve(services.jobs, services.store, found.id, actor=actor, title=title)


def _sized_response(sized: PitchJob) -> Response:
    pitches = PitchesDocument.model_validate(sized.state)
    job = JobDocument.model_validate(sized.job)
    job.result = {"pitches": pitches.model_dump(mode="json")}
    return document(job, 202, {**_etag_headers(sized.state), **job_address(sized.job)})


@pitches_router.patch(
    "",
    operation_id="setPitch",
    status_code=202,
    response_model=JobDocument,
    responses={**responses(404, 412, 413, 415, 428), **CHANGED},
)
@may(Action.LEAD, dataset=OwnedKind.DATASET)
@responds(_sized_response)
def set_pitch(
    dataset: DatasetPath,
    change: PitchChange,
    services: AppServices,
    actor: Actor,
    if_match: IfMatch,
) -> PitchJob:
    """Give a match another pitch, all its groups at once.

    They are solved again by the job; `result.pitches` of the answer is the list as it is now.
    The size before is `previous` there: sent the same way it takes the change back.
    """
    store = services.store
    present = read_pitches(store, dataset)
    with current_state(lambda: PitchesDocument.model_validate(read_pitches(store, dataset))):
        return request_pitches(
            services.jobs,
            store,
            present.dataset_id,
            {change.match: Pitch(change.length, change.width)},
            if_match=if_match,
            actor=actor,
        )


def _etag_headers(state: DatasetPitches) -> dict[str, str]:
    return {"ETag": state.etag, "Cache-Control": "private, no-cache"}
