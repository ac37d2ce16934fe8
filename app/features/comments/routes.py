"""Threads: what people say to each other about a group, open until somebody settles it."""

from __future__ import annotations

from datetime import datetime
from functools import partial
from typing import Annotated, Self

from fastapi import APIRouter, Response
from pydantic import BaseModel, ConfigDict, Field

from app.features.comments import service as comments
from app.features.comments.queries import StoredComment, StoredThread
from app.features.comments.service import LONGEST
from app.http.cursor import paged
from app.http.deps import Actor, AppStore, Id
from app.http.documents import (
    Document,
    ListDocument,
    RequestBody,
    make_document_response,
    make_empty_response,
    respond_with,
)
from app.http.permissions import Action, OwnedKind, may
from app.http.problem import responses
from app.http.route import Route
from app.soccer.actors import is_actor_of, person_of_actor
from app.soccer.frames import MAX_PIXEL

Text = Annotated[str, Field(min_length=1, max_length=LONGEST, description="Plain text.")]


router = APIRouter(prefix="/groups/{group}", tags=["comments"], route_class=Route)


class PlaceInView(BaseModel):
    """A place in a view, pixels of its annotated size."""

    model_config = ConfigDict(extra="forbid", from_attributes=True)

    x: float = Field(ge=-MAX_PIXEL, le=MAX_PIXEL, allow_inf_nan=False)
    y: float = Field(ge=-MAX_PIXEL, le=MAX_PIXEL, allow_inf_nan=False)


class NewComment(RequestBody, examples=[{"text": "@anna, is this the ball?"}]):
    """Something to say; `@name` mentions somebody who sees the dataset."""

    text: Text


class NewThread(NewComment):
    """The first comment of a thread, and what it is about."""

    model_config = ConfigDict(
        extra="forbid",
        json_schema_extra={
            "examples": [
                {"text": "@anna, is this the ball?"},
                {"text": "Hidden here.", "view": "cam1", "at": {"x": 612.0, "y": 330.0}},
            ]
        },
    )

    view: str | None = Field(default=None, max_length=500, description="Key of the view.")
    at: PlaceInView | None = None


class ThreadEdit(RequestBody, examples=[{"resolved": True}]):
    """What becomes of a thread."""

    resolved: bool


class CommentDocument(Document):
    """What one person said."""

    id: int
    actor: str
    at: datetime
    edited: datetime | None = Field(description="When its writer changed or deleted it.")
    text: str | None = Field(description="null: its writer has deleted it.")
    mentions: list[str] = Field(description="Names of the mentioned people.")
    mine: bool = Field(description="Whether the logged-in person wrote it and can change it.")

    @classmethod
    def of(cls, comment: StoredComment, actor: str) -> Self:
        """The document of a comment, for whom it is shown to."""
        return cls(**vars(comment), mine=is_actor_of(comment.actor, person_of_actor(actor)))


class ThreadDocument(Document):
    """Comments that belong together, the oldest first."""

    id: int
    view: str | None = Field(description="Key of the view that it is about; null: the group.")
    at: PlaceInView | None = Field(description="Where in the view, pixels of its annotated size.")
    created: datetime
    resolved: datetime | None = Field(description="When it was settled; null: it is open.")
    resolved_by: str | None
    comments: list[CommentDocument]

    @classmethod
    def of(cls, thread: StoredThread, actor: str) -> Self:
        """The document of a thread, for whom it is shown to."""
        comments = [CommentDocument.of(comment, actor) for comment in thread.comments]
        at = None if thread.x is None or thread.y is None else PlaceInView(x=thread.x, y=thread.y)
        return cls(**{**vars(thread), "at": at, "comments": comments})


class ThreadList(ListDocument[ThreadDocument]):
    """Everything that people say to each other about a group."""


class MentionablePeople(Document):
    """The people who see a group and can be mentioned there; empty on a server without accounts."""

    names: list[str]


@router.get("/people")
@may(Action.ANNOTATE, group=OwnedKind.GROUP)
def list_people_of_group(group: Id, store: AppStore) -> MentionablePeople:
    """The people who can be mentioned in comments on the group: all who see it."""
    return MentionablePeople(names=comments.list_mentionable_people(store, group))


@router.get("/threads")
@may(Action.READ, group=OwnedKind.GROUP)
@paged()
def list_threads(group: Id, store: AppStore, actor: Actor) -> ThreadList:
    """The comment threads of the group, oldest first."""
    found = comments.list_threads(store, group)
    return ThreadList(items=[ThreadDocument.of(thread, actor) for thread in found])


def _thread_response(thread: comments.StoredThread, actor: str, status: int = 200) -> Response:
    return make_document_response(ThreadDocument.of(thread, actor), status)


@router.post("/threads", response_model=ThreadDocument, status_code=201, responses=responses(409))
@may(Action.ANNOTATE, group=OwnedKind.GROUP)
@respond_with(partial(_thread_response, status=201), "actor")
def begin_thread(group: Id, new: NewThread, store: AppStore, actor: Actor) -> comments.StoredThread:
    """Say something about the group, a view of it, or a place there.

    Whom it mentions is told, where they see the dataset.
    """
    at = None if new.at is None else (new.at.x, new.at.y)
    return comments.begin_thread(store, group, new.text, actor=actor, view=new.view, at=at)


@router.patch("/threads/{thread}", response_model=ThreadDocument, responses=responses(409))
@may(Action.ANNOTATE, group=OwnedKind.GROUP)
@respond_with(_thread_response, "actor")
def change_thread(
    group: Id, thread: Id, change: ThreadEdit, store: AppStore, actor: Actor
) -> comments.StoredThread:
    """Settle a thread, or open it again."""
    return comments.resolve_thread(store, group, thread, change.resolved, actor=actor)


@router.post(
    "/threads/{thread}/comments",
    response_model=ThreadDocument,
    status_code=201,
    responses=responses(409),
)
@may(Action.ANNOTATE, group=OwnedKind.GROUP)
@respond_with(partial(_thread_response, status=201), "actor")
def reply_to_thread(
    group: Id, thread: Id, new: NewComment, store: AppStore, actor: Actor
) -> comments.StoredThread:
    """Say something in a thread; who spoke there before is told."""
    return comments.add_reply(store, group, thread, new.text, actor=actor)


@router.patch(
    "/threads/{thread}/comments/{comment}", response_model=ThreadDocument, responses=responses(409)
)
@may(Action.ANNOTATE, group=OwnedKind.GROUP)
@respond_with(_thread_response, "actor")
def change_comment(
    group: Id, thread: Id, comment: Id, new: NewComment, store: AppStore, actor: Actor
) -> comments.StoredThread:
    """Give a comment of one's own another text; it is marked as edited."""
    return comments.edit_comment(store, group, thread, comment, new.text, actor=actor)


@router.delete("/threads/{thread}/comments/{comment}", status_code=204)
@may(Action.ANNOTATE, group=OwnedKind.GROUP)
@respond_with(make_empty_response)
def delete_comment(group: Id, thread: Id, comment: Id, store: AppStore, actor: Actor) -> None:
    """Delete a comment of one's own; a thread in which nothing else is said goes with it."""
    comments.delete_comment(store, group, thread, comment, actor=actor)
