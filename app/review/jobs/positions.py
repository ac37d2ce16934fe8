"""The job that shares the positions of main cameras, and solves what that leaves stale."""

from __future__ import annotations

from app.review.editing.positions import require_sharable, share_positions, take_back_positions
from app.review.jobs.job_run import JobProgress, Work, counting
from app.review.jobs.jobs import Jobs
from app.review.jobs.solve import request_solve
from app.store.answers import Keep, keep_nothing
from app.store.codecs import Json
from app.store.jobs import Job
from app.store.session import Store

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
    """Share positions in a match, or wherever lines have changed since, soon.

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
    jobs: Jobs, store: Store, dataset: str | int, match: str, *, actor: str
) -> Job:
    """Take shared positions of a match back, and solve its dataset, soon.

    Raises:
        ConflictError, NotFoundError: As ``editing.positions.take_back_positions`` does.
    """
    found = take_back_positions(store, dataset, match, actor=actor)
    return request_solve(jobs, store, found.dataset_id, actor=actor)


def _work(jobs: Jobs, store: Store, dataset_id: int, matches: list[str] | None, actor: str) -> Work:
    def work(progress: JobProgress) -> Json:
        told = counting(progress, "matches")
        found = share_positions(store, dataset_id, matches, actor=actor, progress=told)
        request_solve(jobs, store, dataset_id, actor=actor)
        return {"matches": len(found.items), "shared": sum(item.shared for item in found.items)}

    return work
