"""Documents of verdicts, on one group and in bulk."""

from __future__ import annotations

from datetime import datetime
from typing import Annotated, Literal

from pydantic import BaseModel, ConfigDict, Field, FiniteFloat, StrictBool

from app.features.queue.query import MAX_LISTED_LENGTH
from app.features.verdicts.bulk import BatchReport, BulkPlan, Refusal, SampleGroup
from app.http.documents import Document, ListDocument
from app.soccer.choices import VerdictState
from app.soccer.finding import FINDING_KINDS
from app.soccer.group import MAX_NOTE, Reason


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


class BulkVerdict(BaseModel):
    """A verdict, and the query whose groups shall have it."""

    model_config = ConfigDict(
        extra="forbid",
        json_schema_extra={
            "examples": [
                {"q": "status:unreviewed passes:yes sigma<0.3", "state": "accepted"},
                {"q": "finding:sides_swapped", "state": "rejected", "reason": "sides_confused"},
                {"q": "id:12,15,19", "state": "deferred"},
            ]
        },
    )

    q: Annotated[
        str,
        Field(
            max_length=MAX_LISTED_LENGTH,
            description="As in the browser; empty: all. More than 1000 characters only for lists "
            "of groups, `id:12,15,19` or, for all but these, `-id:12,15,19`.",
        ),
    ] = ""
    state: VerdictState
    reason: Reason | None = None
    note: Annotated[str, Field(max_length=MAX_NOTE)] | None = None
    expected: Annotated[int, Field(ge=0, le=2**53)] | None = Field(
        default=None, description="`would_change` of the dry run; 409 when it is another by now."
    )


class BulkResult(Document):
    """What a bulk verdict would do (`dry_run=true`), or did."""

    dry_run: bool
    matches: int | None = Field(description="Groups that the query finds; dry run only.")
    would_change: int | None = Field(description="Dry run only, like `sample`.")
    sample: list[SampleGroup] | None
    batch: int | None = Field(
        description="Batch that `POST /verdict-batches/{batch}/undo` undoes; null when nothing changed."
    )
    changed: int
    refused: list[Refusal]

    @staticmethod
    def planned(plan: BulkPlan) -> BulkResult:
        """The document of a dry run."""
        return BulkResult(dry_run=True, batch=None, changed=0, **vars(plan))

    @staticmethod
    def done(report: BatchReport) -> BulkResult:
        """The document of what was done."""
        return BulkResult(
            dry_run=False, matches=None, would_change=None, sample=None, **vars(report)
        )


class BatchDocument(Document):
    """A bulk verdict as it is remembered."""

    id: int
    at: datetime
    actor: str
    q: str = Field(validation_alias="query")
    state: VerdictState
    reason: Reason | None
    note: str | None
    changed: int
    done: bool = Field(description="false while it runs, or when it was interrupted.")
    undone: datetime | None
    undone_by: str | None
    redone: int | None = Field(description="The batch that gave it again after it was undone.")


class BatchList(ListDocument[BatchDocument]):
    """Bulk verdicts, the newest first."""
