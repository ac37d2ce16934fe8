"""Verdicts: on a group, and on every group that a query matches, with undo and redo of these."""

from __future__ import annotations

from datetime import datetime
from typing import Annotated, Literal, Self

from fastapi import APIRouter, BackgroundTasks, Query, Response
from pydantic import (
    AwareDatetime,
    Field,
    FiniteFloat,
    StrictBool,
    model_validator,
)

from app.features.agreement.service import compare_or_adopt_submission
from app.features.datasets.service import dataset_id
from app.features.findings.service import FindingReference, set_dismissal
from app.features.groups.routes import CHANGED, load_group_document
from app.features.groups.schemas import GroupDocument, make_group_response
from app.features.groups.state import GroupState
from app.features.queue.query import MAX_LISTED_LENGTH
from app.features.verdicts import bulk, bulk_undo
from app.features.verdicts.bulk import (
    AffectedGroup,
    BulkPlan,
    BulkVerdictReport,
    RefusedGroups,
    ReplacedVerdicts,
)
from app.features.verdicts.bulk_undo import RedoReport, UndoReport
from app.features.verdicts.service import check_verdict, set_verdict
from app.features.verdicts.undo import redo_verdict, undo_verdict
from app.http.cursor import MAX_ITEMS, Cursor, parse_cursor
from app.http.deps import Actor, AppServices, AppStore, DatasetPath, DryRun, Id, IfMatch
from app.http.documents import (
    Document,
    ListDocument,
    RequestBody,
    make_document_responder,
    make_document_response,
    respond_with,
)
from app.http.errors import add_current_state_to_conflicts
from app.http.permissions import Action, OwnedKind, may
from app.http.problem import responses
from app.http.route import Route
from app.soccer.choices import VerdictState
from app.soccer.finding import FINDING_KINDS
from app.soccer.group import MAX_NOTE, Reason

Name = Annotated[str, Field(max_length=400)]
router = APIRouter(route_class=Route)


class VerdictEdit(
    RequestBody,
    examples=[
        {"state": "accepted"},
        {"state": "rejected", "reason": "bad_field_lines"},
        {"state": "rejected", "reason": "other", "note": "wrong match"},
    ],
):
    """Accept, reject with a reason, defer, or take a verdict back.

    A rejection needs a reason; `other` needs a note, and so does accepting a group that fails a
    gate, or whose ball cannot be used.
    """

    state: VerdictState
    reason: Reason | None = None
    note: Annotated[str, Field(max_length=MAX_NOTE)] | None = None
    undo_of: AwareDatetime | None = Field(
        default=None,
        description="Undo, with `state` `unreviewed`: `at` of a verdict of one's own. The verdict of "
        "before returns as it was given; 409 when a newer one was given since.",
    )
    redo_of: AwareDatetime | None = Field(
        default=None,
        description="Redo: `at` of a verdict of one's own that was undone; 409 when the group was "
        "edited since, or somebody else has judged it.",
    )

    @model_validator(mode="after")
    def _require_one_meaning(self) -> Self:
        given = (self.redo_of, self.reason, self.note)
        if self.undo_of and (self.state != "unreviewed" or any(given)):
            raise ValueError(
                "undo_of needs the state unreviewed: leave out redo_of, reason and note"
            )
        return self


class DismissalEdit(
    RequestBody, examples=[{"kind": "ball_size", "view": "0_1.png", "dismissed": True}]
):
    """A finding of the group, as its solution has it, and whether it is dismissed."""

    kind: Literal[FINDING_KINDS]  # type: ignore[valid-type]
    view: Name | None = Field(default=None, description="Key of the view; null: the whole group.")
    marking: Name | None = None
    suggested: Name | None = None
    number: FiniteFloat | None = Field(
        default=None, description="Where several findings have the rest: the nearest is meant."
    )
    dismissed: StrictBool = Field(description="false: it is to be looked at again.")
    note: Annotated[str, Field(max_length=MAX_NOTE)] | None = None


