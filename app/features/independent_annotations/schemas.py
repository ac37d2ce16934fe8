"""Own annotations of groups, gold groups and guidelines, as they travel."""

from __future__ import annotations

from datetime import datetime
from typing import Annotated, Literal

from pydantic import BaseModel, ConfigDict, Field

from app.features.guidelines.service import MAX_LETTERS, GuidelineVersion
from app.features.independent_annotations.gold import GoldGroup, GoldResult, Middle, PersonResults
from app.features.independent_annotations.known_truth import MOST
from app.features.independent_annotations.return_work import MAX_REASON
from app.features.independent_annotations.service import TakeView
from app.features.queue.query import MAX_LISTED_LENGTH
from app.finite import MAX_ID
from app.http.documents import Document, ListDocument
from app.soccer.choices import GoldStart


class HandedBackDocument(Document):
    """That a group was handed back to somebody who had handed it in."""

    group: int = Field(description="What they work on; of an annotation of their own, the copy.")
    title: str
    by: str = Field(description="Who handed it back.")
    at: datetime
    reason: str = Field(description="Why; may be empty.")


class HandBack(BaseModel):
    """Why something that was handed in goes back."""

    model_config = ConfigDict(
        extra="forbid",
        json_schema_extra={"examples": [{"reason": "The far goal line is missing in view B."}]},
    )

    reason: Annotated[str, Field(max_length=MAX_REASON)] = Field(
        default="", description="A sentence for the person who gets the group back."
    )


class TakeHandBack(HandBack):
    """Which annotation of a group goes back, and why."""

    model_config = ConfigDict(
        extra="forbid",
        json_schema_extra={"examples": [{"take": 7, "reason": "The ball in B is the spot."}]},
    )

    take: Annotated[int, Field(ge=1, le=MAX_ID)]


class TakeDocument(Document, shows=TakeView):
    """Somebody's own annotation of a group, made on a copy that nobody else sees."""

    batch: int | None = Field(description="The batch that it is for; null: none.")
    group: int = Field(description="The copy: a group like any other.")
    dataset: int = Field(description="Of the groups that this is a copy of one of.")
    of: int | None = Field(description="The group that it is a copy of, where that may be known.")
    number: int | None = Field(
        description="Number of that group in its dataset, where that may be known."
    )
    title: str = Field(
        description="What people call the group; where it may not be known, the copy."
    )
    place: int = Field(description="Which one of this person in this batch, from 1.")
    begun: datetime
    handed_in: datetime | None
    settled: datetime | None = Field(
        description="When it was decided; null: not yet, or not disclosed to its person."
    )
    handed_back: HandedBackDocument | None = Field(
        description="Why its person has it back; null: they have not."
    )


class TakeList(ListDocument[TakeDocument]):
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


class GoldChosenDocument(Document):
    """What came of it."""

    groups: list[int] = Field(description="Groups that are gold by now.")
    left_out: int = Field(description="Groups without known true values.")


class GoldGroupDocument(Document, shows=GoldGroup):
    """A group whose truth is known."""

    marked: datetime
    source: Literal["verdict", "sample", "version"] = Field(
        description="Where its truth is from: what it held when it was marked, the sample's own files, "
        "or a frozen version."
    )


class AnnotationErrorDocument(Document):
    """How far an annotation is from the truth."""

    line_px: float | None = Field(
        description="Median over the markings that both have of their mean distance, pixels."
    )
    lines_missing: int = Field(description="Markings of the truth that were not drawn.")
    ball_px: float | None = Field(description="Largest distance of the balls in a view, pixels.")
    balls_missing: int = Field(description="Views in which one has a ball and the other none.")
    ball_m: float | None = Field(description="Distance of the 3D balls, metres.")


class GoldResultDocument(Document, shows=GoldResult):
    """What one person made of a gold group."""

    handed_in: datetime = Field(description="When they submitted it first.")
    true_verdict: str = Field(title="Known Verdict")
    right: bool | None = Field(description="Whether they judged as is true; null: not judged.")
    error: AnnotationErrorDocument
    submissions: int = Field(
        description="How often they submitted it. The first one is measured; there are more where a "
        "lead returned it."
    )


class MiddleDocument(Document, shows=Middle):
    """A median with an interval of 95 %, which fewer than six numbers do not have."""


class PersonResultsDocument(Document, shows=PersonResults):
    """What somebody made of gold groups, oldest first."""

    results: list[GoldResultDocument]
    line_px: MiddleDocument
    ball_px: MiddleDocument
    ball_m: MiddleDocument
    right_low: float | None = Field(description="Wilson's interval of the share, 95 %.")


class GoldReportDocument(Document):
    """The gold groups of a dataset, and how far each person is from what is true of them."""

    groups: list[GoldGroupDocument]
    people: list[PersonResultsDocument]


class GuidelineVersionDocument(Document, shows=GuidelineVersion):
    """One version of the guidelines."""

    written: datetime


class GuidelinesDocument(Document):
    """What annotators of a dataset are told."""

    dataset: int = Field(
        description="Whose guidelines they are; copies have those of what they copy."
    )
    number: int = Field(description="0: there are no guidelines.")
    text: str = Field(description="Markdown; `![words](DIGEST)` in a line of its own is a picture.")
    versions: list[GuidelineVersionDocument]


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
