"""Practice: eight groups with known answers, and what was said to them."""

from __future__ import annotations

from fastapi import APIRouter, Response

from app.api.deps import Actor, AppServices, Id, Sees
from app.api.jobs import by_job, job_answer
from app.api.problem import responses
from app.api.reply import AskedUnder, Reply
from app.api.schemas.practice import LessonDocument, PracticeBody, PracticeDocument
from app.review.editing.submit import load
from app.review.practice.practice import (
    Practice,
    PracticeLesson,
    read_lesson,
    read_practice,
    request_practice,
)

router = APIRouter(tags=["practice"])


@router.get(
    "/practice",
    operation_id="getPractice",
    response_model=PracticeDocument,
    responses=responses(),
)
def get_practice(services: AppServices, sight: Sees) -> Practice:
    """Every lesson and what has come of it; none until the practice is made."""
    return read_practice(services.store, services.settings, sight)


@router.post(
    "/practice",
    operation_id="startPractice",
    **by_job(409, 413, 415, 503),
)
def start_practice(
    request: PracticeBody, services: AppServices, actor: Actor, asked: AskedUnder
) -> Response:
    """Make the dataset `practice`; sent again it changes nothing, with `again` it begins afresh.

    The job's result has `dataset`, `groups` and `first`, the id of the first lesson's group.
    """
    reply = Reply(asked, job_answer)
    job = request_practice(
        services.jobs,
        services.store,
        services.settings,
        again=request.again,
        actor=actor,
        keep=reply.keep,
    )
    return reply.of(job)


@router.get(
    "/groups/{group}/lesson",
    operation_id="getLesson",
    response_model=LessonDocument,
    responses=responses(404),
)
def get_lesson(group: Id, services: AppServices) -> PracticeLesson:
    """What a practice group asks, and whether it was answered rightly; 404 for other groups."""
    return read_lesson(services.settings, load(services.store, group))
