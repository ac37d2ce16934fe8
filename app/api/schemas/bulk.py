"""Verdicts for every group that a query matches."""

from __future__ import annotations

from datetime import datetime
from typing import Annotated

from pydantic import BaseModel, ConfigDict, Field

from app.api.schemas.group import State
from app.review.queue.query import MAX_LISTED_LENGTH
from app.review.verdicts.bulk import Batch, BatchReport, BulkPlan, Refusal
from app.review.verdicts.bulk_redo import RedoReport
from app.soccer.reasons import Reason


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
    state: State
    reason: Reason | None = None
    note: Annotated[str, Field(max_length=2000)] | None = None
    expected: Annotated[int, Field(ge=0, le=2**53)] | None = Field(
        default=None, description="`would_change` of the dry run; 409 when it is another by now."
    )


class RefusalDocument(BaseModel):
    """Groups that are left alone: `unsolved`, `needs_note` (they fail a gate), `no_picture`."""

    reason: str
    groups: int

    @staticmethod
    def of(refusal: Refusal) -> RefusalDocument:
        """The document of a refusal."""
        return RefusalDocument(**vars(refusal))


class SampleDocument(BaseModel):
    """One of the groups that would change, with the number and label that the queue shows."""

    id: int
    key: str
    number: int
    label: str


class BulkResult(BaseModel):
    """What a bulk verdict would do (`dry_run=true`), or did."""

    dry_run: bool
    matches: int | None = Field(description="Groups that the query finds; dry run only.")
    would_change: int | None = Field(description="Dry run only, like `sample`.")
    sample: list[SampleDocument] | None
    batch: int | None = Field(
        description="What `POST /verdict-batches/{batch}/undo` takes back; null when nothing "
        "changed."
    )
    changed: int
    refused: list[RefusalDocument]

    @staticmethod
    def planned(plan: BulkPlan) -> BulkResult:
        """The document of a dry run."""
        return BulkResult(
            dry_run=True,
            matches=plan.matches,
            would_change=plan.would_change,
            sample=[SampleDocument(**vars(group)) for group in plan.sample],
            batch=None,
            changed=0,
            refused=[RefusalDocument.of(item) for item in plan.refused],
        )

    @staticmethod
    def done(report: BatchReport) -> BulkResult:
        """The document of what was done."""
        return BulkResult(
            dry_run=False,
            matches=None,
            would_change=None,
            sample=None,
            batch=report.batch,
            changed=report.changed,
            refused=[RefusalDocument.of(item) for item in report.refused],
        )


class BatchDocument(BaseModel):
    """A bulk verdict as it is remembered."""

    id: int
    at: datetime
    actor: str
    q: str
    state: State
    reason: Reason | None
    note: str | None
    changed: int
    done: bool = Field(description="false while it runs, or when it was interrupted.")
    undone: datetime | None
    undone_by: str | None
    redone: int | None = Field(description="The batch that gave it again after it was undone.")

    @staticmethod
    def of(batch: Batch) -> BatchDocument:
        """The document of a batch."""
        values = {name: value for name, value in vars(batch).items() if name != "query"}
        return BatchDocument.model_validate({**values, "q": batch.query})


class BatchList(BaseModel):
    """Bulk verdicts, the newest first."""

    items: list[BatchDocument]


class UndoDocument(BaseModel):
    """What taking a batch back did."""

    batch: int
    restored: int = Field(description="Groups that have the verdict of before again.")
    kept: int = Field(description="Groups that somebody has judged since.")


class RedoDocument(BaseModel):
    """What giving a batch again did."""

    batch: int | None = Field(
        description="The new batch, which can be taken back; null when nothing changed."
    )
    changed: int = Field(description="Groups that have the verdict again.")
    kept: int = Field(description="Groups that somebody has judged or edited since.")
    refused: list[RefusalDocument]

    @staticmethod
    def of(report: RedoReport) -> RedoDocument:
        """The document of what was done."""
        refused = [RefusalDocument.of(item) for item in report.refused]
        return RedoDocument(**{**vars(report), "refused": refused})
