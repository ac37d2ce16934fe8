"""The job that looks for cameras to propose; nothing is solved, for nothing counts yet."""

from __future__ import annotations

from dataclasses import asdict

from app.review.editing.proposals import propose_views, require_matches
from app.review.jobs.job_run import JobProgress, Work, counting
from app.review.jobs.jobs import Jobs
from app.store.answers import Keep, keep_nothing
from app.store.codecs import Json
from app.store.jobs import Job
from app.store.session import Store

KIND = "proposals"


def request_proposals(
    jobs: Jobs,
    store: Store,
    dataset: str | int,
    match: str | None,
    *,
    actor: str,
    keep: Keep[Job] = keep_nothing,
) -> Job:
    """Look at the pictures of a match's views without lines, or of all, soon.

    Raises:
        NotFoundError: There is no such dataset or match, which is said at once.
    """
    found = require_matches(store, dataset, None if match is None else [match])
    request = {"match": match}
    return jobs.submit(
        KIND,
        f"Propose cameras for views of {found.dataset} without lines",
        _work(store, found.dataset_id, request),
        dataset_id=found.dataset_id,
        actor=actor,
        request=request,
        keep=keep,
    )


def resume_proposals(jobs: Jobs, store: Store) -> None:
    """Let a search that an earlier server was at go on: what was looked at is left alone."""
    jobs.resumes(KIND, lambda job: _work(store, job.dataset_id or 0, job.request))


def _work(store: Store, dataset: int, request: Json) -> Work:
    def work(progress: JobProgress) -> Json:
        told = counting(progress, "views looked at")
        matches = None if request["match"] is None else [request["match"]]
        return asdict(propose_views(store, dataset, matches, progress=told))

    return work
