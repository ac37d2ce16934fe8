"""Bulk edits: balls and lines of many views in one request."""

from __future__ import annotations

from collections import Counter
from functools import partial
from typing import Annotated, Literal

from fastapi import APIRouter, Response
from pydantic import Field, model_validator

from app.errors import InputError
from app.features.datasets.service import dataset_id
from app.features.groups.bulk_edits import (
    MAX_ITEMS,
    BulkEditReport,
    ItemOutcome,
    Outcome,
    ViewEdits,
    edit_views,
    plan_edits,
)
from app.features.groups.edit import Edit, SetLines, make_set_ball_edit
from app.features.groups.edit_schemas import BallEdit, LineEdits, Marking, points_by_marking
from app.features.groups.submit import require_followed_groups
from app.features.solutions.service import solve_and_encode
from app.http.deps import STRONG_ETAG, Actor, AppServices, DatasetPath, DryRun
from app.http.documents import (
    Document,
    RequestBody,
    make_document_responder,
    make_document_response,
    respond_with,
)
from app.http.errors import find_http_status
from app.http.permissions import Action, OwnedKind, may
from app.http.request_limits import COMPUTE, limit
from app.http.route import Route
from app.json_text import MAX_ID
from app.soccer.pitch import MARKINGS

_Key = Annotated[str, Field(min_length=1, max_length=1000)]


router = APIRouter(prefix="/datasets/{dataset}/edits", tags=["views"], route_class=Route)


class ViewEditItem(RequestBody):
    """New points for some markings of one view, its ball, or both."""

    view: Annotated[int, Field(strict=True, ge=1, le=MAX_ID)] | _Key = Field(
        description="Id of the view; or its key, in the group of the key `group`."
    )
    group: _Key | None = Field(
        default=None, description="Key of the group, where the view is named by its key."
    )
    etag: Annotated[str, Field(min_length=3, max_length=100)] | None = Field(
        default=None,
        description="ETag of the view's group: the state that the change builds on. It may be left "
        "out where `if_match` is `*`.",
    )
    ball: BallEdit | None = Field(
        default=None, description="null: no ball is annotated; absent: the ball stays as it is."
    )
    lines: LineEdits = Field(
        default_factory=dict,
        description="null or no points delete a marking, absent markings stay.",
    )
    proposed: Annotated[list[Marking], Field(max_length=len(MARKINGS))] = Field(
        default_factory=list,
        description="Markings of `lines` whose points are as proposed from the paint.",
    )

    @model_validator(mode="after")
    def _check_one_view_and_change(self) -> ViewEditItem:
        if isinstance(self.view, str) and self.group is None:
            raise ValueError("a view that is named by its key needs `group`, the key of its group")
        if isinstance(self.view, int) and self.group is not None:
            raise ValueError("a view that is named by its id needs no `group`")
        if not self.lines and "ball" not in self.model_fields_set:
            raise ValueError("give a ball, lines, or both")
        return self

    def edits(self) -> ViewEdits:
        """The item as a value."""
        return ViewEdits(self.view, self.group, self.etag, self._build_view_edits)

    def _build_view_edits(self, key: str) -> list[Edit]:
        edits: list[Edit] = []
        if self.lines:
            edits.append(SetLines(key, points_by_marking(self.lines), tuple(self.proposed)))
        if "ball" in self.model_fields_set:
            edits.append(make_set_ball_edit(key, None if self.ball is None else self.ball.ball()))
        return edits


class BulkEdit(
    RequestBody,
    examples=[
        {
            "items": [
                {
                    "view": 2,
                    "etag": '"f5549b073a50de7c-79ed742e"',
                    "ball": {"box": [801.5, 322.0, 14.0, 14.5]},
                },
                {
                    "group": "epl/2015-2016/match/7.png",
                    "view": "7_1.png",
                    "etag": '"0c2b9be1f6a4d7e3-5d0c1a2b"',
                    "lines": {"Circle central": None},
                },
            ]
        },
        {"if_match": "*", "items": [{"view": 2, "ball": None}]},
    ],
):
    """Balls and lines of many views."""

    items: Annotated[
        list[ViewEditItem], Field(min_length=1, max_length=MAX_ITEMS, fail_fast=True)
    ] = Field(description="One for each view; the views of one group are one edit.")
    if_match: Literal["*"] | None = Field(
        default=None,
        description="`*`: items without `etag` change whatever their group is then.",
    )

    def edits(self) -> list[ViewEdits]:
        """The items as values."""
        return [item.edits() for item in self.items]


