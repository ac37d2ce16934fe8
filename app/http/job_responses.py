"""What every route that starts a job answers: 202, where to look, and the job."""

from __future__ import annotations

from typing import Any

from fastapi import Response

from app.features.jobs.queries import Job
from app.features.jobs.schemas import JobDocument
from app.http.problem import Responses, responses
from app.http.respond import document

ACCEPTED: Responses = {
    202: {
        "description": "The job that does it.",
        "headers": {"Location": {"description": "Of the job.", "schema": {"type": "string"}}},
    }
}


def job_address(job: Job) -> dict[str, str]:
    """The header that says where a job is looked at."""
    return {"Location": f"/api/v1/jobs/{job.id}"}


def job_answer(job: Job) -> Response:
    """The answer of a job that was started."""
    return document(JobDocument.model_validate(job), 202, job_address(job))


def by_job(*statuses: int) -> dict[str, Any]:
    """What a route says of itself that answers 202 with a job.

    Args:
        statuses: Of its refusals.
    """
    answers = {**responses(*statuses), **ACCEPTED}
    return {"status_code": 202, "response_model": JobDocument, "responses": answers}
