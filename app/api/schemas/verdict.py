"""The verdict that somebody sends."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import BaseModel, ConfigDict, Field, FiniteFloat, StrictBool

from app.soccer.choices import VerdictState
from app.soccer.finding import FINDING_KINDS
from app.soccer.reasons import MAX_NOTE, Reason


class VerdictEdit(BaseModel):
    """Accept, reject with a reason, defer, or take a verdict back.

    A rejection needs a reason; `other` needs a note, and so does accepting a group that fails a
    gate, or whose ball cannot be used.
    """

    model_config = ConfigDict(
        extra="forbid",
        json_schema_extra={
            "examples": [
                {"state": "accepted"},
                {"state": "rejected", "reason": "bad_field_lines"},
                {"state": "rejected", "reason": "other", "note": "wrong match"},
            ]
        },
    )

    state: VerdictState
    reason: Reason | None = None
    note: Annotated[str, Field(max_length=MAX_NOTE)] | None = None


Name = Annotated[str, Field(max_length=400)]


class DismissalEdit(BaseModel):
    """A finding of the group, as its solution has it, and whether it is dismissed."""

    model_config = ConfigDict(
        extra="forbid",
        json_schema_extra={
            "examples": [{"kind": "ball_size", "view": "0_1.png", "dismissed": True}]
        },
    )

    kind: Literal[FINDING_KINDS]  # type: ignore[valid-type]
    view: Name | None = Field(default=None, description="Key of the view; null: the whole group.")
    marking: Name | None = None
    suggested: Name | None = None
    number: FiniteFloat | None = Field(
        default=None, description="Where several findings have the rest: the nearest is meant."
    )
    dismissed: StrictBool = Field(description="false: it is to be looked at again.")
    note: Annotated[str, Field(max_length=MAX_NOTE)] | None = None
