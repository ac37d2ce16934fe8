"""What was read of the paint in a dataset's pictures, and what is asked about it."""

from __future__ import annotations

from pydantic import BaseModel, ConfigDict, Field

from app.api.schemas.document import Document, ListDocument


class MatchPaintDocument(Document):
    """What was read of the pictures of one match."""

    match: str
    groups: int
    views: int = Field(description="Views of moving cameras that have lines.")
    without_picture: int = Field(description="How many of them have no picture.")
    read: int = Field(description="How many of their pictures were read.")
    old: int | None = Field(
        description="How many were read for other lines than their view has now, beside other "
        "boxes of people, or by an older version; null where too many were read to compare them."
    )
    painted: int = Field(
        description="How many of those place their camera, unless the lines changed since."
    )
    no_paint: int = Field(description="How many show too little paint.")
    paint_disagrees: int = Field(
        description="In how many the paint does not lie where the lines were drawn."
    )
    no_frame: int = Field(description="How many are missing or cannot be read.")
    sentence: str = Field(description="All that in words.")


class DatasetPaintDocument(ListDocument[MatchPaintDocument]):
    """What was read of the paint in a dataset's pictures, by name of the match."""

    used: bool = Field(description="Whether the policy uses it: `calibration.source`.")


class DatasetPaintRequest(BaseModel):
    """Read the paint of pictures."""

    model_config = ConfigDict(extra="forbid", json_schema_extra={"examples": [{}]})

    match: str | None = Field(
        default=None,
        min_length=1,
        max_length=1000,
        description="This match alone; null: all.",
    )
