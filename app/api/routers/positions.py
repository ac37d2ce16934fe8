"""Where the main camera of each match stands: shown, shared with its pictures, taken back."""

from __future__ import annotations

from typing import Annotated

from fastapi import APIRouter, Query

from app.api.deps import Actor, AppServices, AppStore, DatasetPath
from app.api.jobs import by_job, job_answer
from app.api.paging import paged
from app.api.problem import responses
from app.api.respond import responds
from app.api.schemas.positions import PositionsRequest, SharedPositionsDocument
from app.review.editing.positions import get_positions
from app.review.jobs.positions import POSITIONS, take_positions_back
from app.review.jobs.records import Job

router = APIRouter(prefix="/datasets/{dataset}/positions", tags=["datasets"])


@router.get("", operation_id="listPositions", responses=responses(404))
@paged()
def list_positions(dataset: DatasetPath, store: AppStore) -> SharedPositionsDocument:
    """Where each match's main camera stands, as far as that is shared with its pictures."""
    return SharedPositionsDocument.model_validate(get_positions(store, dataset))


@router.post(
    "",
    operation_id="sharePositions",
    **by_job(404, 409, 413, 415),
)
@responds(job_answer)
def share_positions(
    dataset: DatasetPath, request: PositionsRequest, services: AppServices, actor: Actor
) -> Job:
    """Estimate where main cameras stand and give each picture what its match's others say of it.

    Their groups are solved again. An edit of lines never renews it; this does. 409 while the
    policy does not use it.
    """
    return POSITIONS.request(services.jobs, services.store, dataset, request.match, actor=actor)


@router.delete(
    "",
    operation_id="takePositionsBack",
    **by_job(404, 409),
)
@responds(job_answer)
def take_back_positions(
    dataset: DatasetPath,
    services: AppServices,
    actor: Actor,
    match: Annotated[str, Query(min_length=1, max_length=1000, description="Name of the match.")],
) -> Job:
    """Give a match the positions that it had before they were shared last; the job solves it.

    Once more takes back the share before that one; 409 when nothing is shared any more.
    """
    return take_positions_back(services.jobs, services.store, dataset, match, actor=actor)
