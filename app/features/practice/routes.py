"""Practice: eight groups with known answers, a recording with known faults, and what was said to them."""

from __future__ import annotations

from typing import Annotated

from fastapi import APIRouter, Depends, Request

from app.features.groups.submit import load
from app.features.jobs.queries import Job
from app.features.practice.recording import RecordingPractice, read_recording_practice
from app.features.practice.schemas import (
    LessonDocument,
    PracticeBody,
    PracticeDocument,
    RecordingPracticeDocument,
)
from app.features.practice.service import (
    Practice,
    PracticeLesson,
    read_lesson,
    read_practice,
    request_practice,
)
from app.http.access import login_of
from app.http.deps import Actor, AppServices, Id, Sees
from app.http.job_responses import by_job, job_answer
from app.http.permissions import Action, OwnedKind, Where, may
from app.http.problem import responses
from app.http.request_limits import LOOKS, limit
from app.http.respond import responds
from app.http.route import Route

router = APIRouter(tags=["practice"], route_class=Route)


async def _person(request: Request) -> str | None:
    """Whose practice it is; None where nobody logs in."""
    login = login_of(request.scope)
    return None if login is None else login.name


Person = Annotated[str | None, Depends(_person)]


@router.get(
    "/practice",
    operation_id="getPractice",
    response_model=PracticeDocument,
    responses=responses(),
)
@may(Action.READ, where=Where.SOMEWHERE)
def get_practice(services: AppServices, visibility: Sees, person: Person) -> Practice:
    """Every lesson and what has come of it; none until the practice is made.

    Where people log in, each has lessons of their own.
    """
    return read_practice(services.store, services.settings, visibility, person)


@router.post(
    "/practice",
    operation_id="startPractice",
    **by_job(409, 413, 415, 503),
)
@may(Action.ANNOTATE, where=Where.OWN)
@responds(job_answer)
def start_practice(
    request: PracticeBody, services: AppServices, actor: Actor, person: Person
) -> Job:
    """Make the dataset `practice`; sent again it changes nothing, with `again` it begins afresh.

    Where people log in, the dataset is the person's own, `practice NAME`: they are a reviewer in
    it, and only they and admins see it.

    The job's result has `dataset`, `groups` and `first`, the id of the first lesson's group.
    """
    return request_practice(
        services.jobs,
        services.store,
        services.settings,
        again=request.again,
        actor=actor,
        person=person,
    )


@router.get(
    "/practice/recording",
    operation_id="getRecordingPractice",
    response_model=RecordingPracticeDocument,
    responses=responses(),
)
@may(Action.READ, where=Where.SOMEWHERE)
def get_recording_practice(
    services: AppServices, visibility: Sees, person: Person
) -> RecordingPractice:
    """The practice recording: what is right of its shots, its cameras and the link of its replay."""
    return read_recording_practice(services.store, services.settings, visibility, person)


@router.post(
    "/practice/recording",
    operation_id="startRecordingPractice",
    **by_job(409, 413, 415, 503),
)
@may(Action.ANNOTATE, where=Where.OWN)
@responds(job_answer)
def start_recording_practice(
    request: PracticeBody, services: AppServices, actor: Actor, person: Person
) -> Job:
    """Draw a film with planted faults as a recording of the dataset `recording practice`; with `again` it begins afresh.

    Where people log in, the dataset is the person's own, `recording practice NAME`: they lead in it.

    The job's result has `dataset`, and `recording`, its id.
    """
    return request_practice(
        services.jobs,
        services.store,
        services.settings,
        again=request.again,
        actor=actor,
        person=person,
        recording=True,
    )


@router.get(
    "/groups/{group}/lesson",
    operation_id="getLesson",
    response_model=LessonDocument,
    responses=responses(404),
)
@may(Action.READ, group=OwnedKind.GROUP)
@limit(LOOKS)
def get_lesson(group: Id, services: AppServices) -> PracticeLesson:
    """What a practice group asks, and whether it was answered rightly; 404 for other groups."""
    return read_lesson(services.settings, load(services.store, group))
