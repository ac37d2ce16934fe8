"""Jobs: listed, looked at, cancelled."""

from __future__ import annotations

from typing import Annotated, Literal

from fastapi import APIRouter, Query

from app.features.datasets.service import dataset_id
from app.features.jobs.queries import OPEN, Job
from app.features.jobs.schemas import JobDocument, JobKind, JobPage
from app.http.cursor import parse_cursor
from app.http.deps import Actor, AppServices, Id, SeesWhole
from app.http.documents import make_document_responder, respond_with
from app.http.permissions import Action, OwnedKind, RoleScope, may
from app.http.problem import responses
from app.http.route import Route
from app.soccer.choices import JobState

router = APIRouter(prefix="/jobs", tags=["jobs"], route_class=Route)

Limit = Annotated[int, Query(ge=1, le=500)]
Cursor = Annotated[str | None, Query(max_length=30, description="`next` of the page before.")]
DatasetFilter = Annotated[
    str | None, Query(max_length=200, description="Name or id of the dataset; default: all.")
]


@router.get("")
@may(Action.READ, dataset=OwnedKind.DATASET, where=RoleScope.SOMEWHERE, whole=True)
def list_jobs(
    services: AppServices,
    visibility: SeesWhole,
    dataset: DatasetFilter = None,
    kind: Annotated[JobKind | None, Query()] = None,
    state: Annotated[JobState | Literal["open"] | None, Query()] = None,
    limit: Limit = 50,
    cursor: Cursor = None,
) -> JobPage:
    """Jobs, the newest first."""
    found = None if dataset is None else dataset_id(services.store, dataset)
    jobs = services.jobs.find(
        dataset_id=found,
        kinds=[kind] if kind else [],
        states=OPEN if state == "open" else [state] if state else [],
        before=parse_cursor(cursor),
        limit=limit + 1,
        visibility=visibility,
    )
    more = str(jobs[limit - 1].id) if len(jobs) > limit else None
    return JobPage(items=jobs[:limit], next=more)


@router.get("/{job}", response_model=JobDocument)
@may(Action.READ, job=OwnedKind.JOB)
def get_job(job: Id, services: AppServices) -> Job:
    """A job as it stands."""
    return services.jobs.get(job)


@router.delete("/{job}", response_model=JobDocument, responses=responses(409))
@may(Action.LEAD, job=OwnedKind.JOB)
@respond_with(make_document_responder(JobDocument.model_validate))
def cancel_job(job: Id, services: AppServices, actor: Actor) -> Job:
    """End a job: one that waits at once, one that runs at its next step; 409 when it is over."""
    return services.jobs.cancel(job, by=actor)