class ItemOutcomeDocument(Document):
    """What came of one item, or would."""

    index: int = Field(description="Place of the item in the request, from 0.")
    group: int | None = Field(description="Id of the group; null where the view is unknown.")
    view: int | None = Field(description="Id of the view; null where it is unknown.")
    outcome: Outcome = Field(
        description="`changed`; `unchanged`: it was so already; `refused`: see `problem`."
    )
    etag: str | None = Field(
        description="State of the group after the request, which further changes build on; null "
        "where the view is unknown, or the server had no time for it."
    )
    status: int | None = Field(
        description=(
            "Status that the same change alone would get; null unless refused. 412: another person "
            "changed the group first, `etag` is the present state."
        )
    )
    problem: str | None = Field(description="Why it is refused, one sentence.")
    hint: str | None
    pointer: str | None

    @staticmethod
    def of(item: ItemOutcome) -> ItemOutcomeDocument:
        """The document of one outcome."""
        error = item.error
        return ItemOutcomeDocument(
            index=item.index,
            group=item.group,
            view=item.view,
            outcome=item.outcome,
            etag=item.etag,
            status=None if error is None else find_http_status(error),
            problem=None if error is None else error.message,
            hint=None if error is None else error.hint,
            pointer=None if error is None else error.pointer,
        )


class BulkEditDocument(Document):
    """What a bulk edit did, or would do (`dry_run`), item by item."""

    dry_run: bool = Field(description="Whether it was a dry run, which changes nothing.")
    changed: int = Field(description="Items that changed their view.")
    unchanged: int = Field(description="Items that say what their view says already.")
    refused: int = Field(description="Items that were refused; nothing of their group was changed.")
    items: list[ItemOutcomeDocument] = Field(
        description="One for each item, in the order of the request."
    )

    @staticmethod
    def of(report: BulkEditReport) -> BulkEditDocument:
        """The document of a report."""
        counts = Counter(item.outcome for item in report.items)
        return BulkEditDocument(
            dry_run=report.dry_run,
            changed=counts["changed"],
            unchanged=counts["unchanged"],
            refused=counts["refused"],
            items=[ItemOutcomeDocument.of(item) for item in report.items],
        )


@router.post("", operation_id="editViews", response_model=BulkEditDocument)
@may(Action.ANNOTATE, dataset=OwnedKind.DATASET)
@limit(COMPUTE)
@respond_with(make_document_responder(BulkEditDocument.of))
def edit_many_views(
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
    require_followed_groups(
        store,
        lambda _session: found,
        {
            f"/items/{index}/ball/followed_from": item.ball.followed_from
            for index, item in enumerate(edit.items)
            if item.ball is not None
        },
    )
    if dry_run:
        plan = plan_edits(store, found, edit.edits(), actor=actor)
        return make_document_response(BulkEditDocument.of(plan))
    return edit_views(
        store,
        found,
        edit.edits(),
        actor=actor,
        paint=services.paint,
        solve=partial(services.large.solve, solve_and_encode),
    )


def _require_etags(edit: BulkEdit) -> None:
    """Refuse items that do not name the state that they build on, as ``require_if_match`` does."""
    for index, item in enumerate(edit.items):
        pointer = f"/items/{index}/etag"
        if item.etag is None and edit.if_match is None:
            raise InputError(
                "an item does not contain the ETag of its group",
                hint='Send the ETag of the group that you changed as "etag" of the item, or send'
                ' "if_match": "*" beside the items to overwrite any state. Nothing was changed.',
                pointer=pointer,
            )
        if item.etag is not None and not STRONG_ETAG.fullmatch(item.etag):
            raise InputError(
                "the etag of an item must be a single strong ETag, including its quotes",
                hint='Send the "etag" of the group as it is.',
                pointer=pointer,
            )
