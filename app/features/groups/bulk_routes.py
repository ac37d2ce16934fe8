"""Bulk edits: balls and lines of many views in one request."""

from __future__ import annotations

from functools import partial

from fastapi import APIRouter, Response

from app.errors import InputError
from app.features.datasets.service import dataset_id
from app.features.groups.bulk_edits import BulkEditReport, edit_views, plan_edits
from app.features.groups.bulk_schemas import BulkEdit, BulkEditDocument
from app.features.solutions.service import solve_encoded
from app.http.deps import STRONG_ETAG, Actor, AppServices, DatasetPath, DryRun
from app.http.permissions import Action, OwnedKind, may
from app.http.problem import responses
from app.http.request_limits import LARGE, limit
from app.http.respond import as_document, document, responds
from app.http.route import Route

router = APIRouter(prefix="/datasets/{dataset}/edits", tags=["views"], route_class=Route)


@router.post(
    "",
    operation_id="editViews",
    response_model=BulkEditDocument,
    responses=responses(404, 413, 415),
)
@may(Action.ANNOTATE, dataset=OwnedKind.DATASET)
@limit(LARGE)
@responds(as_document(BulkEditDocument.of))
def edit_many(
    dataset: DatasetPath,
    edit: BulkEdit,
    services: AppServices,
    actor: Actor,
    dry_run: DryRun = False,
) -> BulkEditReport | Response:
    """Set balls and lines of many views, each as `PATCH /views/{view}/ball` and `/lines` do.

    The views of one group are one edit, which is done whole or not at all and undone like any
    other. Groups do not depend on each other: the answer says of each item what came of it.
    """
    _require_etags(edit)
    store, found = services.store, dataset_id(services.store, dataset)
    if dry_run:
        plan = plan_edits(store, found, edit.edits(), actor=actor)
        return document(BulkEditDocument.of(plan))
    return edit_views(
        store,
        found,
        edit.edits(),
        actor=actor,
        paint=services.paint,
        solve=partial(services.large.solve, solve_encoded),
    )


def _require_etags(edit: BulkEdit) -> None:
    """Refuse items that do not name the state that they build on, as ``require_if_match`` does."""
    for index, item in enumerate(edit.items):
        pointer = f"/items/{index}/etag"
        if item.etag is None and edit.if_match is None:
            raise InputError(
                "an item must name the state that it builds on",
                hint='Send the ETag of its group as "etag"; or "if_match": "*" beside the items to '
                "change whatever is there. Nothing was done.",
                pointer=pointer,
            )
        if item.etag is not None and not STRONG_ETAG.fullmatch(item.etag):
            raise InputError(
                "the etag of an item must be a single strong ETag, including its quotes",
                hint='Send the "etag" of the group as it is.',
                pointer=pointer,
            )
