"""The pitch model, and the pitches of a dataset's matches."""

from __future__ import annotations

from typing import Annotated, Literal

from fastapi import APIRouter, Query, Response
from pydantic import AliasPath, BaseModel, Field

from app.features.datasets.service import get_dataset_head
from app.features.groups.schemas import PitchSize
from app.features.jobs.queries import Job
from app.features.jobs.schemas import (
    JobDocument,
    describe_job_response_for_openapi,
    make_job_response,
    make_location_header,
)
from app.features.pitches.service import DatasetPitches, read_pitches
from app.features.solve.jobs import PitchesAndJob, request_pitch_change, request_solve_job
from app.http.cursor import paged
from app.http.deps import Actor, AppServices, AppStore, DatasetPath, IfMatch
from app.http.documents import (
    Document,
    ListDocument,
    RequestBody,
    make_document_response,
    respond_with,
)
from app.http.errors import add_current_state_to_conflicts
from app.http.permissions import Action, OwnedKind, RoleScope, may
from app.http.problem import Responses
from app.http.route import Route
from app.soccer.pitch import LENGTH_RANGE, WIDTH_RANGE, Arc, Pitch, Segment, opposite_marking
from app.solving.pitch_size import PitchEstimate

XYZ = tuple[float, float, float]


pitch_router = APIRouter(tags=["pitch"], route_class=Route)
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


class MarkingShape(BaseModel):
    """A marking: a segment between two points, or an arc on the grass."""

    marking: str
    twin: str = Field(
        description="The marking that takes its place when the pitch is turned by 180 degrees."
    )
    kind: Literal["segment", "arc"]
    start: XYZ | None = Field(default=None, description="Ends of a segment, metres.")
    end: XYZ | None = None
    center: tuple[float, float] | None = Field(default=None, description="Of an arc, metres.")
    radius: float | None = None
    first: float | None = Field(default=None, description="Angle in radians, from +x to +y.")
    last: float | None = None

    @staticmethod
    def of(marking: str, shape: Segment | Arc) -> MarkingShape:
        """The document of a shape."""
        kind: Literal["segment", "arc"] = "arc" if isinstance(shape, Arc) else "segment"
        return MarkingShape(
            marking=marking, twin=opposite_marking(marking), kind=kind, **vars(shape)
        )


class PitchDocument(BaseModel):
    """Pitch frame: metres, origin at the centre mark, x to the right goal, z down."""

    length: float
    width: float
    markings: list[MarkingShape]

    @staticmethod
    def of(pitch: Pitch) -> PitchDocument:
        """The document of a pitch."""
        return PitchDocument(
            length=pitch.length,
            width=pitch.width,
            markings=[MarkingShape.of(name, pitch.shapes[name]) for name in sorted(pitch.shapes)],
        )


class MatchPitchDocument(Document):
    """The pitch of one match."""

    match: str = Field(description="Empty: of the groups that have none, if they are of one pitch.")
    group: str = Field(description="Key of the first of its groups.")
    group_id: int
    groups: int
    length: float = Field(validation_alias=AliasPath("pitch", "length"), description="In use, m.")
    width: float = Field(validation_alias=AliasPath("pitch", "width"), description="In use, m.")
    mixed: bool = Field(description="Its groups were brought with several sizes.")
    estimate: PitchEstimate | None = Field(description="Null while it is not computed.")
    problem: str | None = Field(description="Why it cannot be estimated.")
    proposed: PitchSize | None = Field(
        description="The size to use instead: it differs beyond its uncertainty."
    )
    previous: PitchSize | None = Field(description="The size before it was changed last.")


class PitchesDocument(ListDocument[MatchPitchDocument]):
    """The pitches of a dataset's matches, by name of the match."""

    etag: str = Field(description="What a change of them builds on.")


class PitchChange(RequestBody, examples=[{"match": "a/b/c", "length": 103.0, "width": 66.0}]):
    """Give a match another pitch: all its groups at once."""

    match: str = Field(max_length=1000, description="Empty: all groups that have none.")
    length: Annotated[float, Field(ge=LENGTH_RANGE[0], le=LENGTH_RANGE[1])]
    width: Annotated[float, Field(ge=WIDTH_RANGE[0], le=WIDTH_RANGE[1])]


@pitch_router.get("/pitch")
@may(Action.READ, where=RoleScope.SOMEWHERE)
def get_pitch(
    length: Annotated[float, Query(ge=LENGTH_RANGE[0], le=LENGTH_RANGE[1])] = 105.0,
    width: Annotated[float, Query(ge=WIDTH_RANGE[0], le=WIDTH_RANGE[1])] = 68.0,
) -> PitchDocument:
    """The 26 markings of a pitch of that size."""
    return PitchDocument.of(Pitch(length, width))


@pitches_router.get("", responses={200: {"headers": TAGGED}})
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


@pitches_router.post("", **describe_job_response_for_openapi())
@may(Action.LEAD, dataset=OwnedKind.DATASET)
@respond_with(make_job_response)
def estimate_pitches(dataset: DatasetPath, services: AppServices, actor: Actor) -> Job:
    """Estimate the pitches of the matches whose lines were not looked at as they are now.

    The job solves what is stale, too: it is the one that follows an import.
    """
    found = get_dataset_head(services.store, dataset)
    title = f"Estimate the pitches of {found.name}"
    return request_solve_job(services.jobs, services.store, found.id, actor=actor, title=title)


def _make_pitch_job_response(sized: PitchesAndJob) -> Response:
    pitches = PitchesDocument.model_validate(sized.state)
    job = JobDocument.model_validate(sized.job)
    job.result = {"pitches": pitches.model_dump(mode="json")}
    return make_document_response(
        job, 202, {**_etag_headers(sized.state), **make_location_header(sized.job)}
    )


@pitches_router.patch("", status_code=202, response_model=JobDocument, responses=CHANGED)
@may(Action.LEAD, dataset=OwnedKind.DATASET)
@respond_with(_make_pitch_job_response)
def set_pitch(
    dataset: DatasetPath,
    change: PitchChange,
    services: AppServices,
    actor: Actor,
    if_match: IfMatch,
) -> PitchesAndJob:
    """Give a match another pitch, all its groups at once.

    They are solved again by the job; `result.pitches` of the answer is the list as it is now.
    The size before is `previous` there: sent the same way it takes the change back.
    """
    store = services.store
    present = read_pitches(store, dataset)
    with add_current_state_to_conflicts(
        lambda: PitchesDocument.model_validate(read_pitches(store, dataset))
    ):
        return request_pitch_change(
            services.jobs,
            store,
            present.dataset_id,
            {change.match: Pitch(change.length, change.width)},
            if_match=if_match,
            actor=actor,
        )


def _etag_headers(state: DatasetPitches) -> dict[str, str]:
    return {"ETag": state.etag, "Cache-Control": "private, no-cache"}
