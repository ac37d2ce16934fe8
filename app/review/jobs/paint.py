"""The job that reads the paint of pictures, and solves what that leaves stale."""

from __future__ import annotations

from app.review.datasets.dataset import dataset_id
from app.review.editing.paint import apply_take_back, read_paint, require_readable
from app.review.jobs.job_run import JobProgress, Work, counting
from app.review.jobs.jobs import Jobs
from app.review.jobs.solve import request_solve, solve_after
from app.store.answers import Keep, keep_nothing
from app.store.clock import now
from app.store.codecs import Json
from app.store.jobs import Job
from app.store.session import Session, Store

KIND = "paint"
TOLD = (
    *("views", "without_picture", "read"),
    *("painted", "no_paint", "paint_disagrees", "no_frame"),
)
"""What a result counts of all matches."""


def request_paint(
    jobs: Jobs,
    store: Store,
    dataset: str | int,
    match: str | None,
    *,
    actor: str,
    keep: Keep[Job] = keep_nothing,
) -> Job:
    """Read the paint of a match's pictures, or of all, soon.

    Raises:
        ConflictError, NotFoundError: As ``editing.paint.read_paint`` does, at once.
    """
    found, _ = require_readable(store, dataset, None if match is None else [match])
    request = {"match": match, "run": now()}
    return jobs.submit(
        KIND,
        f"Read the paint of the pictures of {found.name}",
        _work(jobs, store, found.id, request, actor),
        dataset_id=found.id,
        actor=actor,
        request=request,
        keep=keep,
    )


def resume_reading(jobs: Jobs, store: Store) -> None:
    """Let readings that an earlier server was at go on: what is read already is left alone."""
    jobs.resumes(KIND, lambda job: _work(jobs, store, job.dataset_id or 0, job.request, job.actor))


def take_paint_back(
    jobs: Jobs,
    store: Store,
    dataset: str | int,
    *,
    actor: str,
    keep: Keep[Job] = keep_nothing,
) -> Job:
    """Take the last reading of a dataset's paint back, and solve it, soon.

    Raises:
        ConflictError, NotFoundError: As ``editing.paint.take_back_paint`` does.
    """
    number = dataset_id(store, dataset)

    def change(session: Session, job: Job) -> Job:
        apply_take_back(session, number, actor=actor)
        return job

    return solve_after(jobs, store, number, change, actor=actor, keep=keep)


def _work(jobs: Jobs, store: Store, dataset: int, request: Json, actor: str) -> Work:
    def work(progress: JobProgress) -> Json:
        told = counting(progress, "groups looked at")
        matches = None if request["match"] is None else [request["match"]]
        try:
            found = read_paint(
                store, dataset, matches, actor=actor, run=request["run"], progress=told
            )
        finally:
            # What some groups were given before it ended is solved, however it ended.
            request_solve(jobs, store, dataset, actor=actor)
        return {name: sum(getattr(item, name) for item in found.items) for name in TOLD}

    return work
