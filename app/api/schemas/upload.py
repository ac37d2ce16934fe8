"""Uploads: files that were sent, and how long they stay."""

from __future__ import annotations

from datetime import datetime

from pydantic import Field

from app.api.schemas.document import Document, ListDocument


class UploadDocument(Document):
    """An uploaded file."""

    id: str = Field(description="Digest of its name and content.")
    name: str
    bytes: int
    created: datetime
    kept: bool = Field(description="Whether a dataset reads frames from it; it then stays.")
    format: str | None = Field(description="Format that it most likely has.")


class UploadList(ListDocument[UploadDocument]):
    """Uploads, the newest first."""

    max_bytes: int = Field(description="Largest file that is taken.")
    days: int = Field(description="After so many days an upload expires.")
    used_bytes: int = Field(
        description="What one's own uploads have together, with those that are on their way."
    )
    quota_bytes: int | None = Field(
        description="What they may have together; null: there is no limit."
    )
