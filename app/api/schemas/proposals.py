"""Proposals for the views of a dataset, and what is asked about them."""

from __future__ import annotations

from pydantic import BaseModel, ConfigDict, Field, StrictBool

from app.api.schemas.annotation import LineDocuments, lines_document
from app.api.schemas.document import Document, ListDocument
from app.review.editing.proposals import Proposal
from app.soccer.choices import ProposalOutcome


class MatchProposalsDocument(Document):
    """How far the views of one match are."""

    match: str
    views: int = Field(
        description="Views with a picture and without a camera, given or of their lines; a static "
        "camera counts once."
    )
    looked: int = Field(description="How many of them were looked at.")
    proposed: int = Field(description="For how many of those lines are proposed.")
    unsure: int = Field(description="For how many a camera was found that may be another's.")
    nothing: int = Field(description="For how many there was none, or no picture.")
    accepted: int = Field(description="Views that have lines as they were proposed by now.")


class DatasetProposalsDocument(ListDocument[MatchProposalsDocument]):
    """What was proposed for the views of a dataset, by name of the match."""


class DatasetProposalsRequest(BaseModel):
    """Look for cameras to propose."""

    model_config = ConfigDict(extra="forbid", json_schema_extra={"examples": [{}]})

    match: str | None = Field(
        default=None, min_length=1, max_length=1000, description="This match alone; null: all."
    )
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


class GroupProposal(BaseModel):
    """What was proposed for one view: a prediction until its lines are saved."""

    view: int
    key: str
    open: bool = Field(
        description="Whether the view still has no given camera, and no lines or those beside "
        "which this was proposed because they determined no camera."
    )
    outcome: ProposalOutcome
    sentence: str = Field(
        description="Why nothing is proposed, or which drawn lines lie elsewhere; else empty."
    )
    lines: LineDocuments = Field(
        description="Points on the paint of markings that nobody drew, pixels of the annotated "
        "size; none unless proposed."
    )
    supported: float | None = Field(description="Share of the visible markings that has paint.")
    explained: float | None = Field(description="Share of line-like paint that has a marking.")
    points: int = Field(description="How many places of paint the best camera lies on.")
    error_px: float | None = Field(description="Median distance of the paint to its marking.")
    runner_up: float | None = Field(
        description="How much less the next best camera agrees; null where there is no other."
    )
    frame: str = Field(description="Digest of the picture's bytes; empty where there were none.")
    version: str = Field(description="Of what read the picture.")

    @staticmethod
    def of(key: str, is_open: bool, found: Proposal) -> GroupProposal:
        """The document of a proposal."""
        names = GroupProposal.model_fields.keys() - {"view", "key", "open", "lines"}
        return GroupProposal.model_construct(
            view=found.view_id,
            key=key,
            open=is_open,
            lines=lines_document(found.lines),
            **{name: getattr(found, name) for name in names},
        )


class GroupProposals(ListDocument[GroupProposal]):
    """What was proposed for the views of a group, in their order."""
