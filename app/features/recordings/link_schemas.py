"""Documents of links between replays and live shots."""

from __future__ import annotations

from datetime import datetime
from typing import Annotated

from pydantic import BaseModel, ConfigDict, Field

from app.features.recordings.link_frames import LinkedFrames, LiveSuggestion
from app.features.recordings.links import (
    MAX_INSTANTS,
    Instant,
    LinkedShot,
    LinkMap,
    LinkPiece,
)
from app.features.recordings.schemas import Frame
from app.finite import MAX_ID
from app.http.documents import Document, ListDocument
from app.soccer.choices import LinkOutcome, LinkSource


class LinkedLive(BaseModel):
    """A live shot of the recording."""

    model_config = ConfigDict(extra="forbid")

    first: Frame = Field(description="Number of its first frame.")
    last: Frame = Field(description="Number of its last frame.")


class LinkedReplay(LinkedLive):
    """A shot that shows it again, of the same recording or of another one of the dataset."""

    recording: Annotated[int, Field(ge=1, le=MAX_ID)] = Field(
        description="Id of the recording of the replay."
    )


class NewLink(BaseModel):
    """A replay and the live shot that it shows again."""

    model_config = ConfigDict(
        extra="forbid",
        json_schema_extra={
            "examples": [
                {
                    "live": {"first": 0, "last": 249},
                    "replay": {"recording": 1, "first": 300, "last": 700},
                }
            ]
        },
    )

    live: LinkedLive = Field(description="The live shot.")
    replay: LinkedReplay = Field(description="The replay.")


class InstantEdit(BaseModel):
    """One instant in both shots."""

    model_config = ConfigDict(extra="forbid")

    live: Frame = Field(description="Frame of the live shot that shows it.")
    replay: Frame = Field(description="Frame of the replay that shows it.")


class InstantsEdit(BaseModel):
    """All instants of a link."""

    model_config = ConfigDict(
        extra="forbid",
        json_schema_extra={
            "examples": [{"instants": [{"live": 20, "replay": 340}, {"live": 60, "replay": 500}]}]
        },
    )

    instants: Annotated[list[InstantEdit], Field(max_length=MAX_INSTANTS)] = Field(
        description="Pairs of frames that show the same instant."
    )
    assumed_speed: Annotated[float, Field(ge=0.02, le=4)] | None = Field(
        default=None,
        description="Speed of the replay while one instant is linked; null: that of the live shot.",
    )

    def pairs(self) -> list[tuple[int, int]]:
        """The frames of each."""
        return [(one.live, one.replay) for one in self.instants]


class LinkedShotDocument(Document, shows=LinkedShot):
    """One side of a link."""

    recording: int = Field(description="Id of its recording.")
    name: str = Field(description="Name of its recording.")
    first: int = Field(description="Number of its first frame.")
    last: int = Field(description="Number of its last frame.")


class InstantDocument(Document, shows=Instant):
    """One instant of the match in both shots."""

    live: int = Field(description="Frame of the live shot that shows it.")
    replay: int = Field(description="Frame of the replay that shows it.")
    residual: float | None = Field(
        description="Live frames by which the map puts the frame of the replay later than the "
        "person; null without a map."
    )


class LinkPieceDocument(Document, shows=LinkPiece):
    """A part of a replay that runs at one speed."""

    first: int = Field(description="Frame of the replay in which it begins.")
    last: int = Field(description="Frame of the replay in which it ends.")
    first_s: float = Field(description="Its begin, seconds after the first frame of the replay.")
    last_s: float = Field(description="Its end, seconds after the first frame of the replay.")
    offset_s: float = Field(description="`offset_s` of its map.")
    speed: float = Field(description="Its speed; 0.25 is four times slow.")
    speed_sigma: float = Field(description="Standard deviation of the speed.")


class LinkMapDocument(Document, shows=LinkMap):
    """Which time of the live shot each time of a replay shows: `live = offset_s + speed * replay`.

    Both are seconds after the first frame of their shot.
    """

    outcome: LinkOutcome = Field(
        description="`none`: no instant is linked; `offset`: the speed is assumed; `linked`: known, "
        "in one or in `pieces`; `unobservable`: it cannot be told."
    )
    found_by: LinkSource | None = Field(description="What it was found from.")
    reason: str | None = Field(description="Why one offset and speed do not say it.")
    offset_s: float | None = Field(description="Live time of the first frame of the replay.")
    speed: float | None = Field(description="Of the replay; 0.25 is four times slow.")
    offset_sigma_s: float | None = Field(description="Standard deviation of `offset_s`.")
    speed_sigma: float | None = Field(description="Standard deviation of the speed.")
    sigma_s: float | None = Field(
        description="Standard deviation of the live time of the middle of the replay, seconds."
    )
    miss_m: float | None = Field(
        description="Median distance of the ball's rays, metres; null where instants say it."
    )
    pieces: list[LinkPieceDocument] = Field(
        description="Where the speed changes: the parts with one speed each."
    )


class LinkDocument(Document):
    """A replay and the live shot that it shows again."""

    id: int
    live: LinkedShotDocument = Field(description="The live shot.")
    replay: LinkedShotDocument = Field(description="The replay.")
    instants: list[InstantDocument] = Field(description="What people linked.")
    assumed_speed: float | None = Field(
        description="Speed of the replay while one instant is linked; null: that of the live shot."
    )
    map: LinkMapDocument = Field(description="What follows from the instants.")
    created: datetime
    by: str = Field(validation_alias="actor")
    etag: str


class LinkList(ListDocument[LinkDocument]):
    """Links of a recording, by the frames of their live shots."""


class LinkedFramesDocument(Document, shows=LinkedFrames):
    """Which frame of the replay shows the same as each live frame."""

    first: int = Field(description="Number of the first live frame.")
    replay: list[int | None] = Field(
        description="For each live frame the nearest frame of the replay; null outside of it. One "
        "that is neither repeated nor blended comes first where there is one within half a frame."
    )
    off_s: list[float | None] = Field(
        description="Live seconds by which that frame is later, for each live frame."
    )
    repeated: list[int] = Field(
        description="Frames of the replay that show the frame before once more."
    )
    blended: list[int] = Field(
        description="Frames of the replay that show a mix of the frames beside them."
    )


class LiveSuggestionDocument(Document, shows=LiveSuggestion):
    """A live shot that a replay may show."""

    recording: int = Field(description="Id of its recording.")
    name: str = Field(description="Name of its recording.")
    first: int = Field(description="Number of its first frame.")
    last: int = Field(description="Number of its last frame.")
    why: str = Field(description="What speaks for it, and what against it.")
    link: int | None = Field(description="Id of the link of the two where there is one.")


class LiveSuggestions(ListDocument[LiveSuggestionDocument]):
    """Live shots that a replay may show, the likeliest first."""
