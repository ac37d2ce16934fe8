"""Practice: eight groups with known answers, a recording with known faults, and what was said to them."""

from __future__ import annotations

from typing import Annotated, Literal

from fastapi import APIRouter, Depends, Request
from pydantic import AliasPath, Field

from app.features.groups.submit import load_group_state
from app.features.jobs.queries import Job
from app.features.jobs.schemas import describe_job_response_for_openapi, make_job_response
from app.features.practice.recording import RecordingPractice, read_recording_practice
from app.features.practice.service import (
    Practice,
    PracticeLesson,
    read_lesson,
    read_practice,
    request_practice,
)
from app.http.access import get_current_login
from app.http.deps import Actor, AppServices, Id, Sees
from app.http.documents import Document, RequestBody, respond_with
from app.http.permissions import Action, OwnedKind, RoleScope, may
from app.http.route import Route

LessonState = Literal["open", "mended", "right", "almost", "wrong"]


router = APIRouter(tags=["practice"], route_class=Route)


class StartPracticeRequest(RequestBody):
    """How the practice begins."""

    again: bool = Field(
        default=False, description="Forget verdicts and edits of the lessons and begin again."
    )


class LessonDocument(Document):
    """One practice group as a lesson."""

    group: int
    number: int = Field(description="From 1.")
    total: int
    title: str
    question: str = Field(description="What to look for; does not give the answer away.")
    hint: str = Field(description="A hint where to look.")
    verdict: str
    state: LessonState = Field(
        validation_alias=AliasPath("feedback", "state"),
        description="`mended`: edited rightly and not judged yet. Weighed against what the "
        "generator planted, never against what the solver found.",
    )
    feedback: str | None = Field(
        validation_alias=AliasPath("feedback", "sentence"),
        description="Whether the answer was right, and why.",
    )
    best: str | None = Field(
        validation_alias=AliasPath("feedback", "best"),
        description="What would have been best, once the group is judged.",
    )


class PracticeDocument(Document):
    """The practice dataset; no lessons until it is made."""

    dataset: str
    lessons: list[LessonDocument]


async def _find_practice_person(request: Request) -> str | None:
    """Whose practice it is; None where nobody logs in."""
    login = get_current_login(request.scope)
    return None if login is None else login.name


Person = Annotated[str | None, Depends(_find_practice_person)]


@router.get("/practice", response_model=PracticeDocument)
@may(Action.READ, where=RoleScope.SOMEWHERE)
def get_practice(services: AppServices, visibility: Sees, person: Person) -> Practice:
    """Every lesson and what has come of it; none until the practice is made.

    Where people log in, each has lessons of their own.
    """
    return read_practice(services.store, services.settings, visibility, person)


@router.post("/practice", **describe_job_response_for_openapi(409))
@may(Action.ANNOTATE, where=RoleScope.OWN)
@respond_with(make_job_response)
def start_practice(
    request: StartPracticeRequest, services: AppServices, actor: Actor, person: Person
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


@router.get("/practice/recording")
@may(Action.READ, where=RoleScope.SOMEWHERE)
def get_recording_practice(
    services: AppServices, visibility: Sees, person: Person
) -> RecordingPractice:
    """The practice recording: what is right of its shots, its cameras and the link of its replay."""
    return read_recording_practice(services.store, services.settings, visibility, person)


@router.post("/practice/recording", **describe_job_response_for_openapi(409))
@may(Action.ANNOTATE, where=RoleScope.OWN)
@respond_with(make_job_response)
def start_recording_practice(
    request: StartPracticeRequest, services: AppServices, actor: Actor, person: Person
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


@router.get("/groups/{group}/lesson", response_model=LessonDocument)
@may(Action.READ, group=OwnedKind.GROUP)
def get_lesson(group: Id, services: AppServices) -> PracticeLesson:
    """What a practice group asks, and whether it was answered rightly; 404 for other groups."""
    return read_lesson(services.settings, load_group_state(services.store, group))
