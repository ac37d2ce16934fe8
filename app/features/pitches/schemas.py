"""Documents of pitches, and of the pitch model."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import AliasPath, BaseModel, ConfigDict, Field

from app.features.groups.schemas import PitchSize
from app.http.documents import Document, ListDocument
from app.soccer.pitch import LENGTH_RANGE, WIDTH_RANGE, Arc, Pitch, Segment, opposite_marking
from app.solving.pitch_size import PitchEstimate

XYZ = tuple[float, float, float]


class MarkingShape(BaseModel):
    """A marking: a segment between two points, or an arc on the grass."""

    marking: str
    twin: str = Field(
        description="The marking that takes its place when the pitch is turned by 180 degrees."
    )
    kind: Literal["segment", "arc"]
    start: XYZ | None = Field(default=None, description="Ends of a segment, metres.")
    end: XYZ | None = None
    center: tuple[float, float] | None = Field(default=None, description="Of an arc, metres.")
    radius: float | None = None
    first: float | None = Field(default=None, description="Angle in radians, from +x to +y.")
    last: float | None = None

    @staticmethod
    def of(marking: str, shape: Segment | Arc) -> MarkingShape:
        """The document of a shape."""
        kind: Literal["segment", "arc"] = "arc" if isinstance(shape, Arc) else "segment"
        return MarkingShape(
            marking=marking, twin=opposite_marking(marking), kind=kind, **vars(shape)
        )


class PitchDocument(BaseModel):
    """Pitch frame: metres, origin at the centre mark, x to the right goal, z down."""

    length: float
    width: float
    markings: list[MarkingShape]

    @staticmethod
    def of(pitch: Pitch) -> PitchDocument:
        """The document of a pitch."""
        return PitchDocument(
            length=pitch.length,
            width=pitch.width,
            markings=[MarkingShape.of(name, pitch.shapes[name]) for name in sorted(pitch.shapes)],
        )


class MatchPitchDocument(Document):
    """The pitch of one match."""

    match: str = Field(description="Empty: of the groups that have none, if they are of one pitch.")
    group: str = Field(description="Key of the first of its groups.")
    group_id: int
    groups: int
    length: float = Field(validation_alias=AliasPath("pitch", "length"), description="In use, m.")
    width: float = Field(validation_alias=AliasPath("pitch", "width"), description="In use, m.")
    mixed: bool = Field(description="Its groups were brought with several sizes.")
    estimate: PitchEstimate | None = Field(description="Null while it is not computed.")
    problem: str | None = Field(description="Why it cannot be estimated.")
    proposed: PitchSize | None = Field(
        description="The size to use instead: it differs beyond its uncertainty."
    )
    previous: PitchSize | None = Field(description="The size before it was changed last.")


class PitchesDocument(ListDocument[MatchPitchDocument]):
    """The pitches of a dataset's matches, by name of the match."""

    etag: str = Field(description="What a change of them builds on.")


class PitchChange(BaseModel):
    """Give a match another pitch: all its groups at once."""

    model_config = ConfigDict(
        extra="forbid",
        json_schema_extra={"examples": [{"match": "a/b/c", "length": 103.0, "width": 66.0}]},
    )

    match: str = Field(max_length=1000, description="Empty: all groups that have none.")
    length: Annotated[float, Field(ge=LENGTH_RANGE[0], le=LENGTH_RANGE[1])]
    width: Annotated[float, Field(ge=WIDTH_RANGE[0], le=WIDTH_RANGE[1])]
