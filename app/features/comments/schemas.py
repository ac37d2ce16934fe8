"""Threads: what people say to each other about a group."""

from __future__ import annotations

from datetime import datetime
from typing import Annotated, Self

from pydantic import BaseModel, ConfigDict, Field

from app.features.comments.queries import StoredComment, StoredThread
from app.features.comments.service import LONGEST
from app.http.documents import Document, ListDocument
from app.soccer.actors import is_actor_of, person_of
from app.soccer.frames import MAX_PIXEL

Text = Annotated[str, Field(min_length=1, max_length=LONGEST, description="Plain text.")]


class Spot(BaseModel):
    """A place in a view, pixels of its annotated size."""

    model_config = ConfigDict(extra="forbid", from_attributes=True)

    x: float = Field(ge=-MAX_PIXEL, le=MAX_PIXEL, allow_inf_nan=False)
    y: float = Field(ge=-MAX_PIXEL, le=MAX_PIXEL, allow_inf_nan=False)


class NewComment(BaseModel):
    """Something to say; `@name` mentions somebody who sees the dataset."""

    model_config = ConfigDict(
        extra="forbid", json_schema_extra={"examples": [{"text": "@anna, is this the ball?"}]}
    )

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
    at: Spot | None = None


class ThreadEdit(BaseModel):
    """What becomes of a thread."""

    model_config = ConfigDict(extra="forbid", json_schema_extra={"examples": [{"resolved": True}]})

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
        return cls(**vars(comment), mine=is_actor_of(comment.actor, person_of(actor)))


class ThreadDocument(Document):
    """Comments that belong together, the oldest first."""

    id: int
    view: str | None = Field(description="Key of the view that it is about; null: the group.")
    at: Spot | None = Field(description="Where in the view, pixels of its annotated size.")
    created: datetime
    resolved: datetime | None = Field(description="When it was settled; null: it is open.")
    resolved_by: str | None
    comments: list[CommentDocument]

    @classmethod
    def of(cls, thread: StoredThread, actor: str) -> Self:
        """The document of a thread, for whom it is shown to."""
        comments = [CommentDocument.of(comment, actor) for comment in thread.comments]
        at = None if thread.x is None or thread.y is None else Spot(x=thread.x, y=thread.y)
        return cls(**{**vars(thread), "at": at, "comments": comments})


class ThreadList(ListDocument[ThreadDocument]):
    """Everything that people say to each other about a group."""


class PeopleOfGroup(Document):
    """Who sees a group, and can be mentioned there; nobody where people do not log in."""

    names: list[str]
