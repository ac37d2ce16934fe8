"""What was done to the pictures of each match's main camera: estimated, said, taken back."""

from __future__ import annotations

from fastapi import APIRouter

from app.api.deps import Actor, AppServices, AppStore, DatasetPath
from app.api.jobs import by_job, job_answer
from app.api.paging import paged
from app.api.problem import responses
from app.api.respond import responds
from app.api.schemas.pictures import (
    MatchPictureChange,
    MatchPicturesDocument,
    PictureEstimateRequest,
)
from app.review.editing.pictures import read_pictures
from app.review.jobs.pictures import PICTURES, request_pictures
from app.review.jobs.records import Job

router = APIRouter(prefix="/datasets/{dataset}/pictures", tags=["datasets"])


@router.get("", operation_id="listMatchPictures", responses=responses(404))
@paged()
def list_match_pictures(dataset: DatasetPath, store: AppStore) -> MatchPicturesDocument:
    """What the pictures of each match's main camera are taken to be: stretched, cropped or neither."""
    return MatchPicturesDocument.model_validate({"items": read_pictures(store, dataset)})


@router.post(
    "",
    operation_id="estimateMatchPictures",
    **by_job(404, 413, 415),
)
@responds(job_answer)
def estimate_match_pictures(
    dataset: DatasetPath, request: PictureEstimateRequest, services: AppServices, actor: Actor
) -> Job:
    """Look at up to thirty frames of each match together; changes nothing.

    `result.items` of the job has what they show (`estimate`), what to use instead (`proposed`, null
    where nothing certainly happened), and both in words.
    """
    return PICTURES.request(services.jobs, services.store, dataset, request.match, actor=actor)


@router.patch(
    "",
    operation_id="setMatchPicture",
    **by_job(404, 413, 415),
)
@responds(job_answer)
def set_match_picture(
    dataset: DatasetPath, change: MatchPictureChange, services: AppServices, actor: Actor
) -> Job:
    """Say what was done to the pictures of a match's main camera; the job solves its groups.

    Each group gets an edit that it can undo. Replays are left alone: each shot has its own.
    """
    picture = None if change.picture is None else change.picture.picture()
    return request_pictures(
        services.jobs, services.store, dataset, {change.match: picture}, actor=actor
    )
