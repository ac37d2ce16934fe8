"""What was done to the pictures of a dataset's matches, and what is asked about it."""

from __future__ import annotations

from pydantic import BaseModel, ConfigDict, Field

from app.api.schemas.document import Document, ListDocument
from app.api.schemas.group import PictureDocument
from app.api.schemas.view import PictureEdit


class MatchPictureDocument(Document):
    """The pictures of one match's main camera."""

    match: str
    frames: int = Field(description="How many of them have lines.")
    picture: PictureDocument | None = Field(
        description="What was done to most of them; null: they are as they were taken."
    )
    mixed: bool = Field(description="They are not all alike.")


class MatchPicturesDocument(ListDocument[MatchPictureDocument]):
    """The pictures of a dataset's matches, by name of the match."""


class PictureEstimateRequest(BaseModel):
    """Estimate what was done to the pictures of matches."""

    model_config = ConfigDict(extra="forbid", json_schema_extra={"examples": [{}]})

    match: str | None = Field(
        default=None, min_length=1, max_length=1000, description="This match alone; null: all."
    )


class MatchPictureChange(BaseModel):
    """Say what was done to the pictures of a match's main camera."""

    model_config = ConfigDict(
        extra="forbid", json_schema_extra={"examples": [{"match": "a/b/c", "picture": None}]}
    )

    match: str = Field(min_length=1, max_length=1000)
    picture: PictureEdit | None = Field(description="As proposed; null: as they were taken.")
