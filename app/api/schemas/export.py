"""Exports: what to write, and where it can be fetched."""

from __future__ import annotations

from datetime import datetime
from typing import Annotated, Literal

from pydantic import BaseModel, ConfigDict, Field, StrictBool

from app.api.export_folder import ExportEntry

Format = Literal["soccernet-v3d", "issia-3d", "cameras", "sn-calibration", "soccernet-v3"]
Boxes = Literal["optimized", "annotated", "exact"]
Images = Literal["none", "copy"]


class ExportRequest(BaseModel):
    """Which groups of which dataset, in which format."""

    model_config = ConfigDict(
        extra="forbid",
        json_schema_extra={"examples": [{"dataset": "sample", "format": "soccernet-v3d"}]},
    )

    dataset: Annotated[str, Field(min_length=1, max_length=200)]
    format: Format
    all: StrictBool = Field(default=False, description="Every group, not the accepted ones alone.")
    boxes: Boxes = Field(default="optimized", description="Which ball box is written.")
    images: Images = Field(default="none", description="Whether frames are copied into the zip.")


class ExportDocument(BaseModel):
    """An export that is ready."""

    id: str
    status: Literal["ready"]
    request: ExportRequest
    created: datetime
    content: str = Field(description="Address of the zip.")
    bytes: int
    counts: dict[str, int] = Field(description="As the format counts.")
    left_out: dict[str, int] = Field(
        description="Accepted groups that are not in it, by reason: stale, failing, unsolved."
    )
    missing_images: list[str]

    @staticmethod
    def of(entry: ExportEntry) -> ExportDocument:
        """The document of a finished export."""
        return ExportDocument.model_validate(
            {
                "id": entry.id,
                "status": "ready",
                "request": entry.request,
                "created": entry.created,
                "content": f"/api/v1/exports/{entry.id}/content",
                "bytes": entry.bytes,
                "counts": entry.counts,
                "left_out": entry.left_out,
                "missing_images": entry.missing_images,
            }
        )
