"""Datasets: what there is, how far it is, and how its numbers are spread."""

from __future__ import annotations

from datetime import datetime
from typing import Annotated

from fastapi import APIRouter, Query, Request, Response
from pydantic import AliasPath, BaseModel, Field

from app.features.datasets import service as deletion
from app.features.datasets import service as review
from app.features.datasets.service import Dataset, DatasetContents, read_contents
from app.features.jobs.queries import EXPORT, Job
from app.features.jobs.schemas import describe_job_response_for_openapi, make_job_response
from app.features.policies.schemas import PolicyDocument
from app.features.queue.service import summarize_groups
from app.features.solve.jobs import request_solve_job
from app.http.access import get_current_login
from app.http.cursor import paged
from app.http.deps import Actor, AppServices, AppStore, DatasetPath, QueryText, Sees, Services
from app.http.documents import (
    Document,
    ListDocument,
    RequestBody,
    make_document_response,
    respond_with,
)
from app.http.permissions import Action, OwnedKind, RoleScope, may
from app.http.problem import responses
from app.http.route import Route

router = APIRouter(prefix="/datasets", tags=["datasets"], route_class=Route)


class DatasetDocument(Document, shows=Dataset):
    """A dataset, its progress and its policy."""

    policy: PolicyDocument
    created: datetime
    hides_groups: bool = Field(
        description=(
            "Whether groups are hidden from the logged-in person until the batch that they "
            "annotate independently is closed; counts leave them out."
        )
    )


class DatasetList(ListDocument[DatasetDocument]):
    """Every dataset, by name."""


class Progress(Document):
    """How many groups match, and how far they are."""

    groups: int
    solved: int
    accepted: int
    rejected: int
    deferred: int
    unreviewed: int
    stale: int = Field(description="Changed after their verdict.")


class Histogram(Document):
    """Counts of one number over the groups that match.

    A bin holds what is at least its left edge and below its right one; the first one also what
    is smaller, the last one its right edge.
    """

    low: float = Field(
        validation_alias=AliasPath("column", "edges", 0), description="Left end of the first bin."
    )
    high: float = Field(
        validation_alias=AliasPath("column", "edges", -1), description="Right end of the last bin."
    )
    edges: list[float] = Field(
        validation_alias=AliasPath("column", "edges"), description="One more than there are bins."
    )
    open_high: bool = Field(
        validation_alias=AliasPath("column", "open_high"),
        description="The last bin also holds what lies beyond.",
    )
    log: bool = Field(
        validation_alias=AliasPath("column", "log"),
        description="The bins are equally wide on a logarithmic scale, but the first: it holds 0 "
        "and all that is smaller than the second edge.",
    )
    counts: list[int]
    unknown: int = Field(description="Groups that have no such number.")


class SummaryDocument(Document):
    """Counts and histograms over the groups that a query matches."""

    progress: Progress
    histograms: dict[str, Histogram] = Field(
        description="By column: jac, error_percent, sigma, parallax, size_ratio."
    )


class DatasetDeletionRequest(RequestBody, examples=[{"confirm": "demo"}]):
    """The name of the dataset, once more: nobody deletes one by a slip."""

    confirm: Annotated[str, Field(max_length=200)] = ""


class DeletionResultDocument(BaseModel):
    """What was deleted, or, with `dry_run`, what would be."""

    dry_run: bool
    id: int
    name: str
    counts: dict[str, int] = Field(
        description="groups, views, verdicts, saved_views, batches, annotations (independent ones, also"
        " those not submitted yet), recordings, tracks, versions, predictions, evaluations."
    )


@router.get("")
@may(Action.READ, where=RoleScope.SOMEWHERE)
@paged()
def list_datasets(request: Request, store: AppStore, visibility: Sees) -> DatasetList:
    """Every dataset that one sees, with its progress."""
    login = get_current_login(request.scope)
    own = () if login is None else login.roles.single.keys()
    return DatasetList(items=review.list_datasets(store, visibility, own))


@router.get("/{dataset}", response_model=DatasetDocument)
@may(Action.READ, dataset=OwnedKind.DATASET)
def get_dataset(dataset: DatasetPath, store: AppStore) -> review.Dataset:
    """One dataset by name or id."""
    return review.get_dataset(store, dataset)


@router.get("/{dataset}/summary")
@may(Action.READ, dataset=OwnedKind.DATASET)
def get_summary(dataset: DatasetPath, store: AppStore, query: QueryText = "") -> SummaryDocument:
    """Progress and histograms over the groups that a query matches."""
    found = review.get_dataset_head(store, dataset)
    counted = summarize_groups(store, found.id, query)
    return SummaryDocument(progress=counted, histograms=counted.histograms)


@router.post("/{dataset}/solve", **describe_job_response_for_openapi())
@may(Action.LEAD, dataset=OwnedKind.DATASET)
@respond_with(make_job_response)
def solve_dataset(dataset: DatasetPath, services: AppServices, actor: Actor) -> Job:
    """Solve what has no solution for its present state, policy and solver, as a job.

    The server does so by itself after whatever makes groups stale; this waits for it, too.
    """
    found = review.dataset_id(services.store, dataset)
    return request_solve_job(services.jobs, services.store, found, actor=actor)


def _deleted_response(gone: DatasetContents, dry_run: bool) -> Response:
    return make_document_response(DeletionResultDocument(dry_run=dry_run, **vars(gone)))


@router.delete("/{dataset}", response_model=DeletionResultDocument, responses=responses(409))
@may(Action.ADMINISTER, dataset=OwnedKind.DATASET)
@respond_with(_deleted_response, "dry_run")
def delete_dataset(
    dataset: DatasetPath,
    request: DatasetDeletionRequest,
    services: AppServices,
    actor: Actor,
    dry_run: Annotated[bool, Query(description="Only report what would be deleted.")] = False,
) -> DatasetContents:
    """Delete a dataset with everything that belongs to it; `confirm` is its name, else 409.

    Its jobs are cancelled first. Cannot be undone; the log of what was said stays.
    """
    contents = read_contents(services.store, dataset)
    if not dry_run:
        if request.confirm == contents.name:
            services.jobs.cancel_all(contents.id)
            # First, so that none is left of a dataset that is gone where the server dies.
            _delete_exports(services, contents.id)
        contents = deletion.delete_dataset(
            services.store, contents.id, confirm=request.confirm, actor=actor
        )
        # Of those that were asked for meanwhile.
        _delete_exports(services, contents.id)
    return contents


def _delete_exports(services: Services, number: int) -> None:
    for export in services.jobs.list_job_ids(dataset_id=number, kind=EXPORT):
        services.exports.delete_export(str(export))
