"""The verdict that somebody sends."""

from __future__ import annotations

from typing import Annotated

from pydantic import BaseModel, ConfigDict, Field

from app.soccer.choices import VerdictState
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
