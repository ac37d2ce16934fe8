"""Datasets: what there is, how far it is, and how its numbers are spread."""

from __future__ import annotations

from typing import Annotated

from fastapi import APIRouter, Query, Request, Response

from app.features.datasets import service as deletion
from app.features.datasets import service as review
from app.features.datasets.schemas import (
    DatasetDeletion,
    DatasetDocument,
    DatasetList,
    DeletedDocument,
    SummaryDocument,
)
from app.features.datasets.service import DatasetContents, read_contents
from app.features.jobs.queries import Job
from app.features.queue.service import summary
from app.features.solve.jobs import request_solve
from app.http.access import login_of
from app.http.cursor import paged
from app.http.deps import Actor, AppServices, AppStore, DatasetPath, QueryText, Sees
from app.http.job_responses import by_job, job_answer
from app.http.permissions import Action, OwnedKind, Where, may
from app.http.problem import responses
from app.http.respond import document, responds
from app.http.route import Route

router = APIRouter(prefix="/datasets", tags=["datasets"], route_class=Route)


@router.get("", operation_id="listDatasets", responses=responses())
@may(Action.READ, where=Where.SOMEWHERE)
@paged()
def list_datasets(request: Request, store: AppStore, visibility: Sees) -> DatasetList:
    """Every dataset that one sees, with its progress."""
    login = login_of(request.scope)
    own = () if login is None else login.roles.single.keys()
    return DatasetList(items=review.list_datasets(store, visibility, own))


@router.get(
    "/{dataset}",
    operation_id="getDataset",
    response_model=DatasetDocument,
    responses=responses(404),
)
@may(Action.READ, dataset=OwnedKind.DATASET)
def get_dataset(dataset: DatasetPath, store: AppStore) -> review.Dataset:
    """One dataset by name or id."""
    return review.get_dataset(store, dataset)


@router.get("/{dataset}/summary", operation_id="getSummary", responses=responses(404))
@may(Action.READ, dataset=OwnedKind.DATASET)
def get_summary(dataset: DatasetPath, store: AppStore, query: QueryText = "") -> SummaryDocument:
    """Progress and histograms over the groups that a query matches."""
    found = review.get_dataset_head(store, dataset)
    counted = summary(store, found.id, query)
    return SummaryDocument(progress=counted, histograms=counted.histograms)


@router.post("/{dataset}/solve", operation_id="solveDataset", **by_job(404))
@may(Action.LEAD, dataset=OwnedKind.DATASET)
@responds(job_answer)
def solve_dataset(dataset: DatasetPath, services: AppServices, actor: Actor) -> Job:
    """Solve what has no solution for its present state, policy and solver, as a job.

    The server does so by itself after whatever makes groups stale; this waits for it, too.
    """
    found = review.dataset_id(services.store, dataset)
    return request_solve(services.jobs, services.store, found, actor=actor)


def _deleted_response(gone: DatasetContents, dry_run: bool) -> Response:
    return document(DeletedDocument(dry_run=dry_run, **vars(gone)))


@router.delete(
    "/{dataset}",
    operation_id="deleteDataset",
    response_model=DeletedDocument,
    responses=responses(404, 409, 413, 415),
)
@may(Action.ADMINISTER, dataset=OwnedKind.DATASET)
@responds(_deleted_response, "dry_run")
def delete_dataset(
    dataset: DatasetPath,
    request: DatasetDeletion,
    services: AppServices,
    actor: Actor,
    dry_run: Annotated[bool, Query(description="Only report what would be deleted.")] = False,
) -> DatasetContents:
    """Delete a dataset with everything that belongs to it; `confirm` is its name, else 409.

    Its jobs are cancelled first. Cannot be undone; the log of what was said stays.
    """
    contents = read_contents(services.store, dataset)
    if not dry_run:
        exports = services.jobs.all_ids(dataset_id=contents.id, kind="export")
        if request.confirm == contents.name:
            services.jobs.cancel_all(contents.id)
        contents = deletion.delete_dataset(
            services.store, contents.id, confirm=request.confirm, actor=actor
        )
        for export in exports:
            services.exports.forget(str(export))
    return contents
