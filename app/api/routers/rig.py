"""Rig: the static cameras of a dataset adjusted together, proposed, accepted, taken back."""

from __future__ import annotations

from fastapi import APIRouter, Response

from app.api.deps import Actor, AppServices, DatasetPath
from app.api.jobs import by_job, job_answer
from app.api.problem import responses
from app.api.respond import document, responds
from app.api.schemas.rig import RigRequest, RigTakenBack
from app.review.jobs.records import Job
from app.review.jobs.rig import request_rig, take_rig_back

router = APIRouter(tags=["stations"])


@router.post(
    "/datasets/{dataset}/rig",
    operation_id="adjustRig",
    **by_job(404, 409, 413, 415),
)
@responds(job_answer)
def adjust_rig(
    dataset: DatasetPath, request: RigRequest, services: AppServices, actor: Actor
) -> Job:
    """Adjust the static cameras of a dataset to lines and balls over time.

    The job's result is the proposal: each camera and each pair before and after, on instants that
    were used and on instants that were held out. With `accept` and the `inputs` of the
    proposal that was looked at it is saved as an edit of each camera.
    """
    return request_rig(
        services.jobs,
        services.store,
        dataset,
        what=request.accept,
        inputs=request.inputs,
        actor=actor,
    )


def _taken_back(count: int) -> Response:
    return document(RigTakenBack(taken_back=count))


@router.delete(
    "/datasets/{dataset}/rig",
    operation_id="takeRigBack",
    response_model=RigTakenBack,
    responses=responses(404, 409),
)
@responds(_taken_back)
def delete_rig(dataset: DatasetPath, services: AppServices, actor: Actor) -> int:
    """Take an accepted rig back, all its cameras at once; 409 when there is none."""
    return take_rig_back(services.jobs, services.store, dataset, actor=actor)