class BulkVerdict(
    RequestBody,
    examples=[
        {"q": "status:unreviewed passes:yes sigma<0.3", "state": "accepted"},
        {"q": "finding:sides_swapped", "state": "rejected", "reason": "sides_confused"},
        {"q": "id:12,15,19", "state": "deferred"},
    ],
):
    """A verdict, and the query whose groups shall have it."""

    q: Annotated[
        str,
        Field(
            max_length=MAX_LISTED_LENGTH,
            description="As in the browser; empty: all. More than 1000 characters only for lists "
            "of groups, `id:12,15,19` or, for all but these, `-id:12,15,19`.",
        ),
    ] = ""
    state: VerdictState
    reason: Reason | None = None
    note: Annotated[str, Field(max_length=MAX_NOTE)] | None = None
    expected: Annotated[int, Field(ge=0, le=2**53)] | None = Field(
        default=None, description="`would_change` of the dry run; 409 when it is another by now."
    )


class BulkResult(Document):
    """What a bulk verdict would do (`dry_run=true`), or did."""

    dry_run: bool
    matches: int | None = Field(description="Groups that the query finds; dry run only.")
    would_change: int | None = Field(description="Dry run only, like `sample`.")
    unchanged: int | None = Field(
        description="Groups that have this verdict already; dry run only."
    )
    replaced: list[ReplacedVerdicts] | None = Field(
        description="Groups among `would_change` whose present verdict is replaced, by its state; dry run only."
    )
    sample: list[AffectedGroup] | None
    batch: int | None = Field(
        description="Batch that `POST /verdict-batches/{batch}/undo` undoes; null when nothing changed."
    )
    changed: int
    refused: list[RefusedGroups]

    @staticmethod
    def of_plan(plan: BulkPlan) -> BulkResult:
        """The document of a dry run."""
        return BulkResult(dry_run=True, batch=None, changed=0, **vars(plan))

    @staticmethod
    def of_report(report: BulkVerdictReport) -> BulkResult:
        """The document of what was done."""
        tried = dict.fromkeys(("matches", "would_change", "unchanged", "replaced", "sample"))
        return BulkResult(dry_run=False, **tried, **vars(report))


class BulkVerdictDocument(Document):
    """A bulk verdict as it is remembered."""

    id: int
    at: datetime
    actor: str
    q: str = Field(validation_alias="query")
    state: VerdictState
    reason: Reason | None
    note: str | None
    changed: int
    done: bool = Field(description="false while it runs, or when it was interrupted.")
    undone: datetime | None
    undone_by: str | None
    redone: int | None = Field(description="The batch that gave it again after it was undone.")


class BulkVerdictList(ListDocument[BulkVerdictDocument]):
    """Bulk verdicts, the newest first."""


@router.put(
    "/groups/{group}/verdict",
    tags=["groups"],
    operation_id="setVerdict",
    response_model=GroupDocument,
    responses=CHANGED,
)
@may(Action.REVIEW, group=OwnedKind.GROUP)
@respond_with(make_group_response)
def put_verdict(
    group: Id,
    verdict: VerdictEdit,
    services: AppServices,
    actor: Actor,
    if_match: IfMatch,
    background: BackgroundTasks,
) -> GroupState:
    """Accept, reject with a reason, defer, or take a verdict back.

    `undo_of` undoes a verdict of one's own, and `redo_of` gives it again.
    """
    store, values = services.store, (verdict.state, verdict.reason, verdict.note)
    who = {"if_match": if_match, "actor": actor}
    with add_current_state_to_conflicts(lambda: load_group_document(store, group)):
        if verdict.undo_of is not None:
            state = undo_verdict(store, group, verdict.undo_of, **who)
        elif verdict.redo_of is not None:
            state = redo_verdict(store, group, verdict.redo_of, check_verdict(*values), **who)
        else:
            state = set_verdict(store, group, *values, **who)
    # A verdict on an independent annotation of a group, and on nothing else, submits that.
    if state.is_copy:
        background.add_task(compare_or_adopt_submission, store, group, services.paint)
    return state


