"""Pictures of matches: the job that estimates what was done to them, and the one after a change."""

from __future__ import annotations

from collections.abc import Mapping

from app.review.datasets.dataset import dataset_id
from app.review.editing.pictures import apply_pictures, estimate_pictures
from app.review.jobs.jobs import Jobs
from app.review.jobs.matches import MatchesAsked, MatchJob
from app.review.jobs.run import JobProgress, counting
from app.review.jobs.solve import solve_after
from app.soccer.picture import PictureGeometry
from app.store.codecs import picture_to_json
from app.store.jobs import Job
from app.store.session import Session
from app.store.store import Store
from app.store.stored_json import Json


def request_pictures(
    jobs: Jobs,
    store: Store,
    dataset: str | int,
    wanted: Mapping[str, PictureGeometry | None],
    *,
    actor: str,
) -> Job:
    """Say what main cameras' pictures of matches are, and solve what that leaves stale, soon.

    Raises:
        NotFoundError: There is no such dataset or match.
    """
    number = dataset_id(store, dataset)

    def change(session: Session, job: Job) -> Job:
        apply_pictures(session, number, wanted, actor=actor)
        return job

    return solve_after(jobs, store, number, change, actor=actor)


def _estimate(asked: MatchesAsked, progress: JobProgress) -> Json:
    with asked.jobs.pool() as executor:
        told = counting(progress, "matches")
        found = estimate_pictures(asked.store, asked.dataset_id, executor, told, asked.matches)
    return {
        "items": [
            {
                "match": item.match,
                "frames": item.frames,
                "estimate": None
                if item.estimate is None
                else picture_to_json(item.estimate.picture),
                "proposed": picture_to_json(item.proposed),
                "sentence": item.sentence,
            }
            for item in found
        ]
    }


PICTURES = MatchJob("pictures", "Estimate the pictures of {}", _estimate)
