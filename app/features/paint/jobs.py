"""Jobs that read the paint of pictures, and that propose cameras from it."""

from __future__ import annotations

from dataclasses import asdict

from app.db.json_columns import Json
from app.db.store import Store
from app.features.datasets.service import dataset_id
from app.features.jobs.job_run import JobProgress, make_counts_reporter
from app.features.jobs.service import Jobs
from app.features.match_estimates.jobs import MatchJobContext, MatchJobType
from app.features.paint.proposals import forget_proposals, propose_cameras_for_views
from app.features.paint.service import (
    read_paint_of_pictures,
    require_paint_in_use,
    undo_paint_reading,
)

REPORTED = (
    *("views", "without_picture", "read"),
    *("painted", "no_paint", "paint_disagrees", "no_frame"),
)
"""What a result counts of all matches."""


def _run_paint_job(call: MatchJobContext, progress: JobProgress) -> Json:
    try:
        found = read_paint_of_pictures(
            call.store,
            call.dataset_id,
            call.matches,
            actor=call.job.actor,
            run=call.job.request["run"],
            progress=make_counts_reporter(progress, "groups looked at"),
            require_wanted=progress.require_not_cancelled,
        )
    finally:
        # What some groups were given before it ended is solved, however it ended.
        call.request_solve_of_stale_groups()
    return {name: sum(getattr(item, name) for item in found.items) for name in REPORTED}


PAINT = MatchJobType(
    "paint",
    "Read the paint of the pictures of {}",
    _run_paint_job,
    require_paint_in_use,
    undo_paint_reading,
    has_runs=True,
)


def cancel_and_forget_proposals(jobs: Jobs, store: Store, dataset: str | int) -> int:
    """``forget_proposals``, and no search that was asked for before keeps anything after it.

    Raises:
        NotFoundError: There is no such dataset.
    """
    number = dataset_id(store, dataset)
    # Told before the transaction begins: what a search keeps in one before it is forgotten in it.
    jobs.cancel_kind(number, PROPOSALS.kind)
    return forget_proposals(store, number)


def _run_proposal_job(call: MatchJobContext, progress: JobProgress) -> Json:
    run = propose_cameras_for_views(
        call.store,
        call.dataset_id,
        call.matches,
        progress=make_counts_reporter(progress, "views looked at"),
        require_wanted=progress.require_not_cancelled,
    )
    return asdict(run)


PROPOSALS = MatchJobType(
    "proposals", "Propose cameras for views of {} that have none", _run_proposal_job
)
