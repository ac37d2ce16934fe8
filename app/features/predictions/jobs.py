"""The jobs that evaluate predictions and accept them; a server that starts again takes them up."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import asdict
from functools import partial
from typing import Any

from app.db.json_columns import Json
from app.db.store import Store
from app.features.datasets.service import get_dataset_head
from app.features.jobs.job_run import JobProgress, run_job_in_worker
from app.features.jobs.queries import Job
from app.features.jobs.service import Jobs
from app.features.predictions.accept import (
    AcceptReport,
    AcceptRequest,
    accept_predicted_balls,
    plan_accept,
)
from app.features.predictions.evaluation import list_evaluations
from app.features.predictions.evaluation_run import (
    EvaluationRequest,
    require_valid_evaluation_request,
    run_evaluation,
)
from app.features.predictions.queries import StoredEvaluation
from app.progress import ReportProgress

EVALUATE, ACCEPT = "evaluate", "bulk"


def request_evaluation(
    jobs: Jobs, store: Store, dataset: str, request: EvaluationRequest, *, actor: str
) -> Job:
    """Evaluate, soon; what can be refused is refused at once.

    Raises:
        InputError, NotFoundError: As ``run_evaluation`` does.
    """
    found = get_dataset_head(store, dataset)
    require_valid_evaluation_request(store, found.id, request)
    return jobs.submit(
        EVALUATE,
        f"Evaluate {request.name or 'predictions'} on {found.name}",
        partial(run_evaluation_job, store),
        dataset_id=found.id,
        actor=actor,
        request=asdict(request),
    )


def request_accept(
    jobs: Jobs, store: Store, dataset: str, request: AcceptRequest, *, actor: str
) -> Job:
    """Accept predictions, soon.

    Raises:
        InputError, NotFoundError: As ``plan_accept`` does.
    """
    found = get_dataset_head(store, dataset)
    plan = plan_accept(store, found.id, request)
    return jobs.submit(
        ACCEPT,
        f"Accept {len(plan.changes)} predictions of {plan.predictions.name}",
        partial(run_accept_job, store),
        dataset_id=found.id,
        actor=actor,
        request={"accept": asdict(request)},
    )


def register_prediction_jobs(jobs: Jobs, store: Store) -> None:
    """Let evaluations that an earlier server was at go on, and another process accept predictions
    than the one that was asked."""

    def resume_evaluation(progress: JobProgress) -> Json:
        # The server may have stopped between the result and the record of its job.
        done = _find_evaluation_of_job(store, progress.job)
        return run_evaluation_job(store, progress) if done is None else make_evaluation_result(done)

    jobs.register_resume(EVALUATE, resume_evaluation)
    jobs.register_work(ACCEPT, partial(run_accept_job, store))


def run_evaluation_job(store: Store, progress: JobProgress) -> Json:
    """The work of evaluating; its result names the evaluation."""
    request = EvaluationRequest(**progress.job.request)
    return _run_in_worker(store, "evaluating", "the evaluation", _run_evaluation, request, progress)


def run_accept_job(store: Store, progress: JobProgress) -> Json:
    """The work of accepting; its result counts what changed."""
    values = progress.job.request["accept"]
    views = None if values["views"] is None else tuple(values["views"])
    request = AcceptRequest(**{**values, "views": views})
    return _run_in_worker(store, "accepting", "the acceptance", _run_accept, request, progress)


def _run_in_worker(
    store: Store,
    kind: str,
    what: str,
    work: Callable[..., Json],
    request: object,
    progress: JobProgress,
) -> Json:
    where, actor = progress.dataset_id, progress.job.actor
    return run_job_in_worker(
        store, kind, what, work, where, request, actor, dataset_id=where, progress=progress
    )


def _run_evaluation(
    store: Store, dataset_id: int, request: EvaluationRequest, actor: str, progress: ReportProgress
) -> Json:
    return make_evaluation_result(
        run_evaluation(store, dataset_id, request, actor=actor, progress=progress)
    )


def _run_accept(
    store: Store, dataset_id: int, request: AcceptRequest, actor: str, progress: ReportProgress
) -> Json:
    return make_accept_result(
        accept_predicted_balls(store, dataset_id, request, actor=actor, progress=progress)
    )


def make_evaluation_result(found: StoredEvaluation) -> dict[str, Any]:
    """The result of an evaluation job."""
    return {"evaluation": found.id, "name": found.name, "counts": found.counts}


def make_accept_result(report: AcceptReport) -> dict[str, Any]:
    """The result of an acceptance job."""
    return {"changed": report.views, "groups": report.groups, "refused": dict(report.refused)}


def _find_evaluation_of_job(store: Store, job: Job) -> StoredEvaluation | None:
    request = EvaluationRequest(**job.request)
    wanted = (request.predictions, request.careful, request.version, request.split, request.boxes)
    for item in list_evaluations(store, job.dataset_id or 0):
        pins = item.pins
        sets = (item.prediction_set_id, item.careful_set_id, item.version_id)
        same = (*sets, pins.get("split"), pins.get("boxes")) == wanted
        if item.created >= job.created and same:
            return item
    return None
