"""Uploads: files that were sent, and how long they stay."""

from __future__ import annotations

from datetime import datetime

from pydantic import BaseModel, Field

from app.api.schemas.document import ListDocument
from app.store.uploads import Upload


class UploadDocument(BaseModel):
    """An uploaded file."""

    id: str = Field(description="Digest of its name and content.")
    name: str
    bytes: int
    created: datetime
    kept: bool = Field(description="Whether a dataset reads frames from it; it then stays.")
    format: str | None = Field(description="Format that it most likely has.")

    @staticmethod
    def of(upload: Upload) -> UploadDocument:
        """The document of an upload."""
        return UploadDocument.model_validate(vars(upload))


class UploadList(ListDocument[UploadDocument]):
    """Uploads, the newest first."""

    max_bytes: int = Field(description="Largest file that is taken.")
    days: int = Field(description="After so many days an upload expires.")
