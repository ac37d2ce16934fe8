"""Threads: what people say to each other about a group, open until somebody settles it."""

from __future__ import annotations

from fastapi import APIRouter

from app.api.deps import Actor, AppStore, Id
from app.api.problem import responses
from app.api.schemas.thread import (
    NewComment,
    NewThread,
    PeopleOfGroup,
    ThreadDocument,
    ThreadEdit,
    ThreadList,
)
from app.review.talk import comments

router = APIRouter(prefix="/groups/{group}", tags=["comments"])


@router.get("/people", operation_id="listPeopleOfGroup", responses=responses(404))
def list_people(group: Id, store: AppStore) -> PeopleOfGroup:
    """Who can be mentioned in comments on the group: everybody who sees it."""
    return PeopleOfGroup(names=comments.people_of(store, group))


@router.get("/threads", operation_id="listThreads", responses=responses(404))
def list_threads(group: Id, store: AppStore, actor: Actor) -> ThreadList:
    """What people say to each other about the group, the oldest thread first."""
    found = comments.list_threads(store, group)
    return ThreadList(items=[ThreadDocument.of(thread, actor) for thread in found])


@router.post(
    "/threads",
    operation_id="beginThread",
    status_code=201,
    responses=responses(404, 409, 413, 415),
)
def begin_thread(group: Id, new: NewThread, store: AppStore, actor: Actor) -> ThreadDocument:
    """Say something about the group, a view of it, or a place there.

    Whom it mentions is told, where they see the dataset.
    """
    at = None if new.at is None else (new.at.x, new.at.y)
    thread = comments.begin_thread(store, group, new.text, actor=actor, view=new.view, at=at)
    return ThreadDocument.of(thread, actor)


@router.patch(
    "/threads/{thread}", operation_id="changeThread", responses=responses(404, 409, 413, 415)
)
def change_thread(
    group: Id, thread: Id, change: ThreadEdit, store: AppStore, actor: Actor
) -> ThreadDocument:
    """Settle a thread, or open it again."""
    found = comments.resolve(store, group, thread, change.resolved, actor=actor)
    return ThreadDocument.of(found, actor)


@router.post(
    "/threads/{thread}/comments",
    operation_id="replyToThread",
    status_code=201,
    responses=responses(404, 409, 413, 415),
)
def reply(group: Id, thread: Id, new: NewComment, store: AppStore, actor: Actor) -> ThreadDocument:
    """Say something in a thread; who spoke there before is told."""
    found = comments.reply(store, group, thread, new.text, actor=actor)
    return ThreadDocument.of(found, actor)


@router.patch(
    "/threads/{thread}/comments/{comment}",
    operation_id="changeComment",
    responses=responses(403, 404, 409, 413, 415),
)
def change_comment(
    group: Id, thread: Id, comment: Id, new: NewComment, store: AppStore, actor: Actor
) -> ThreadDocument:
    """Give a comment of one's own another text; it is marked as edited."""
    found = comments.change(store, group, thread, comment, new.text, actor=actor)
    return ThreadDocument.of(found, actor)


@router.delete(
    "/threads/{thread}/comments/{comment}",
    operation_id="deleteComment",
    status_code=204,
    responses=responses(403, 404),
)
def delete_comment(group: Id, thread: Id, comment: Id, store: AppStore, actor: Actor) -> None:
    """Delete a comment of one's own; a thread in which nothing else is said goes with it."""
    comments.remove(store, group, thread, comment, actor=actor)
