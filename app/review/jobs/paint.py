"""The job that reads the paint of pictures, and solves what that leaves stale."""

from __future__ import annotations

from app.review.editing.paint import apply_take_back, read_paint, require_readable
from app.review.jobs.jobs import Jobs
from app.review.jobs.matches import MatchesAsked, MatchJob
from app.review.jobs.run import JobProgress, counting
from app.review.jobs.solve import request_solve
from app.store.jobs import Job
from app.store.session import Session
from app.store.store import Store
from app.store.stored_json import Json

TOLD = (
    *("views", "without_picture", "read"),
    *("painted", "no_paint", "paint_disagrees", "no_frame"),
)
"""What a result counts of all matches."""


def take_paint_back(jobs: Jobs, store: Store, dataset: str | int, *, actor: str) -> Job:
    """Take the last reading of a dataset's paint back, and solve it, soon.

    One that waits or runs is cancelled and gives nothing afterwards; it is the last one.

    Raises:
        ConflictError, NotFoundError: As ``editing.paint.take_back_paint`` does.
    """

    def apply(session: Session, number: int, present: list[Job]) -> list[Job]:
        stopped = {job.request["run"] for job in present}
        apply_take_back(session, number, actor=actor, stopped=stopped)
        return present

    return PAINT.take_back(jobs, store, dataset, apply, actor=actor)


def _read(asked: MatchesAsked, progress: JobProgress) -> Json:
    try:
        found = read_paint(
            asked.store,
            asked.dataset_id,
            asked.matches,
            actor=asked.actor,
            run=asked.run,
            progress=counting(progress, "groups looked at"),
            require_wanted=progress.require_wanted,
        )
    finally:
        # What some groups were given before it ended is solved, however it ended.
        request_solve(asked.jobs, asked.store, asked.dataset_id, actor=asked.actor)
    return {name: sum(getattr(item, name) for item in found.items) for name in TOLD}


PAINT = MatchJob(
    "paint", "Read the paint of the pictures of {}", _read, require_readable, has_runs=True
)
