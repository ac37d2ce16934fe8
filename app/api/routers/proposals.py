"""Proposals for views without a camera: looked for in a dataset, shown, taken back."""

from __future__ import annotations

from fastapi import APIRouter, Response

from app.api.deps import Actor, AppServices, AppStore, DatasetPath, DryRun, Id
from app.api.jobs import ACCEPTED, job_answer
from app.api.paging import paged
from app.api.problem import responses
from app.api.respond import document, responds
from app.api.schemas.job import JobDocument
from app.api.schemas.proposals import (
    DatasetProposalsDocument,
    DatasetProposalsRequest,
    ForgottenProposalsDocument,
    GroupProposal,
    GroupProposals,
    ProposalPlanDocument,
)
from app.review.editing.proposals import get_group_proposals, get_proposals
from app.review.jobs.proposals import PROPOSALS, stop_and_forget
from app.review.jobs.records import Job

router = APIRouter(tags=["datasets"])


@router.get(
    "/datasets/{dataset}/proposals", operation_id="listDatasetProposals", responses=responses(404)
)
@paged()
def list_proposals(dataset: DatasetPath, store: AppStore) -> DatasetProposalsDocument:
    """For how many views of each match something is proposed; nothing of it counts."""
    return DatasetProposalsDocument.model_validate(get_proposals(store, dataset))


@router.post(
    "/datasets/{dataset}/proposals",
    operation_id="proposeDatasetLines",
    status_code=202,
    response_model=JobDocument,
    responses={
        **responses(404, 413, 415),
        **ACCEPTED,
        200: {
            "model": ProposalPlanDocument,
            "description": "After a dry run: how many views would be looked at.",
        },
    },
)
@responds(job_answer)
def propose_lines(
    dataset: DatasetPath,
    request: DatasetProposalsRequest,
    services: AppServices,
    actor: Actor,
    dry_run: DryRun = False,
) -> Job | Response:
    """Look at the pictures of views without a camera, neither given nor from their lines.

    What is found is kept as predictions: nothing counts before a person saves the lines of one.
    Views that were looked at are left alone, unless their picture is another, or more is known of
    their match and nothing was proposed. The job's result counts the outcomes.
    """
    if dry_run or request.dry_run:
        matches = None if request.match is None else [request.match]
        found = get_proposals(services.store, dataset, matches)
        counts = {name: found.count(name) for name in ("views", "looked")}
        return document(ProposalPlanDocument(**counts))
    return PROPOSALS.request(services.jobs, services.store, dataset, request.match, actor=actor)


def _forgotten(gone: int) -> Response:
    return document(ForgottenProposalsDocument(forgotten=gone))


@router.delete(
    "/datasets/{dataset}/proposals",
    operation_id="forgetDatasetProposals",
    response_model=ForgottenProposalsDocument,
    responses=responses(404),
)
@responds(_forgotten)
def forget(dataset: DatasetPath, services: AppServices) -> int:
    """Forget everything that was proposed for a dataset; lines that were accepted stay.

    A search that waits or runs is cancelled, and nothing that it finds is kept afterwards.
    """
    return stop_and_forget(services.jobs, services.store, dataset)


@router.get(
    "/groups/{group}/proposals",
    operation_id="getGroupProposals",
    tags=["groups"],
    responses=responses(404),
)
@paged()
def group_proposals(group: Id, store: AppStore) -> GroupProposals:
    """What was proposed for the views of a group, with its lines and scores."""
    found = get_group_proposals(store, group)
    return GroupProposals(items=[GroupProposal.of(*item) for item in found])
