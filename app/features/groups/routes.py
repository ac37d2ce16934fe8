"""Groups: lists, the whole document, previews, undo and history."""

from __future__ import annotations

from typing import Annotated, Self

from fastapi import APIRouter, Query, Request, Response
from pydantic import Field

from app.db.store import Store
from app.errors import NotFoundError
from app.features.agreement.reopen import undo_edit_or_decision
from app.features.datasets.service import dataset_id
from app.features.groups import submit
from app.features.groups.history import (
    ChangedView,
    EntryChanges,
    read_entry_changes,
    read_history,
)
from app.features.groups.preview_routes import PreviewDocument, PreviewRequest
from app.features.groups.schemas import (
    Ball,
    GroupDocument,
    LineDocuments,
    PitchSize,
    lines_to_document,
    make_group_response,
    url_of_image,
)
from app.features.groups.solution_schemas import SolutionDocument
from app.features.groups.state import GroupState
from app.features.groups.undo import redo_group_edit
from app.features.people.roles import role_allows
from app.features.queue import service as queue
from app.features.queue.routes import (
    GroupHistory,
    GroupPage,
    GroupRow,
    LogEntryDocument,
)
from app.features.queue.service import MatchingGroupIds
from app.http.access import get_current_login
from app.http.cursor import foreign_cursor_error, paged
from app.http.deps import (
    Actor,
    AppServices,
    AppStore,
    DatasetQuery,
    Id,
    IfMatch,
    QueryText,
    is_not_modified,
)
from app.http.documents import Document, respond_with
from app.http.errors import add_current_state_to_conflicts
from app.http.permissions import Action, OwnedKind, may
from app.http.problem import Responses, responses
from app.http.request_limits import COMPUTE, limit
from app.http.route import Route
from app.json_text import MAX_ID
from app.soccer.group import View, make_view_letter

router = APIRouter(prefix="/groups", tags=["groups"], route_class=Route)

MAX_LIMIT = 500
ETAG = {"ETag": {"description": "The group's state.", "schema": {"type": "string"}}}
CHANGED: Responses = {
    **responses(409),
    200: {"headers": ETAG, "description": "The whole group as it is now."},
}


class ViewVersionDocument(Document):
    """A view as it was said to be at a time."""

    included: bool
    calibration: str = Field(description="Which calibration counts when both exist.")
    lines: LineDocuments
    balls: list[Ball]

    @classmethod
    def of(cls, view: View) -> Self:
        """The document of a view."""
        return cls(
            included=view.included,
            calibration=view.station.calibration,
            lines=lines_to_document(view.station.lines),
            balls=[Ball.of(ball) for ball in view.balls],
        )


class ChangedViewDocument(Document):
    """A view that an entry has changed; `before` and `after` are null where it was not there."""

    key: str
    letter: str
    width: int
    height: int
    image: str | None = Field(description="Address of the frame, where there is one now.")
    before: ViewVersionDocument | None
    after: ViewVersionDocument | None

    @classmethod
    def of(cls, changed: ChangedView) -> Self:
        """The document of a changed view."""
        there = changed.after or changed.before
        assert there is not None
        shown = changed.id is not None and there.media is not None
        return cls(
            key=changed.key,
            letter=make_view_letter(changed.index),
            width=there.size.width,
            height=there.size.height,
            image=url_of_image(changed.id) if shown and changed.id is not None else None,
            before=None if changed.before is None else ViewVersionDocument.of(changed.before),
            after=None if changed.after is None else ViewVersionDocument.of(changed.after),
        )


class EntryChangesDocument(Document):
    """What an entry has changed: the views that differ, and the pitch."""

    entry: LogEntryDocument
    views: list[ChangedViewDocument]
    pitch_before: PitchSize | None = Field(description="null: there was nothing before it.")
    pitch_after: PitchSize

    @classmethod
    def of(cls, step: EntryChanges) -> Self:
        """The document of a step."""
        old = step.pitch_before
        return cls(
            entry=LogEntryDocument.of(step.entry),
            views=[ChangedViewDocument.of(view) for view in step.views],
            pitch_before=None if old is None else PitchSize.model_validate(old),
            pitch_after=PitchSize.model_validate(step.pitch_after),
        )


def load_group_document(store: Store, group_id: int) -> GroupDocument:
    """The document of a group as it is now."""
    return GroupDocument.of(submit.load_solved_group(store, group_id))


def load_group_document_of_view(store: Store, view_id: int) -> GroupDocument:
    """The document of the group of a view as it is now."""
    return GroupDocument.of(submit.load_solved_group_of_view(store, view_id))


