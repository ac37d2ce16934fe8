"""The job that looks for cameras to propose; nothing is solved, for nothing counts yet."""

from __future__ import annotations

from dataclasses import asdict

from app.review.datasets.dataset import dataset_id
from app.review.editing.proposals import forget_proposals, propose_views
from app.review.jobs.jobs import Jobs
from app.review.jobs.matches import MatchesAsked, MatchJob
from app.review.jobs.run import JobProgress, counting
from app.store.store import Store
from app.store.stored_json import Json


def stop_and_forget(jobs: Jobs, store: Store, dataset: str | int) -> int:
    """``forget_proposals``, and no search that was asked for before keeps anything after it.

    Raises:
        NotFoundError: There is no such dataset.
    """
    number = dataset_id(store, dataset)
    # Told before the transaction begins: what a search keeps in one before it is forgotten in it.
    jobs.cancel_kind(number, PROPOSALS.kind)
    return forget_proposals(store, number)


def _propose(asked: MatchesAsked, progress: JobProgress) -> Json:
    run = propose_views(
        asked.store,
        asked.dataset_id,
        asked.matches,
        progress=counting(progress, "views looked at"),
        require_wanted=progress.require_wanted,
    )
    return asdict(run)


PROPOSALS = MatchJob("proposals", "Propose cameras for views of {} that have none", _propose)
