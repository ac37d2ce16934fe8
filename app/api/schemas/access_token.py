"""Tokens: with what scripts ask a team's server, in the name of a person."""

from __future__ import annotations

from datetime import datetime
from typing import Annotated

from pydantic import BaseModel, ConfigDict, Field, StrictInt

from app.api.schemas.document import Document, ListDocument
from app.review.people.access_tokens import DAYS, MOST_DAYS
from app.review.people.roles import Scope


class NewAccessToken(BaseModel):
    """What a token shall be for."""

    model_config = ConfigDict(
        extra="forbid",
        json_schema_extra={
            "examples": [{"name": "nightly export", "scopes": ["export"], "days": 30}]
        },
    )

    name: Annotated[
        str,
        Field(min_length=1, max_length=40, description="The log has it beside your own name."),
    ]
    scopes: Annotated[list[Scope], Field(min_length=1, max_length=len(Scope))] = Field(
        description="What it is for; each lets it look, too, and none more than your role."
    )
    days: Annotated[
        StrictInt,
        Field(ge=1, le=MOST_DAYS, description="After so many it is no longer valid."),
    ] = DAYS
    dataset: Annotated[
        str | None,
        Field(
            min_length=1,
            max_length=200,
            description="Name or id of the one dataset that it is for; null: all of yours.",
        ),
    ] = None


class AccessTokenDocument(Document):
    """A token; its text is shown once, when it is made."""

    id: int
    name: str
    start: str = Field(description="Its first characters, by which one knows it again.")
    scopes: list[Scope]
    dataset: str | None = Field(description="The one dataset that it is for; null: all.")
    created: datetime
    expires: datetime
    used: datetime | None = Field(description="When it was used last, to some minutes.")
    expired: bool = Field(description="It is no longer valid.")


class AccessTokenList(ListDocument[AccessTokenDocument]):
    """Tokens, the newest first."""


class MadeAccessToken(Document):
    """A new token, and its text: it is shown this once."""

    token: AccessTokenDocument
    text: str = Field(description="Send it as `Authorization: Bearer` and this.")
