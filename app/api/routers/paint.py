"""What is read of the paint in a dataset's pictures: shown, read, taken back."""

from __future__ import annotations

from fastapi import APIRouter

from app.api.deps import Actor, AppServices, AppStore, DatasetPath
from app.api.jobs import by_job, job_answer
from app.api.paging import paged
from app.api.problem import responses
from app.api.respond import responds
from app.api.schemas.paint import DatasetPaintDocument, DatasetPaintRequest
from app.review.editing.paint import get_paint
from app.review.jobs.paint import PAINT, take_paint_back
from app.review.jobs.records import Job

router = APIRouter(prefix="/datasets/{dataset}/paint", tags=["datasets"])


@router.get("", operation_id="listDatasetPaint", responses=responses(404))
@paged()
def list_paint(dataset: DatasetPath, store: AppStore) -> DatasetPaintDocument:
    """How many pictures of each match were read for their paint, and what came of it."""
    return DatasetPaintDocument.model_validate(get_paint(store, dataset))


@router.post(
    "",
    operation_id="readDatasetPaint",
    **by_job(404, 409, 413, 415),
)
@responds(job_answer)
def read_paint(
    dataset: DatasetPath, request: DatasetPaintRequest, services: AppServices, actor: Actor
) -> Job:
    """Read the paint of pictures and give it to their groups, which are solved again.

    Pictures that were read for the lines that their view has now are left alone. An edit never
    reads any; this does. 409 while the policy does not use paint.
    """
    return PAINT.request(services.jobs, services.store, dataset, request.match, actor=actor)


@router.delete(
    "",
    operation_id="takeDatasetPaintBack",
    **by_job(404, 409),
)
@responds(job_answer)
def take_back_paint(dataset: DatasetPath, services: AppServices, actor: Actor) -> Job:
    """Give all groups what they had before paint was read last; the job solves them.

    Once more takes back the reading before that one; 409 when there is none any more. A reading
    that waits or runs is cancelled, and is the one that is taken back, as far as it came.
    """
    return take_paint_back(services.jobs, services.store, dataset, actor=actor)
