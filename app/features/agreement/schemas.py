"""Agreement: how far annotations of the same frames lie apart."""

from __future__ import annotations

from datetime import datetime
from typing import Literal

from pydantic import BaseModel, ConfigDict, Field

from app.evaluation.agreement_limits import Disagreement, Spread
from app.evaluation.annotation_distance import Ball3DDistance, LineDistance, ViewDistance
from app.features.agreement.adjudicate import Case, OpenCase
from app.features.agreement.compare import AnnotationPair, Comparison
from app.features.agreement.summary import GroupAgreement, PeopleAgreement
from app.features.groups.schemas import GroupDocument
from app.finite import MAX_ID
from app.http.documents import Document, ListDocument
from app.soccer.choices import VerdictState

Side = Literal["a", "b"]
BallState = Literal["seen", "occluded", "out_of_view", "none", "several"]


class LimitsDocument(Document):
    """The most that two annotations may differ by and still agree."""

    line_px: float = Field(description="Any point of a line from the line of the other, pixels.")
    markings: int = Field(description="Markings of a view that one alone drew.")
    ball_px: float = Field(description="Centres of the ball, pixels.")
    diameter_px: float = Field(description="Its diameters, pixels.")
    ball_m: float = Field(description="3D balls, metres.")
    jac: float = Field(description="The least JaC of one's camera with the other's lines.")


class LineDistanceDocument(Document, shows=LineDistance):
    """One marking as both drew it."""

    only: Side | None = Field(description="Who alone drew it; null: both did.")
    mean_px: float | None = Field(
        description="Mean distance of each one's points from the other's line."
    )


class BallDistanceDocument(Document):
    """The ball of a view as both saw it."""

    a: BallState
    b: BallState
    center_px: float | None
    diameter_px: float | None = Field(description="Of b less that of a.")


class ViewDistanceDocument(Document, shows=ViewDistance):
    """One view."""

    lines: list[LineDistanceDocument]
    ball: BallDistanceDocument
    jac: tuple[float | None, float | None] = Field(
        description="Of a's camera with b's lines, and of b's with a's, at 0.5 % of the diagonal."
    )
    position_m: float | None = Field(description="Between both cameras.")


class Ball3DDistanceDocument(Document, shows=Ball3DDistance):
    """Both 3D balls."""

    p_value: float | None = Field(
        description="How often chance alone would put them as far apart, were both sigmas true."
    )
    explained: bool | None = Field(
        validation_alias="is_explained",
        description="Whether both uncertainties explain the difference; null: not known.",
    )


class GroupDistanceDocument(Document):
    """How far two annotations lie apart."""

    views: list[ViewDistanceDocument]
    ball: Ball3DDistanceDocument


class DisagreementDocument(Document, shows=Disagreement):
    """Something that two annotations say differently."""

    sentence: str = Field(description="For people; a and b stand for the two.")


class AnnotationPairDocument(Document, shows=AnnotationPair):
    """Two of the annotations, by their places in `groups`, from 0."""

    distance: GroupDistanceDocument
    disagreements: list[DisagreementDocument] = Field(description="The worst first.")


class GroupComparisonDocument(Document):
    """Annotations of the same frames beside each other."""

    groups: list[GroupDocument]
    pairs: list[AnnotationPairDocument] = Field(description="Those that disagree most first.")
    limits: LimitsDocument
    worst_views: list[str] = Field(description="Keys of the views, the worst first.")

    @staticmethod
    def of(found: Comparison) -> GroupComparisonDocument:
        """The document of a comparison."""
        groups = [GroupDocument.of(state) for state in found.states]
        return GroupComparisonDocument.model_validate({**vars(found), "groups": groups})


class LimitsEdit(BaseModel):
    """Other limits."""

    model_config = ConfigDict(
        extra="forbid",
        json_schema_extra={
            "examples": [
                {
                    "line_px": 5.0,
                    "markings": 1,
                    "ball_px": 3.0,
                    "diameter_px": 5.0,
                    "ball_m": 0.5,
                    "jac": 0.7,
                }
            ]
        },
    )

    line_px: float = Field(gt=0, le=10_000, allow_inf_nan=False)
    markings: int = Field(ge=0, le=100)
    ball_px: float = Field(gt=0, le=10_000, allow_inf_nan=False)
    diameter_px: float = Field(gt=0, le=10_000, allow_inf_nan=False)
    ball_m: float = Field(gt=0, le=1000, allow_inf_nan=False)
    jac: float = Field(ge=0, le=1, allow_inf_nan=False)


