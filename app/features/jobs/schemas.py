"""Documents of jobs, and the response of routes that start one."""

from __future__ import annotations

from datetime import datetime
from typing import Any, Literal

from fastapi import Response
from pydantic import Field

from app.features.jobs.queries import Job
from app.http.documents import Document, ListDocument, make_document_response
from app.http.problem import Responses, responses
from app.soccer.choices import JobState

JobKind = Literal[
    "solve",
    "import",
    "export",
    "freeze",
    "verify",
    "evaluate",
    "detect",
    "bulk",
    "practice",
    "rig",
    "positions",
    "paint",
    "proposals",
    "pictures",
    "recording",
    "instants",
    "ball",
    "track",
    "link",
]


ACCEPTED: Responses = {
    202: {
        "description": "The job that does it.",
        "headers": {"Location": {"description": "Of the job.", "schema": {"type": "string"}}},
    }
}


class JobProblem(Document):
    """Why a job failed."""

    detail: str
    hint: str | None
    pointer: str | None


class JobSubject(Document):
    """What a job works on."""

    recording: int | None = Field(default=None, description="Id of the recording.")
    first: int | None = Field(default=None, description="First of its frames; null: all of them.")
    last: int | None = Field(default=None, description="Last of its frames; null: all of them.")
    link: int | None = Field(default=None, description="Id of the link of a replay.")
    practice: Literal["groups", "recording"] | None = Field(
        default=None, description="Which practice it makes."
    )


class JobDocument(Document):
    """A job as it stands."""

    id: int
    kind: JobKind
    title: str = Field(description="What the job does, in a sentence.")
    dataset: str | None = Field(description="Name of the dataset that it works on.")
    state: JobState
    done: int
    total: int | None = Field(description="How much there is to do; null while that is unknown.")
    sentence: str = Field(description="What the job is doing now, in a sentence.")
    result: Any = Field(description="The result; its fields depend on the kind.")
    problem: JobProblem | None
    created: datetime
    started: datetime | None
    ended: datetime | None
    actor: str
    subject: JobSubject | None = Field(
        description="The part of a recording, or the practice, that it works on; null: it is about something else."
    )


class JobPage(ListDocument[JobDocument]):
    """Jobs, the newest first; ``next`` is the cursor of the next page."""


def make_location_header(job: Job) -> dict[str, str]:
    """The header that says where a job is looked at."""
    return {"Location": f"/api/v1/jobs/{job.id}"}


def make_job_response(job: Job) -> Response:
    """The answer of a job that was started."""
    return make_document_response(JobDocument.model_validate(job), 202, make_location_header(job))


def describe_job_response_for_openapi(*statuses: int) -> dict[str, Any]:
    """What a route says of itself that answers 202 with a job.

    Args:
        statuses: Of its refusals.
    """
    answers = {**responses(*statuses), **ACCEPTED}
    return {"status_code": 202, "response_model": JobDocument, "responses": answers}