@router.get("")
@may(Action.READ, dataset=OwnedKind.DATASET)
def list_groups(
    store: AppStore,
    request: Request,
    dataset: DatasetQuery,
    query: QueryText = "",
    limit: Annotated[int, Query(ge=1, le=MAX_LIMIT)] = 50,
    cursor: Annotated[
        str | None, Query(max_length=500, description="`next` of the page before.")
    ] = None,
    start: Annotated[
        int | None,
        Query(
            alias="from",
            ge=0,
            le=MAX_ID,
            description="Position of the first group, from 0, instead of a cursor.",
        ),
    ] = None,
) -> GroupPage:
    """Groups that match a query, a page at a time.

    To read all of them follow `next`: while others edit, a cursor neither skips a group nor gives
    it twice. To look at any place of the list say `from`: page 90 costs what page 2 costs, but
    positions are those of this moment and move when groups come to match or cease to. Such a
    page has a `next` too.
    """
    found = dataset_id(store, dataset)
    try:
        page = queue.list_groups(store, found, query, limit, cursor, start)
    except (OverflowError, UnicodeEncodeError) as error:
        # A forged cursor can hold what the database cannot.
        raise foreign_cursor_error() from error
    login = get_current_login(request.scope)
    judges = login is None or role_allows(login.roles.find_role_in(found), Action.REVIEW)
    items = [GroupRow.of(row, judges) for row in page.items]
    return GroupPage(items=items, next=page.next, total=page.total)


@router.get("/ids")
@may(Action.READ, dataset=OwnedKind.DATASET)
def list_group_ids(
    store: AppStore,
    dataset: DatasetQuery,
    query: QueryText = "",
    limit: Annotated[int, Query(ge=1, le=queue.MAX_IDS)] = queue.MAX_IDS,
    start: Annotated[
        int, Query(alias="from", ge=0, le=MAX_ID, description="Position of the first, from 0.")
    ] = 0,
) -> MatchingGroupIds:
    """The ids alone of the groups that match, in the order of the list.

    What `id:12,15,19` in a query takes, and what a loop over a whole dataset needs.
    """
    return queue.list_ids(store, dataset_id(store, dataset), query, limit, start)


@router.get(
    "/{group}",
    response_model=GroupDocument,
    responses={200: {"headers": ETAG}, 304: {"description": "Not changed."}},
)
@may(Action.READ, group=OwnedKind.GROUP)
def get_group(group: Id, store: AppStore, request: Request) -> Response:
    """One group, complete: annotations, solution, verdict."""
    if "if-none-match" in request.headers:
        etag = submit.read_group_etag(store, group)
        if is_not_modified(request, etag):
            return Response(status_code=304, headers={"ETag": etag})
    return make_group_response(submit.load_solved_group(store, group))


@router.get("/{group}/solution")
@may(Action.READ, group=OwnedKind.GROUP)
def get_solution(group: Id, store: AppStore) -> SolutionDocument:
    """The solution of a group."""
    state = submit.load_solved_group(store, group)
    if state.solution is None:
        raise NotFoundError(f"group {group} has no solution")
    return SolutionDocument.of(state.solution, state.group, state.dismissed)


@router.get("/{group}/neighbours")
@may(Action.READ, group=OwnedKind.GROUP)
def get_neighbours(group: Id, store: AppStore, query: QueryText = "") -> queue.Neighbours:
    """Where the group stands among those that match, and up to five before and after."""
    return queue.find_neighbours(store, group, query)


@router.get("/{group}/history")
@may(Action.READ, group=OwnedKind.GROUP)
@paged()
def get_history(group: Id, store: AppStore) -> GroupHistory:
    """Everything that was said about the group and changed of its static cameras, oldest first."""
    return GroupHistory(items=[LogEntryDocument.of(entry) for entry in read_history(store, group)])


@router.get("/{group}/history/{entry}")
@may(Action.READ, group=OwnedKind.GROUP)
def get_history_step(group: Id, entry: Id, store: AppStore) -> EntryChangesDocument:
    """What one entry of the history has changed: the views that differ, before and after."""
    return EntryChangesDocument.of(read_entry_changes(store, group, entry))


@router.post("/{group}/preview", response_model=PreviewDocument, responses=responses(409))
@may(Action.READ, group=OwnedKind.GROUP)
@limit(COMPUTE)
async def preview_group(
    group: Id, changes: PreviewRequest, services: AppServices, request: Request
) -> Response:
    """What the solution would be; nothing is saved."""
    found = await services.previews.solve_preview_document(request, group, changes)
    return Response(found, media_type="application/json")


@router.post(
    "/{group}/undo", response_model=GroupDocument, responses={**CHANGED, **responses(413, 415)}
)
@may(Action.ANNOTATE, group=OwnedKind.GROUP)
@respond_with(make_group_response)
def undo_group(group: Id, services: AppServices, actor: Actor, if_match: IfMatch) -> GroupState:
    """Take the last edit back; 409 when there is none.

    Where a decision between independent annotations made it, the group waits for a decision again.
    """
    store = services.store
    with add_current_state_to_conflicts(lambda: load_group_document(store, group)):
        return undo_edit_or_decision(
            store, group, if_match=if_match, actor=actor, paint=services.paint
        )


@router.post(
    "/{group}/redo", response_model=GroupDocument, responses={**CHANGED, **responses(413, 415)}
)
@may(Action.ANNOTATE, group=OwnedKind.GROUP)
@respond_with(make_group_response)
def redo_group(group: Id, services: AppServices, actor: Actor, if_match: IfMatch) -> GroupState:
    """Do again what was undone last; 409 when there is nothing."""
    store = services.store
    with add_current_state_to_conflicts(lambda: load_group_document(store, group)):
        return redo_group_edit(store, group, if_match=if_match, actor=actor, paint=services.paint)
