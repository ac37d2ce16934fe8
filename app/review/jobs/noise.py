"""Accepting a dataset's noise, and the job that solves what that leaves stale."""

from __future__ import annotations

from app.review.datasets.dataset import dataset_id
from app.review.editing.ball_noise import give_factors
from app.review.jobs.jobs import Jobs
from app.review.jobs.solve import solve_after
from app.review.policies.noise import Noise, accept_noise
from app.review.policies.policy import read_policy
from app.store.jobs import Job
from app.store.session import Session
from app.store.store import Store


def request_noise(jobs: Jobs, store: Store, noise: Noise, *, actor: str) -> Job:
    """Judge a dataset by the noise that was estimated, and solve it, soon.

    Raises:
        StaleRevisionError: The policy is another by now.
    """
    state = read_policy(store, noise.dataset_id)

    def change(session: Session, job: Job) -> Job:
        accept_noise(session, noise, state, actor)
        return job

    return solve_after(jobs, store, noise.dataset_id, change, actor=actor)


def request_noise_back(jobs: Jobs, store: Store, dataset: str | int, *, actor: str) -> Job:
    """Take all balls to be as noisy as their dataset's, and solve it, soon.

    Raises:
        NotFoundError: There is no such dataset.
    """
    number = dataset_id(store, dataset)

    def change(session: Session, job: Job) -> Job:
        give_factors(session, number, (), actor)
        return job

    return solve_after(jobs, store, number, change, actor=actor)
