"""Documents of paint and proposals."""

from __future__ import annotations

from typing import Annotated, Any, Literal

from pydantic import BaseModel, ConfigDict, Field, StrictBool

from app.features.groups.schemas import LineDocuments, LineEdits, lines_document
from app.features.match_estimates.schemas import MatchRequest
from app.features.paint.proposal_queries import MatchProposals, Proposal
from app.features.paint.service import PaintState
from app.http.documents import Document, ListDocument
from app.paint.view_paint import ViewPaint
from app.paint.view_proposal import ViewProposal
from app.soccer.choices import ProposalOutcome


class DatasetPaintDocument(ListDocument[PaintState]):
    """What was read of the paint in a dataset's pictures, by name of the match."""

    used: bool = Field(description="Whether the policy uses it: `calibration.source`.")


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
        description="Why no lines are proposed, or which drawn lines contradict the proposal; else empty."
    )
    lines: LineDocuments = Field(
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
        return cls.model_validate({**vars(found), "lines": lines_document(found.lines)})


class DatasetProposalsDocument(ListDocument[MatchProposals]):
    """What was proposed for the views of a dataset, by name of the match."""


class DatasetProposalsRequest(MatchRequest):
    """Look for cameras to propose."""

    dry_run: StrictBool = Field(default=False, description="Count, and look at nothing.")


class ProposalPlanDocument(Document):
    """What a search would do."""

    views: int = Field(description="Views whose pictures would be compared or looked at.")
    looked: int = Field(
        description="How many were looked at before: most of them are only compared."
    )


class ForgottenProposalsDocument(Document):
    """What was taken back."""

    forgotten: int = Field(description="How many proposals there were; accepted lines stay.")


class GroupProposal(ProposalDocument):
    """What was proposed for one view: a prediction until its lines are saved."""

    view: int
    key: str
    open: bool = Field(
        description="Whether the view still has no given camera, and no lines or those beside "
        "which this was proposed because they determined no camera."
    )
    frame: str = Field(description="Digest of the picture's bytes; empty where there were none.")
    version: str = Field(description="Of what read the picture.")

    @classmethod
    def of_view(cls, key: str, is_open: bool, found: Proposal) -> GroupProposal:
        """The document of what was proposed for a view."""
        shown = cls.model_fields.keys() - {"view", "key", "open"}
        values: dict[str, Any] = {name: getattr(found, name) for name in shown}
        values |= {"view": found.view_id, "key": key, "open": is_open}
        return cls.model_construct(**{**values, "lines": lines_document(found.lines)})


class GroupProposals(ListDocument[GroupProposal]):
    """What was proposed for the views of a group, in their order."""
