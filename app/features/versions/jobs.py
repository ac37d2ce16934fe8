"""The jobs that freeze a dataset and verify a version; a server that starts again takes them up."""

from __future__ import annotations

from functools import partial
from typing import Any

from app.db.json_columns import Json
from app.db.store import Store
from app.errors import OverloadedError
from app.features.datasets.service import get_dataset_head
from app.features.jobs.job_run import JobProgress, run_job_in_worker
from app.features.jobs.queries import DONE, Job
from app.features.jobs.service import Jobs
from app.features.versions.freeze import FreezeRequest, freeze_dataset, plan_freeze
from app.features.versions.service import FREEZE, Version, get_version, list_versions
from app.features.versions.verify import save_verify_failure, verify_and_save_report
from app.progress import ReportProgress
from app.soccer.split import Split
from app.worker_process import WorkerEnded

VERIFY = "verify"
MOST_LOOKED_AT = 1000
"""Jobs that are done, of those a server looks through that starts again."""


def request_freeze(
    jobs: Jobs, store: Store, dataset: str, request: FreezeRequest, *, actor: str
) -> Job:
    """Freeze a dataset, soon; what can be refused is refused at once.

    Raises:
        InputError, ConflictError: As ``freeze_dataset`` does.
    """
    found = get_dataset_head(store, dataset)
    plan_freeze(store, found.id, request, strict=True)
    return jobs.submit(
        FREEZE,
        f"Freeze {found.name} as {_make_job_title(request)}",
        partial(run_freeze_job, store),
        dataset_id=found.id,
        actor=actor,
        request={**vars(request), "split": request.split.to_plain_values()},
    )


def request_verify(jobs: Jobs, store: Store, version_id: int, *, actor: str) -> Job:
    """Verify a version, soon."""
    version = get_version(store, version_id)
    return jobs.submit(
        VERIFY,
        f"Verify {version.name} of {version.dataset}",
        partial(run_verify_job, store),
        dataset_id=version.dataset_id,
        actor=actor,
        request={"version": version_id},
    )


def register_version_jobs(jobs: Jobs, store: Store) -> None:
    """Let freezing and verifying that an earlier server was at go on."""

    def resume_freeze(progress: JobProgress) -> Json:
        # The server may have stopped between the version and the record of its job.
        done = _find_version_of_job(jobs, store, progress.job, _request_from_job(progress.job))
        return run_freeze_job(store, progress) if done is None else make_version_result(done)

    jobs.register_resume(FREEZE, resume_freeze)
    jobs.register_resume(VERIFY, partial(run_verify_job, store))


def run_freeze_job(store: Store, progress: JobProgress) -> Json:
    """The work of freezing; its result names the version."""
    job, request = progress.job, _request_from_job(progress.job)
    progress(0, None, f"Freezing {_make_job_title(request)}.")
    return run_job_in_worker(
        store,
        "freezing",
        "the freeze",
        _freeze_in_worker,
        progress.dataset_id,
        request,
        job.actor,
        dataset_id=progress.dataset_id,
        progress=progress,
    )


def run_verify_job(store: Store, progress: JobProgress) -> Json:
    """The work of verifying; its result is the report, which the version keeps, too."""
    version, actor = get_version(store, progress.job.request["version"]), progress.job.actor
    progress(0, None, f"Verifying {version.name}.")
    try:
        return run_job_in_worker(
            store,
            "verifying",
            "the verification",
            _verify_in_worker,
            version.id,
            actor,
            dataset_id=version.dataset_id,
            progress=progress,
        )
    except OverloadedError as error:
        # A process that ended did not come to keeping it; one that never began says nothing.
        if isinstance(error.__cause__, WorkerEnded):
            save_verify_failure(store, version.id, error.message, actor=actor)
        raise


def make_version_result(version: Version) -> dict[str, Any]:
    """The result of a freeze job."""
    return {
        "version": version.id,
        "name": version.name,
        "hash": version.hash,
        "counts": dict(version.counts),
    }


def _freeze_in_worker(
    store: Store, dataset_id: int, request: FreezeRequest, actor: str, progress: ReportProgress
) -> Json:
    return make_version_result(
        freeze_dataset(store, dataset_id, request, actor=actor, progress=progress)
    )


def _verify_in_worker(store: Store, version_id: int, actor: str, progress: ReportProgress) -> Json:
    report = verify_and_save_report(store, version_id, progress=progress, actor=actor)
    return {"version_id": version_id, **report.to_values()}


def _request_from_job(job: Job) -> FreezeRequest:
    return FreezeRequest(**{**job.request, "split": Split.of(job.request["split"])})


def _make_job_title(request: FreezeRequest) -> str:
    return request.name or "the next version"


def _find_version_of_job(
    jobs: Jobs, store: Store, job: Job, request: FreezeRequest
) -> Version | None:
    """The version that a job has made already; None: it has made none."""
    dataset_id = job.dataset_id or 0
    done = jobs.find(dataset_id=dataset_id, kinds=(FREEZE,), states=(DONE,), limit=MOST_LOOKED_AT)
    others = {other.result["version"] for other in done}
    wanted = (job.actor, request.groups, request.split)
    made = [
        version
        for version in list_versions(store, dataset_id)
        if version.created >= job.created
        and version.id not in others
        and request.name in (None, version.name)
        and (version.actor, version.groups, version.split) == wanted
    ]
    return made[-1] if made else None
