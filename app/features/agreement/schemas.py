"""Agreement: how far annotations of the same frames lie apart."""

from __future__ import annotations

from datetime import datetime
from typing import Literal

from pydantic import BaseModel, ConfigDict, Field

from app.evaluation.agreement_limits import AgreementLimits, Disagreement, Spread
from app.evaluation.annotation_distance import (
    Ball3DDistance,
    ViewDistance,
)
from app.evaluation.rater_agreement import Coefficient
from app.features.agreement.adjudicate import Case, OpenCase
from app.features.agreement.compare import AnnotationPair, Comparison
from app.features.agreement.summary import GroupAgreement, PeopleAgreement
from app.features.groups.schemas import GroupDocument
from app.finite import MAX_ID
from app.http.documents import Document, ListDocument
from app.soccer.choices import VerdictState


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

    views: list[ViewDistance]
    ball: Ball3DDistanceDocument


class AnnotationPairDocument(Document, shows=AnnotationPair):
    """Two of the annotations, by their places in `groups`, from 0."""

    distance: GroupDistanceDocument
    disagreements: list[Disagreement] = Field(description="The worst first.")


class GroupComparisonDocument(Document):
    """Annotations of the same frames beside each other."""

    groups: list[GroupDocument]
    pairs: list[AnnotationPairDocument] = Field(description="Those that disagree most first.")
    limits: AgreementLimits
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


class SpreadsDocument(Document):
    """Distances of lines, balls, diameters (px), 3D balls (m), JaC, cameras (m)."""

    line_px: Spread
    ball_px: Spread
    diameter_px: Spread
    ball_m: Spread
    jac: Spread
    position_m: Spread


class PeopleAgreementDocument(Document, shows=PeopleAgreement):
    """How far two people agree, or all of them."""

    kappa: Coefficient | None = Field(
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
    limits: AgreementLimits
    alpha: Coefficient
    overall: PeopleAgreementDocument
    pairs: list[PeopleAgreementDocument]
    groups: list[GroupAgreementDocument] = Field(description="The worst first.")


class WaitingList(ListDocument[OpenCase]):
    """Groups that wait for a decision, those that disagree most first."""


class CaseAnnotation(Document):
    """Somebody's own annotation of a group; its place is that in `comparison.groups`."""

    id: int
    person: str
    verdict: str | None
    submitted: datetime | None


class CaseDocument(Document):
    """A group that waits for a decision, and what it is to be decided between."""

    group: GroupDocument
    batch: int | None
    annotations: list[CaseAnnotation]
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
        extra="forbid",
        json_schema_extra={"examples": [{"annotation": 7}, {"annotation": 7, "as_start": True}]},
    )

    annotation: int = Field(ge=1, le=MAX_ID)
    as_start: bool = Field(
        default=False,
        description="It is where a third one begins: it is edited and judged in the group itself.",
    )
