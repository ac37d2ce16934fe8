"""Verdicts: on a group, and on every group that a query matches, with undo and redo of these."""

from __future__ import annotations

from typing import Annotated

from fastapi import APIRouter, BackgroundTasks, Query, Response

from app.features.agreement.service import after_submission
from app.features.datasets.service import dataset_id
from app.features.findings.service import FindingName, set_dismissal
from app.features.groups.routes import CHANGED, CONFLICTS, group_answer, load_document
from app.features.groups.schemas import GroupDocument
from app.features.groups.state import GroupState
from app.features.verdicts import bulk, bulk_undo
from app.features.verdicts import bulk_undo as bulk_redo
from app.features.verdicts.bulk_undo import RedoReport, UndoReport
from app.features.verdicts.schemas import (
    BatchList,
    BulkResult,
    BulkVerdict,
    DismissalEdit,
    VerdictEdit,
)
from app.features.verdicts.service import set_verdict
from app.http.conflicts import current_state
from app.http.cursor import MAX_ITEMS, Cursor, parse_cursor
from app.http.deps import Actor, AppServices, AppStore, DatasetPath, DryRun, Id, IfMatch
from app.http.permissions import Action, OwnedKind, may
from app.http.problem import responses
from app.http.request_limits import EDITS, limit
from app.http.respond import as_document, document, responds
from app.http.route import Route

router = APIRouter(route_class=Route)


@router.put(
    "/groups/{group}/verdict",
    tags=["groups"],
    operation_id="setVerdict",
    response_model=GroupDocument,
    responses={**responses(*CONFLICTS), **CHANGED},
)
@may(Action.REVIEW, group=OwnedKind.GROUP)
@limit(EDITS)
@responds(group_answer)
def put_verdict(
    group: Id,
    verdict: VerdictEdit,
    services: AppServices,
    actor: Actor,
    if_match: IfMatch,
    background: BackgroundTasks,
) -> GroupState:
    """Accept, reject with a reason, defer, or take a verdict back."""
    store, values = services.store, (verdict.state, verdict.reason, verdict.note)
    with current_state(lambda: load_document(store, group)):
        state = set_verdict(store, group, *values, if_match=if_match, actor=actor)
    # A verdict on an independent annotation of a group, and on nothing else, submits that.
    if state.is_copy:
        background.add_task(after_submission, store, group, services.paint)
    return state


@router.put(
    "/groups/{group}/dismissal",
    tags=["groups"],
    operation_id="dismissFinding",
    response_model=GroupDocument,
    responses={**responses(*CONFLICTS), **CHANGED},
)
@may(Action.REVIEW, group=OwnedKind.GROUP)
@responds(group_answer)
def put_dismissal(
    group: Id, body: DismissalEdit, services: AppServices, actor: Actor, if_match: IfMatch
) -> GroupState:
    """Say that a finding was checked and is fine, or that it is to be looked at again.

    A dismissed finding stays in the solution with `dismissed`. It stands again by itself once it
    says something else: its number has moved by more than 5 %, or, without one, its sentence is
    another.
    """
    named = FindingName(body.kind, body.view, body.marking, body.suggested, body.number)
    with current_state(lambda: load_document(services.store, group)):
        return set_dismissal(
            services.store,
            group,
            named,
            dismissed=body.dismissed,
            note=body.note,
            if_match=if_match,
            actor=actor,
        )


@router.post(
    "/datasets/{dataset}/verdicts",
    tags=["verdicts"],
    operation_id="setVerdicts",
    response_model=BulkResult,
    responses=responses(404, 409, 413, 415),
)
@may(Action.REVIEW, dataset=OwnedKind.DATASET)
@responds(as_document(BulkResult.done))
def post_verdicts(
    dataset: DatasetPath,
    verdict: BulkVerdict,
    store: AppStore,
    actor: Actor,
    dry_run: DryRun = False,
) -> bulk.BatchReport | Response:
    """Judge every group that the query matches, as each of them is when its turn comes.

    Accepting a group that fails a gate needs a note; without one such groups are refused and
    counted, as are groups whose ball cannot be used and groups that nobody has solved. Groups that have this very verdict already
    stay as they are.
    """
    found = dataset_id(store, dataset)
    values = (verdict.q, verdict.state, verdict.reason, verdict.note)
    if dry_run:
        return document(BulkResult.planned(bulk.plan_verdicts(store, found, *values)))
    return bulk.give_verdicts(store, found, *values, actor=actor, expected=verdict.expected)


@router.get(
    "/datasets/{dataset}/verdict-batches",
    tags=["verdicts"],
    operation_id="listVerdictBatches",
    responses=responses(404),
)
@may(Action.READ, dataset=OwnedKind.DATASET, whole=True)
def list_batches(
    dataset: DatasetPath,
    store: AppStore,
    limit: Annotated[int, Query(ge=1, le=MAX_ITEMS, description="Items a page.")] = 20,
    cursor: Cursor = None,
) -> BatchList:
    """The newest bulk verdicts of a dataset."""
    found = dataset_id(store, dataset)
    batches = bulk.list_batches(store, found, limit + 1, parse_cursor(cursor))
    more = str(batches[limit - 1].id) if len(batches) > limit else None
    return BatchList(items=batches[:limit], next=more)


@router.post(
    "/verdict-batches/{batch}/redo",
    tags=["verdicts"],
    operation_id="redoVerdictBatch",
    response_model=RedoReport,
    responses=responses(404, 409),
)
@may(Action.REVIEW, batch=OwnedKind.BATCH)
@responds(document)
def redo_batch(batch: Id, store: AppStore, actor: Actor) -> bulk_redo.RedoReport:
    """Give the verdicts of a batch again that was taken back, as a new batch.

    Groups that somebody has judged or edited since stay as they are. 409 when the batch was not
    taken back, or was given again already.
    """
    return bulk_redo.redo_batch(store, batch, actor=actor)


@router.post(
    "/verdict-batches/{batch}/undo",
    tags=["verdicts"],
    operation_id="undoVerdictBatch",
    response_model=UndoReport,
    responses=responses(404, 409),
)
@may(Action.REVIEW, batch=OwnedKind.BATCH)
@responds(document)
def undo_batch(batch: Id, store: AppStore, actor: Actor) -> bulk_undo.UndoReport:
    """Give each group of a batch the verdict back that it had before; 409 the second time.

    Groups that somebody has judged since keep that verdict.
    """
    return bulk_undo.undo_batch(store, batch, actor=actor)