@router.put(
    "/groups/{group}/dismissal", tags=["groups"], response_model=GroupDocument, responses=CHANGED
)
@may(Action.REVIEW, group=OwnedKind.GROUP)
@respond_with(make_group_response)
def dismiss_finding(
    group: Id, body: DismissalEdit, services: AppServices, actor: Actor, if_match: IfMatch
) -> GroupState:
    """Say that a finding was checked and is fine, or that it is to be looked at again.

    A dismissed finding stays in the solution with `dismissed`. It stands again by itself once it
    says something else: its number has moved by more than 5 %, or, without one, its sentence is
    another.
    """
    named = FindingReference(body.kind, body.view, body.marking, body.suggested, body.number)
    with add_current_state_to_conflicts(lambda: load_group_document(services.store, group)):
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
    response_model=BulkResult,
    responses=responses(409),
)
@may(Action.REVIEW, dataset=OwnedKind.DATASET)
@respond_with(make_document_responder(BulkResult.of_report))
def set_verdicts(
    dataset: DatasetPath,
    verdict: BulkVerdict,
    store: AppStore,
    actor: Actor,
    dry_run: DryRun = False,
) -> bulk.BulkVerdictReport | Response:
    """Judge every group that the query matches, as each of them is when its turn comes.

    Accepting a group that fails a gate needs a note; without one such groups are refused and
    counted, as are groups whose ball cannot be used and groups that nobody has solved. Groups that have this very verdict already
    stay as they are.
    """
    found = dataset_id(store, dataset)
    values = (verdict.q, verdict.state, verdict.reason, verdict.note)
    if dry_run:
        return make_document_response(BulkResult.of_plan(bulk.plan_verdicts(store, found, *values)))
    return bulk.give_verdicts(store, found, *values, actor=actor, expected=verdict.expected)


@router.get("/datasets/{dataset}/verdict-batches", tags=["verdicts"])
@may(Action.READ, dataset=OwnedKind.DATASET, whole=True)
def list_verdict_batches(
    dataset: DatasetPath,
    store: AppStore,
    limit: Annotated[int, Query(ge=1, le=MAX_ITEMS, description="Items a page.")] = 20,
    cursor: Cursor = None,
) -> BulkVerdictList:
    """The newest bulk verdicts of a dataset."""
    found = dataset_id(store, dataset)
    batches = bulk.list_bulk_verdicts(store, found, limit + 1, parse_cursor(cursor))
    more = str(batches[limit - 1].id) if len(batches) > limit else None
    return BulkVerdictList(items=batches[:limit], next=more)


@router.post(
    "/verdict-batches/{batch}/redo",
    tags=["verdicts"],
    response_model=RedoReport,
    responses=responses(409),
)
@may(Action.REVIEW, batch=OwnedKind.BATCH)
@respond_with(make_document_response)
def redo_verdict_batch(batch: Id, store: AppStore, actor: Actor) -> bulk_undo.RedoReport:
    """Give the verdicts of a batch again that was taken back, as a new batch.

    Groups that somebody has judged or edited since stay as they are. 409 when the batch was not
    taken back, or was given again already.
    """
    return bulk_undo.redo_bulk_verdict(store, batch, actor=actor)


@router.post(
    "/verdict-batches/{batch}/undo",
    tags=["verdicts"],
    response_model=UndoReport,
    responses=responses(409),
)
@may(Action.REVIEW, batch=OwnedKind.BATCH)
@respond_with(make_document_response)
def undo_verdict_batch(batch: Id, store: AppStore, actor: Actor) -> bulk_undo.UndoReport:
    """Give each group of a batch the verdict back that it had before; 409 the second time.

    Groups that somebody has judged since keep that verdict.
    """
    return bulk_undo.undo_bulk_verdict(store, batch, actor=actor)
