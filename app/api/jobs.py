"""What every route that starts a job answers: 202, where to look, and the job."""

from __future__ import annotations

from fastapi import Response

from app.api.problem import Responses
from app.api.reply import document
from app.api.schemas.job import JobDocument
from app.store.jobs import Job

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


def accepted(job: Job, response: Response) -> JobDocument:
    """The document of a job that was started, its address in the header."""
    response.status_code = 202
    response.headers.update(job_address(job))
    return JobDocument.model_validate(job)
