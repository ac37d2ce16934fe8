"""Own annotations of groups, gold groups and guidelines, as they travel."""

from __future__ import annotations

from datetime import datetime
from typing import Annotated, Literal

from pydantic import BaseModel, ConfigDict, Field

from app.features.guidelines.service import MAX_LETTERS
from app.features.independent_annotations.adopt import MAX_REASON
from app.features.independent_annotations.errors import DistanceFromTruth
from app.features.independent_annotations.gold import (
    GoldGroup,
    GoldResult,
    MedianInterval,
    PersonResults,
)
from app.features.independent_annotations.known_truth import MOST
from app.features.independent_annotations.service import DisclosedAnnotation
from app.features.queue.query import MAX_LISTED_LENGTH
from app.finite import MAX_ID
from app.http.documents import Document, ListDocument
from app.soccer.choices import GoldStart


class ReturnReason(BaseModel):
    """Why something that was submitted goes back."""

    model_config = ConfigDict(
        extra="forbid",
        json_schema_extra={"examples": [{"reason": "The far goal line is missing in view B."}]},
    )

    reason: Annotated[str, Field(max_length=MAX_REASON)] = Field(
        default="", description="A sentence for the person who gets the group back."
    )


class AnnotationReturn(ReturnReason):
    """Which annotation of a group goes back, and why."""

    model_config = ConfigDict(
        extra="forbid",
        json_schema_extra={"examples": [{"annotation": 7, "reason": "The ball in B is the spot."}]},
    )

    annotation: Annotated[int, Field(ge=1, le=MAX_ID)]


class IndependentAnnotationList(ListDocument[DisclosedAnnotation]):
    """Own annotations, oldest first: for a lead everybody's, else those of whoever asks."""


class GoldEdit(BaseModel):
    """What annotators of a gold group begin with.

    `imported`: as its dataset brought it; `without_balls`: what it holds but for the balls;
    `bare`: its pictures alone.
    """

    model_config = ConfigDict(
        extra="forbid", json_schema_extra={"examples": [{"start": "without_balls"}]}
    )

    start: GoldStart = "imported"


class GoldChoiceDocument(BaseModel):
    """Groups that become gold by what is known of them.

    `sample`: by the cameras and the ball with which a generated sample was drawn; `version`: by what
    a frozen version holds, upon which people agreed or somebody decided.
    """

    model_config = ConfigDict(
        extra="forbid",
        json_schema_extra={
            "examples": [
                {"source": "sample", "start": "bare"},
                {"source": "version", "version": "v1"},
            ]
        },
    )

    source: Literal["sample", "version"]
    version: Annotated[str, Field(min_length=1, max_length=100)] | None = Field(
        default=None, description="Name or id of the version."
    )
    q: Annotated[str, Field(max_length=MAX_LISTED_LENGTH)] = Field(
        default="", description="Which groups; default: all."
    )
    size: Annotated[int, Field(ge=1, le=MOST)] = Field(
        default=MOST, description="So many of them at most, the first ones."
    )
    start: GoldStart = "imported"


class GoldResultDocument(Document, shows=GoldResult):
    """What one person made of a gold group."""

    submitted: datetime = Field(description="When they submitted it first.")
    true_verdict: str = Field(title="Known Verdict")
    right: bool | None = Field(description="Whether they judged as is true; null: not judged.")
    error: DistanceFromTruth
    submissions: int = Field(
        description="How often they submitted it. The first one is measured; there are more where a "
        "lead returned it."
    )


class PersonResultsDocument(Document, shows=PersonResults):
    """What somebody made of gold groups, oldest first."""

    results: list[GoldResultDocument]
    line_px: MedianInterval
    ball_px: MedianInterval
    ball_m: MedianInterval
    right_low: float | None = Field(description="Wilson's interval of the share, 95 %.")


class GoldReportDocument(Document):
    """The gold groups of a dataset, and how far each person is from what is true of them."""

    groups: list[GoldGroup]
    people: list[PersonResultsDocument]


class GuidelinesEdit(BaseModel):
    """Another version of the guidelines."""

    model_config = ConfigDict(
        extra="forbid",
        json_schema_extra={"examples": [{"text": "## Balls\n\nDraw tight boxes.", "based_on": 0}]},
    )

    text: Annotated[str, Field(max_length=MAX_LETTERS)]
    based_on: Annotated[int, Field(ge=0, le=2**31, description="The version that was changed.")]


class NewGuidelinePicture(BaseModel):
    """A picture that was uploaded."""

    model_config = ConfigDict(
        extra="forbid",
        json_schema_extra={"examples": [{"upload": "0123456789abcdef0123456789abcdef"}]},
    )

    upload: Annotated[str, Field(pattern=r"^[0-9a-f]{32}$")]


class GuidelinePictureDocument(Document):
    """A picture of the guidelines, under the SHA-256 of its bytes."""

    digest: str
    type: str
