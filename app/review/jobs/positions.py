"""The job that shares the positions of main cameras, and solves what that leaves stale."""

from __future__ import annotations

from contextlib import nullcontext

from app.review.datasets.dataset import dataset_id
from app.review.editing.positions import apply_take_back, require_sharable, share_positions
from app.review.jobs.job_run import JobProgress, Work, counting
from app.review.jobs.jobs import Jobs
from app.review.jobs.solve import request_solve, solve_after
from app.store.answers import Keep, keep_nothing
from app.store.codecs import Json
from app.store.jobs import Job
from app.store.session import Session, Store

KIND = "positions"


def request_positions(
    jobs: Jobs,
    store: Store,
    dataset: str | int,
    match: str | None,
    *,
    actor: str,
    keep: Keep[Job] = keep_nothing,
) -> Job:
    """Share positions in a match, or wherever what it is estimated from has changed, soon.

    Raises:
        ConflictError, NotFoundError: As ``editing.positions.share_positions`` does, at once.
    """
    matches = None if match is None else [match]
    found = require_sharable(store, dataset, matches)
    return jobs.submit(
        KIND,
        f"Share the main cameras' positions of {found.name}",
        _work(jobs, store, found.id, matches, actor),
        dataset_id=found.id,
        actor=actor,
        keep=keep,
    )


def take_positions_back(
    jobs: Jobs,
    store: Store,
    dataset: str | int,
    match: str,
    *,
    actor: str,
    keep: Keep[Job] = keep_nothing,
) -> Job:
    """Take shared positions of a match back, and solve its dataset, soon.

    Raises:
        ConflictError, NotFoundError: As ``editing.positions.take_back_positions`` does.
    """
    number = dataset_id(store, dataset)

    def change(session: Session, job: Job) -> Job:
        apply_take_back(session, number, match, actor=actor)
        return job

    return solve_after(jobs, store, number, change, actor=actor, keep=keep)


def _work(jobs: Jobs, store: Store, dataset: int, matches: list[str] | None, actor: str) -> Work:
    def work(progress: JobProgress) -> Json:
        told = counting(progress, "matches")
        try:
            with jobs.pool() if jobs.pool is not None else nullcontext() as executor:
                found = share_positions(
                    store, dataset, matches, actor=actor, executor=executor, progress=told
                )
        finally:
            # What some matches were given before it ended is solved, however it ended.
            request_solve(jobs, store, dataset, actor=actor)
        return {"matches": len(found.items), "shared": sum(item.shared for item in found.items)}

    return work
