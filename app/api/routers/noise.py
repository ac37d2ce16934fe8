"""Noise: how far clicks of a dataset are off, as its own residuals tell."""

from __future__ import annotations

from fastapi import APIRouter

from app.api.deps import Actor, AppServices, DatasetPath
from app.api.jobs import by_job, job_answer
from app.api.problem import responses
from app.api.respond import responds
from app.api.schemas.noise import NoiseDocument
from app.review.jobs.noise import request_noise, request_noise_back
from app.review.jobs.records import Job
from app.review.policies.noise import Noise

router = APIRouter(prefix="/datasets/{dataset}/noise", tags=["policies"])


@router.get("", operation_id="getNoise", response_model=NoiseDocument, responses=responses(404))
def get_noise(dataset: DatasetPath, services: AppServices) -> Noise:
    """Sigma of balls, given cameras and field lines with intervals, and what the policy says.

    Changes nothing: to judge by the estimates, `POST` here, or send `values` alone to the dataset's
    policy.
    """
    return services.noises.read(dataset)


@router.post(
    "",
    operation_id="acceptNoise",
    **by_job(404, 412),
)
@responds(job_answer)
def accept_noise(dataset: DatasetPath, services: AppServices, actor: Actor) -> Job:
    """Judge by the estimates: `values` go into the policy, `factors` to the balls; the job solves.

    A ball that is placed later has the factor of its camera and of who places it.
    """
    found = services.noises.read(dataset)
    return request_noise(services.jobs, services.store, found, actor=actor)


@router.delete(
    "",
    operation_id="takeNoiseBack",
    **by_job(404),
)
@responds(job_answer)
def take_noise_back(dataset: DatasetPath, services: AppServices, actor: Actor) -> Job:
    """Take the balls of all cameras and people to be as noisy as the dataset's; the job solves.

    The policy stays as it is.
    """
    return request_noise_back(services.jobs, services.store, dataset, actor=actor)
