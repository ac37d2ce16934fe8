"""Documents of recordings, their shots, and what becomes groups."""

from __future__ import annotations

from datetime import datetime
from typing import Annotated

from pydantic import Field, StrictBool

from app.features.imports.schemas import UploadOrFolder
from app.features.recordings.instants import MOST_AT_ONCE
from app.features.recordings.match_clock import MAX_CLOCKS, Half, MatchClockReading
from app.features.recordings.shots import MAX_SHOTS, RecordingShots, Shot
from app.http.documents import Document, ListDocument, RequestBody
from app.json_text import MAX_ID
from app.soccer.choices import ShotKind, ShotStart

Frame = Annotated[int, Field(ge=0, le=MAX_ID)]


class NewRecording(
    RequestBody, examples=[{"dataset": "cup", "source": {"folder": "films/final.mp4"}}]
):
    """A file that becomes a recording of a dataset."""

    dataset: Annotated[str, Field(min_length=1, max_length=200)] = Field(
        description="Name; a dataset is made where there is none of that name."
    )
    source: UploadOrFolder


class RecordingDocument(Document):
    """A recording; its numbers are null until it is indexed."""

    id: int
    dataset: str
    name: str = Field(description="Unique in its dataset; its groups have it as their match.")
    indexed: bool = Field(description="Whether its frames are known.")
    sha256: str | None = Field(description="Of the file.")
    bytes: int | None
    frames: int | None = Field(description="How many frames there are.")
    fps: float | None = Field(description="Frames a second; the mean of a variable rate.")
    variable: bool | None = Field(description="Whether its rate varies.")
    seconds: float | None = Field(description="Length.")
    width: int | None = Field(description="Of a frame, upright with square pixels.")
    height: int | None = Field(description="Of a frame, upright with square pixels.")
    rotation: int | None = Field(description="Degrees by which the file turns its frames.")
    interlaced: bool | None = Field(description="Null: that cannot be told.")
    damaged: int | None = Field(
        description="Pictures that cannot be decoded; they are left out, and have no number."
    )
    shots: int = Field(description="How many shots it has.")
    groups: int = Field(description="How many groups were taken from it.")
    problem: str | None = Field(
        description="Why its frames cannot be read now, or could not be indexed."
    )
    clocks: list[MatchClockReading] = Field(
        description="What the clock of the match shows in frames of it, by frame."
    )
    created: datetime
    by: str = Field(validation_alias="actor")


class RecordingList(ListDocument[RecordingDocument]):
    """Recordings, the newest first."""


class ClockReadingEdit(RequestBody):
    """What the clock of the match shows in one frame."""

    frame: Frame = Field(description="Number of the frame.")
    half: Half = Field(description="1 or 2; 3 and 4 are those of extra time.")
    seconds: Annotated[float, Field(ge=0, le=10_800)] = Field(
        description="What the clock shows, seconds; the second half begins at 2,700."
    )


class RecordingChange(
    RequestBody, examples=[{"clocks": [{"frame": 1200, "half": 1, "seconds": 760}]}]
):
    """What is changed of a recording."""

    clocks: Annotated[list[ClockReadingEdit], Field(max_length=MAX_CLOCKS)] = Field(
        description="All readings of the clock of the match."
    )

    def to_clock_readings(self) -> list[MatchClockReading]:
        """The readings."""
        return [MatchClockReading(**clock.model_dump()) for clock in self.clocks]


class ShotEdit(RequestBody):
    """A shot as it shall be."""

    first: Frame = Field(description="Number of its first frame, from 0.")
    last: Frame = Field(description="Number of its last frame.")
    kind: ShotKind = Field(description="What it shows.")
    entered_by: ShotStart = Field(default="cut", description="How it begins.")
    kept: StrictBool | None = Field(
        default=None, description="Whether somebody wants to work on it; null: nobody said."
    )


class ShotsEdit(
    RequestBody, examples=[{"shots": [{"first": 0, "last": 249, "kind": "main", "kept": True}]}]
):
    """All shots of a recording, in their order."""

    shots: Annotated[list[ShotEdit], Field(max_length=MAX_SHOTS)] = Field(description="The shots.")

    def to_shots(self) -> list[Shot]:
        """The shots."""
        return [Shot(**shot.model_dump()) for shot in self.shots]


class ShotDocument(Document, shows=Shot):
    """A shot; frames of a soft transition belong to neither of two."""

    first: int = Field(description="Number of its first frame, from 0.")
    last: int = Field(description="Number of its last frame.")
    kind: ShotKind = Field(description="What it shows.")
    entered_by: ShotStart = Field(description="How it begins.")
    kept: bool | None = Field(description="Whether somebody wants to work on it.")
    start_s: float = Field(description="When its first frame is shown, seconds.")
    end_s: float = Field(description="When its last frame is over, seconds.")


class ShotList(ListDocument[ShotDocument]):
    """The shots of a recording."""

    recording: int = Field(description="Id of the recording.")
    etag: str

    @staticmethod
    def of(found: RecordingShots) -> ShotList:
        """The document of a list."""
        items = [
            ShotDocument(**vars(shot), start_s=start, end_s=end)
            for shot, (start, end) in zip(found.items, found.times, strict=True)
        ]
        return ShotList(items=items, recording=found.recording.id, etag=found.etag)


class InstantsRequest(RequestBody, examples=[{"frames": [100, 125, 150]}]):
    """Frames that become groups."""

    frames: Annotated[list[Frame], Field(min_length=1, max_length=MOST_AT_ONCE)]
    propose: StrictBool = Field(
        default=True, description="Whether a job proposes cameras for them afterwards."
    )
    linked: StrictBool = Field(
        default=False,
        description="Whether the frames of linked replays that show the same are further views of the groups.",
    )
    dry_run: StrictBool = Field(
        default=False, description="The same as the parameter: count, and keep nothing."
    )
