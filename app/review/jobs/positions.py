"""The job that shares the positions of main cameras, and solves what that leaves stale."""

from __future__ import annotations

from app.review.editing.positions import apply_take_back, require_sharable, share_positions
from app.review.jobs.jobs import Jobs
from app.review.jobs.matches import MatchesAsked, MatchJob
from app.review.jobs.run import JobProgress, counting
from app.review.jobs.solve import request_solve
from app.store.jobs import Job
from app.store.session import Session
from app.store.store import Store
from app.store.stored_json import Json


def take_positions_back(
    jobs: Jobs, store: Store, dataset: str | int, match: str, *, actor: str
) -> Job:
    """Take shared positions of a match back, and solve its dataset, soon.

    A share of it, or of all matches, that waits or runs is cancelled and gives nothing afterwards;
    it is the last one.

    Raises:
        ConflictError, NotFoundError: As ``editing.positions.take_back_positions`` does.
    """

    def apply(session: Session, number: int, present: list[Job]) -> list[Job]:
        ended = [job for job in present if job.request["match"] in (None, match)]
        stopped = [job.started for job in ended]
        apply_take_back(session, number, match, actor=actor, stopped=stopped)
        return ended

    return POSITIONS.take_back(jobs, store, dataset, apply, actor=actor)


def _share(asked: MatchesAsked, progress: JobProgress) -> Json:
    try:
        with asked.jobs.pool() as executor:
            found = share_positions(
                asked.store,
                asked.dataset_id,
                asked.matches,
                actor=asked.actor,
                executor=executor,
                progress=counting(progress, "matches"),
                require_wanted=progress.require_wanted,
            )
    finally:
        # What some matches were given before it ended is solved, however it ended.
        request_solve(asked.jobs, asked.store, asked.dataset_id, actor=asked.actor)
    return {"matches": len(found.items), "shared": sum(item.shared for item in found.items)}


POSITIONS = MatchJob(
    "positions", "Share the main cameras' positions of {}", _share, require_sharable
)
