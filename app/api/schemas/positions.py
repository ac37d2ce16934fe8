"""Where the matches of a dataset put their main cameras, and what is asked about it."""

from __future__ import annotations

from pydantic import BaseModel, ConfigDict, Field

from app.api.schemas.document import Document, ListDocument


class MatchPositionDocument(Document):
    """The shared position of one match."""

    match: str
    groups: int
    views: int = Field(description="Pictures of the main camera that have lines.")
    shared: int = Field(description="How many of them have what the others say of its position.")
    mean: tuple[float, float, float] | None = Field(
        description="Where it stands on average, pitch frame, metres; null where none does."
    )
    sigma_m: float | None = Field(
        description="How far off it may be for one picture, each axis, the median of pictures."
    )
    current: bool | None = Field(
        description="Whether it would be estimated from the same now; null: nothing is shared."
    )
    sentence: str = Field(description="All that in words.")


class SharedPositionsDocument(ListDocument[MatchPositionDocument]):
    """The shared positions of a dataset's matches, by name of the match."""

    used: bool = Field(description="Whether the policy uses them: `calibration.share_position`.")


class PositionsRequest(BaseModel):
    """Share the position of main cameras with the pictures of their match."""

    model_config = ConfigDict(extra="forbid", json_schema_extra={"examples": [{}]})

    match: str | None = Field(
        default=None,
        min_length=1,
        max_length=1000,
        description="This match alone; null: all where what it was estimated from has changed.",
    )
