"""Documents of links between replays and live shots."""

from __future__ import annotations

from datetime import datetime
from typing import Annotated

from pydantic import Field

from app.features.recordings.link_suggestions import LiveShotSuggestion
from app.features.recordings.link_values import Instant, LinkedShot, LinkTimeMap
from app.features.recordings.links import MAX_INSTANTS
from app.features.recordings.schemas import Frame
from app.http.documents import Document, ListDocument, RequestBody
from app.json_text import MAX_ID


class LinkedLiveShot(RequestBody):
    """A live shot of the recording."""

    first: Frame = Field(description="Number of its first frame.")
    last: Frame = Field(description="Number of its last frame.")


class LinkedReplay(LinkedLiveShot):
    """A shot that shows it again, of the same recording or of another one of the dataset."""

    recording: Annotated[int, Field(strict=True, ge=1, le=MAX_ID)] = Field(
        description="Id of the recording of the replay."
    )


class NewShotLink(
    RequestBody,
    examples=[
        {
            "live": {"first": 0, "last": 249},
            "replay": {"recording": 1, "first": 300, "last": 700},
        }
    ],
):
    """A replay and the live shot that it shows again."""

    live: LinkedLiveShot = Field(description="The live shot.")
    replay: LinkedReplay = Field(description="The replay.")


class InstantEdit(RequestBody):
    """One instant in both shots."""

    live: Frame = Field(description="Frame of the live shot that shows it.")
    replay: Frame = Field(description="Frame of the replay that shows it.")


class InstantsEdit(
    RequestBody, examples=[{"instants": [{"live": 20, "replay": 340}, {"live": 60, "replay": 500}]}]
):
    """All instants of a link."""

    instants: Annotated[list[InstantEdit], Field(max_length=MAX_INSTANTS)] = Field(
        description="Pairs of frames that show the same instant."
    )
    assumed_speed: Annotated[float, Field(ge=0.02, le=4)] | None = Field(
        default=None,
        description="Speed of the replay while one instant is linked; null: that of the live shot.",
    )

    def to_frame_pairs(self) -> list[tuple[int, int]]:
        """The frames of each."""
        return [(one.live, one.replay) for one in self.instants]


class LinkByBallRequest(RequestBody, examples=[{}]):
    """Where the ball is seen in the two shots."""

    live_upload: Annotated[str, Field(max_length=64)] | None = Field(
        default=None,
        description="Id of an upload: `ball.csv` (`frame,time_s,x,y`, pixels) of the live recording; null: the balls of "
        "the groups that were taken from the shots.",
    )
    replay_upload: Annotated[str, Field(max_length=64)] | None = Field(
        default=None, description="The same of the recording of the replay."
    )


class LinkDocument(Document):
    """A replay and the live shot that it shows again."""

    id: int
    live: LinkedShot = Field(description="The live shot.")
    replay: LinkedShot = Field(description="The replay.")
    instants: list[Instant] = Field(description="What people linked, by the frames of the replay.")
    assumed_speed: float | None = Field(
        description="Speed of the replay while one instant is linked; null: that of the live shot."
    )
    map: LinkTimeMap = Field(
        description="What follows from the instants, or was found from the ball."
    )
    created: datetime
    by: str = Field(validation_alias="actor")
    etag: str


class LinkList(ListDocument[LinkDocument]):
    """Links of a recording, by the frames of their live shots."""


class LiveShotSuggestions(ListDocument[LiveShotSuggestion]):
    """Live shots that a replay may show, the likeliest first."""
