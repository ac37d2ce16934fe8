"""Exports: what to write, and where it can be fetched."""

from __future__ import annotations

from datetime import datetime
from typing import Annotated, Literal

from pydantic import BaseModel, ConfigDict, Field, StrictBool

from app.features.exports.folder import ExportEntry
from app.features.jobs.queries import DONE, Job
from app.features.jobs.schemas import JobDocument
from app.features.versions.schemas import VersionId
from app.http.documents import Document, ListDocument
from app.soccer.choices import BoxKind, ExportFormat, JobState, PicturesSent, TrainingViews


class ExportRequest(BaseModel):
    """Which groups of which dataset, in which format."""

    model_config = ConfigDict(
        extra="forbid",
        json_schema_extra={"examples": [{"dataset": "sample", "format": "soccernet-v3d"}]},
    )

    dataset: Annotated[str, Field(min_length=1, max_length=200)]
    format: ExportFormat
    all: StrictBool = Field(default=False, description="Every group, not the accepted ones alone.")
    version: VersionId | None = Field(
        default=None,
        description="Id, name or hash of a frozen version: its groups as they were, always the "
        "same bytes.",
    )
    boxes: BoxKind = Field(
        default="optimized",
        description="Which ball box is written: coco, parquet, soccernet-v3d and yolo.",
    )
    images: PicturesSent = Field(
        default="none",
        description="Whether frames are copied into the zip; touchline holds none.",
    )
    views: TrainingViews = Field(
        default="valid",
        description="coco and yolo: whether views that annotate a ball and are in no valid pair "
        "take part.",
    )
    to: Annotated[str, Field(max_length=1000, pattern="^s3://")] | None = Field(
        default=None,
        description="Where in an object store the zip goes, `s3://NAME/folder/file.zip`, if the "
        "operator allows it; without it the zip stays on the server.",
    )


class FormatDocument(Document):
    """Whether a dataset can be exported in a format."""

    format: ExportFormat
    possible: bool = Field(description="Whether it holds what the dataset has.")
    reason: str | None = Field(description="Why it cannot; null: it can.")
    hint: str | None = Field(description="What to do instead, where there is anything.")
    options: list[str] = Field(
        description="Which of `boxes`, `images` and `views` it uses; a request with another is refused."
    )


class FormatList(ListDocument[FormatDocument]):
    """Every export format."""


class ExportJobDocument(JobDocument):
    """The job that writes an export; its `id` is that of the export, too."""

    content: str = Field(description="Address of the zip; a request before it is ready waits.")

    @staticmethod
    def of_export(job: JobDocument) -> ExportJobDocument:
        """The document of an export's job."""
        content = f"/api/v1/exports/{job.id}/content"
        return ExportJobDocument(**job.model_dump(), content=content)


class ExportDocument(BaseModel):
    """An export: what was asked for, how far it is, and, once it is ready, what came of it."""

    id: str
    state: Literal[JobState, "gone", "expired"] = Field(
        description=(
            "State of its job; `gone`: a person deleted the file; `expired`: the server deleted "
            "the file after some days."
        )
    )
    status: Literal["waiting", "running", "ready", "failed", "cancelled", "gone", "expired"] = (
        Field(
            description="The same in other words: `ready` is `done`. Read `state`.",
            json_schema_extra={"deprecated": True},
        )
    )
    request: ExportRequest
    created: datetime
    expires: datetime | None = Field(
        description="When the server deletes its file; null: never, or there is none."
    )
    content: str | None = Field(description="Address of the zip, once it is ready.")
    bytes: int | None
    counts: dict[str, int] | None = Field(
        description="What was written, by kind: groups, views, boxes and so on."
    )
    left_out: dict[str, int] | None = Field(
        description="Accepted groups that are not in it, by reason: stale, failing, unsolved."
    )
    missing_images: list[str] | None
    incomplete: str | None = Field(
        description="What the files still lack before they can be used, in words; null: nothing."
    )
    error: str | None = Field(description="Why it failed.")

    @staticmethod
    def of(entry: ExportEntry, days: int) -> ExportDocument:
        """The document of a finished export; files are kept for so many days (0: for good)."""
        return ExportDocument.model_validate(
            {
                **vars(entry),
                "state": "expired" if entry.expired else "done",
                "status": "expired" if entry.expired else "ready",
                "incomplete": entry.incomplete,
                "content": None if entry.expired else f"/api/v1/exports/{entry.id}/content",
                "expires": entry.expires(days),
                "error": None,
            }
        )

    @staticmethod
    def of_job(job: Job, entry: ExportEntry | None, days: int) -> ExportDocument:
        """The document of an export by its job; ``entry`` is what it left behind, if anything."""
        if entry is not None:
            return ExportDocument.of(entry, days)
        nothing = dict.fromkeys(
            (
                "expires",
                "content",
                "bytes",
                "counts",
                "left_out",
                "missing_images",
                "incomplete",
            )
        )
        return ExportDocument.model_validate(
            {
                **nothing,
                "id": str(job.id),
                "state": "gone" if job.state == DONE else job.state,
                "status": "gone" if job.state == DONE else job.state,
                "request": job.request,
                "created": job.created,
                "error": job.problem and job.problem["detail"],
            }
        )


class ExportPage(ListDocument[ExportDocument]):
    """Exports, the newest first; ``next`` is the cursor of the next page."""
