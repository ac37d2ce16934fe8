"""The pitch as the browser draws it: names and shapes of the 26 markings."""

from __future__ import annotations

from typing import Literal

from pydantic import BaseModel, Field

from app.soccer.pitch import Arc, Pitch, Segment, twin_marking

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
        return MarkingShape(marking=marking, twin=twin_marking(marking), kind=kind, **vars(shape))


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
