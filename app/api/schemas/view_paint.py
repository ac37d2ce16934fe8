"""Paint of a view as it travels: what its frame shows of the markings, and proposed lines."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import BaseModel, ConfigDict, Field

from app.api.schemas.annotation import LineEdits, Point
from app.api.schemas.document import Document
from app.paint.view_paint import ViewPaint
from app.paint.view_proposal import ViewProposal
from app.soccer.choices import ProposalOutcome

Spot = Annotated[list[float], Field(min_length=2, max_length=2)]
"""x and y."""
Place = Annotated[list[float], Field(min_length=3, max_length=3)]
"""x, y and the standard deviation across the marking."""
DIGITS = 3
"""Of a pixel: what lies below is far less than any sigma."""


class PaintRequest(BaseModel):
    """Lines that are not saved yet; without any those count that are."""

    model_config = ConfigDict(
        extra="forbid",
        json_schema_extra={
            "examples": [
                {},
                {"lines": {"Middle line": [{"x": 640.5, "y": 120.0}, {"x": 655.0, "y": 700.0}]}},
            ]
        },
    )

    lines: LineEdits = Field(default_factory=dict)


class PaintDocument(Document):
    """What the frame of a view shows of the painted lines, pixels of the annotated size."""

    outcome: Literal["snapped", "kept", "nothing"] = Field(
        description="`snapped`: the paint places the camera; `kept`: it does not, `reason` says "
        "why; `nothing`: nothing could be read."
    )
    reason: Literal["no_paint", "paint_disagrees"] | None
    sentence: str = Field(description="The reason for people; empty where it is snapped.")
    points: dict[str, list[Place]] = Field(
        description="By marking, in their order along it: x, y and the standard deviation across."
    )
    line_like: list[Spot] = Field(
        description="Places of everything in the frame that looks like painted lines."
    )
    supported: float | None = Field(description="Share of the visible markings that has paint.")
    explained: float | None = Field(description="Share of line-like paint that has a marking.")
    error_px: float | None = Field(description="Median distance of the paint to its marking.")
    moved_px: float | None = Field(
        description="How far the markings moved onto the paint, or would have, in the median."
    )

    @classmethod
    def of(cls, found: ViewPaint) -> PaintDocument:
        """The document of what was read."""
        points = {
            name: [[round(value, DIGITS) for value in place] for place in places]
            for name, places in found.evidence.points.items()
        }
        line_like = [[round(x, 1), round(y, 1)] for x, y in found.line_like]
        own = {**vars(found), "points": points, "line_like": line_like}
        del own["evidence"]
        return cls.model_validate(own)


class ProposalDocument(Document):
    """Lines for a view without a camera, as its frame shows them; a prediction until saved."""

    outcome: ProposalOutcome
    sentence: str = Field(
        description="Why nothing is proposed, or which drawn lines lie elsewhere; else empty."
    )
    lines: dict[str, list[Point]] = Field(
        description="Points on the paint, pixels of the annotated size; none unless proposed, and "
        "none of markings that are drawn."
    )
    supported: float | None = Field(description="Share of the visible markings that has paint.")
    explained: float | None = Field(description="Share of line-like paint that has a marking.")
    runner_up: float | None = Field(
        description="How much less the next best camera agrees; null where there is no other."
    )
    error_px: float | None = Field(description="Median distance of the paint to its marking.")
    points: int = Field(description="How many places of paint the best camera lies on.")

    @classmethod
    def of(cls, found: ViewProposal) -> ProposalDocument:
        """The document of a proposal."""
        lines = {
            name: [Point(x=point.x, y=point.y) for point in points]
            for name, points in found.lines.items()
        }
        return cls.model_validate({**vars(found), "lines": lines})