class CoefficientDocument(Document):
    """A coefficient of agreement: 1 is complete, 0 what chance gives."""

    name: Literal["cohen", "fleiss", "krippendorff"]
    value: float | None = Field(description="Null where too few people annotated to disagree.")
    low: float | None = Field(description="Lower end of the 95 % interval.")
    high: float | None
    observed: float | None = Field(description="Share of pairs of verdicts that agree.")
    items: int = Field(description="Groups that it is computed from.")


class SpreadDocument(Document, shows=Spread):
    """The middle and the bad end of a measure."""

    tail: float | None = Field(description="95th percentile; of JaC the 5th.")


class SpreadsDocument(Document):
    """Distances of lines, balls, diameters (px), 3D balls (m), JaC, cameras (m)."""

    line_px: SpreadDocument
    ball_px: SpreadDocument
    diameter_px: SpreadDocument
    ball_m: SpreadDocument
    jac: SpreadDocument
    position_m: SpreadDocument


class PeopleAgreementDocument(Document, shows=PeopleAgreement):
    """How far two people agree, or all of them."""

    kappa: CoefficientDocument | None = Field(
        description="Cohen's of two; Fleiss' of all, where each group has equally many verdicts."
    )
    spreads: SpreadsDocument


class GroupAgreementDocument(Document, shows=GroupAgreement):
    """What one group came to."""

    state: Literal["agreed", "open", "decided"]
    status: VerdictState = Field(
        description="The verdict on the group itself: annotations that agree without one leave it unreviewed."
    )
    worst: float = Field(description="How many times its limit the worst disagreement was.")
    spreads: SpreadsDocument
    outcome: Literal["take", "start"] | None
    taken: str | None = Field(description="Whose annotation was taken over.")
    decided: datetime | None


class AgreementDocument(Document):
    """How far the people of a dataset agree."""

    agreed: int = Field(
        description="Groups whose annotations agree; the first annotation was adopted."
    )
    open: int = Field(description="Groups that wait for a decision.")
    decided: int
    limits: LimitsDocument
    alpha: CoefficientDocument
    overall: PeopleAgreementDocument
    pairs: list[PeopleAgreementDocument]
    groups: list[GroupAgreementDocument] = Field(description="The worst first.")


class WaitingDocument(Document, shows=OpenCase):
    """A group that waits for a decision."""

    since: datetime


class WaitingList(ListDocument[WaitingDocument]):
    """Groups that wait for a decision, those that disagree most first."""


class CaseTake(Document):
    """Somebody's own annotation of a group; its place is that in `comparison.groups`."""

    id: int
    person: str
    verdict: str | None
    handed_in: datetime | None


class CaseDocument(Document):
    """A group that waits for a decision, and what it is to be decided between."""

    group: GroupDocument
    batch: int | None
    takes: list[CaseTake]
    comparison: GroupComparisonDocument
    refused: str | None = Field(
        description="Why the logged-in person may not decide; null: they may."
    )
    own: bool = Field(
        description="They annotated the group themselves, and no other reviewer exists."
    )

    @staticmethod
    def of(case: Case) -> CaseDocument:
        """The document of a case."""
        return CaseDocument.model_validate(
            {
                **vars(case),
                "group": GroupDocument.of(case.original),
                "comparison": GroupComparisonDocument.of(case.comparison),
            }
        )


class Decision(BaseModel):
    """Which annotation is taken over."""

    model_config = ConfigDict(
        extra="forbid", json_schema_extra={"examples": [{"take": 7}, {"take": 7, "as_start": True}]}
    )

    take: int = Field(ge=1, le=MAX_ID)
    as_start: bool = Field(
        default=False,
        description="It is where a third one begins: it is edited and judged in the group itself.",
    )
