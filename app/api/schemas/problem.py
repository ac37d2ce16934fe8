"""Problem: the body of every answer that is not a success (RFC 9457)."""

from __future__ import annotations

from typing import Any

from pydantic import BaseModel, Field

from app.api.schemas.event import PresenceDocument

MEDIA_TYPE = "application/problem+json"


class FieldProblem(BaseModel):
    """One field of a request that cannot be used."""

    pointer: str = Field(description="JSON pointer into the body, or `/name` of a parameter.")
    detail: str


class Problem(BaseModel):
    """What went wrong, for people (`detail`, `hint`) and for programs (`type`, `pointer`)."""

    type: str = Field(
        description="Names the kind of problem.", examples=["urn:touchline:problem:not-found"]
    )
    title: str = Field(description="The kind of problem in a few words.")
    status: int = Field(description="The HTTP status.", examples=[404])
    detail: str = Field(description="One sentence about this occurrence.")
    hint: str | None = Field(default=None, description="What to do about it.")
    pointer: str | None = Field(
        default=None, description="JSON pointer to the field of the body that is at fault."
    )
    instance: str = Field(description="Id of this occurrence, also in the server's log.")
    errors: list[FieldProblem] | None = Field(
        default=None, description="Every field at fault (422)."
    )
    station: int | None = Field(
        default=None, description="The station that owns the lines (409 on a static view)."
    )
    here: list[PresenceDocument] | None = Field(
        default=None, description="Who has the group of a batch open (409 on its lease)."
    )
    current: dict[str, Any] | None = Field(
        default=None, description="The state as it is now, complete (412)."
    )
