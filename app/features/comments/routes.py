"""Threads: what people say to each other about a group, open until somebody settles it."""

from __future__ import annotations

from functools import partial

from fastapi import APIRouter, Response

from app.features.comments import service as comments
from app.features.comments.schemas import (
    NewComment,
    NewThread,
    PeopleOfGroup,
    ThreadDocument,
    ThreadEdit,
    ThreadList,
)
from app.http.cursor import paged
from app.http.deps import Actor, AppStore, Id
from app.http.permissions import Action, OwnedKind, may
from app.http.problem import responses
from app.http.request_limits import LOOKS, limit
from app.http.respond import document, no_content, responds
from app.http.route import Route

router = APIRouter(prefix="/groups/{group}", tags=["comments"], route_class=Route)


@router.get("/people", operation_id="listPeopleOfGroup", responses=responses(404))
@may(Action.ANNOTATE, group=OwnedKind.GROUP)
@limit(LOOKS)
def list_people(group: Id, store: AppStore) -> PeopleOfGroup:
    """Who can be mentioned in comments on the group: everybody who sees it."""
    return PeopleOfGroup(names=comments.people_of(store, group))


@router.get("/threads", operation_id="listThreads", responses=responses(404))
@may(Action.READ, group=OwnedKind.GROUP)
@limit(LOOKS)
@paged()
def list_threads(group: Id, store: AppStore, actor: Actor) -> ThreadList:
    """What people say to each other about the group, the oldest thread first."""
    found = comments.list_threads(store, group)
    return ThreadList(items=[ThreadDocument.of(thread, actor) for thread in found])


def _thread_response(thread: comments.StoredThread, actor: str, status: int = 200) -> Response:
    return document(ThreadDocument.of(thread, actor), status)


@router.post(
    "/threads",
    operation_id="beginThread",
    response_model=ThreadDocument,
    status_code=201,
    responses=responses(404, 409, 413, 415),
)
@may(Action.ANNOTATE, group=OwnedKind.GROUP)
@responds(partial(_thread_response, status=201), "actor")
def begin_thread(group: Id, new: NewThread, store: AppStore, actor: Actor) -> comments.StoredThread:
    """Say something about the group, a view of it, or a place there.

    Whom it mentions is told, where they see the dataset.
    """
    at = None if new.at is None else (new.at.x, new.at.y)
    return comments.begin_thread(store, group, new.text, actor=actor, view=new.view, at=at)


@router.patch(
    "/threads/{thread}",
    operation_id="changeThread",
    response_model=ThreadDocument,
    responses=responses(404, 409, 413, 415),
)
@may(Action.ANNOTATE, group=OwnedKind.GROUP)
@responds(_thread_response, "actor")
def change_thread(
    group: Id, thread: Id, change: ThreadEdit, store: AppStore, actor: Actor
) -> comments.StoredThread:
    """Settle a thread, or open it again."""
    return comments.resolve(store, group, thread, change.resolved, actor=actor)


@router.post(
    "/threads/{thread}/comments",
    operation_id="replyToThread",
    response_model=ThreadDocument,
    status_code=201,
    responses=responses(404, 409, 413, 415),
)
@may(Action.ANNOTATE, group=OwnedKind.GROUP)
@responds(partial(_thread_response, status=201), "actor")
def reply(
    group: Id, thread: Id, new: NewComment, store: AppStore, actor: Actor
) -> comments.StoredThread:
    """Say something in a thread; who spoke there before is told."""
    return comments.reply(store, group, thread, new.text, actor=actor)


@router.patch(
    "/threads/{thread}/comments/{comment}",
    operation_id="changeComment",
    response_model=ThreadDocument,
    responses=responses(403, 404, 409, 413, 415),
)
@may(Action.ANNOTATE, group=OwnedKind.GROUP)
@responds(_thread_response, "actor")
def change_comment(
    group: Id, thread: Id, comment: Id, new: NewComment, store: AppStore, actor: Actor
) -> comments.StoredThread:
    """Give a comment of one's own another text; it is marked as edited."""
    return comments.change(store, group, thread, comment, new.text, actor=actor)


@router.delete(
    "/threads/{thread}/comments/{comment}",
    operation_id="deleteComment",
    status_code=204,
    responses=responses(403, 404),
)
@may(Action.ANNOTATE, group=OwnedKind.GROUP)
@responds(no_content)
def delete_comment(group: Id, thread: Id, comment: Id, store: AppStore, actor: Actor) -> None:
    """Delete a comment of one's own; a thread in which nothing else is said goes with it."""
    comments.remove(store, group, thread, comment, actor=actor)
