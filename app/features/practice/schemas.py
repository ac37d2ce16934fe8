"""Practice: lessons, what they ask, and what became of them."""

from __future__ import annotations

from typing import Literal

from pydantic import AliasPath, BaseModel, ConfigDict, Field

from app.features.practice.recording_lessons import LessonName, RecordingLesson
from app.http.documents import Document

LessonState = Literal["open", "mended", "right", "almost", "wrong"]


class PracticeBody(BaseModel):
    """How the practice begins."""

    model_config = ConfigDict(extra="forbid")

    again: bool = Field(
        default=False, description="Forget verdicts and edits of the lessons and begin again."
    )


class LessonDocument(Document):
    """One practice group as a lesson."""

    group: int
    number: int = Field(description="From 1.")
    total: int
    title: str
    question: str = Field(description="What to look for; does not give the answer away.")
    hint: str = Field(description="A hint where to look.")
    verdict: str
    state: LessonState = Field(
        validation_alias=AliasPath("feedback", "state"),
        description="`mended`: edited rightly and not judged yet. Weighed against what the "
        "generator planted, never against what the solver found.",
    )
    feedback: str | None = Field(
        validation_alias=AliasPath("feedback", "sentence"),
        description="Whether the answer was right, and why.",
    )
    best: str | None = Field(
        validation_alias=AliasPath("feedback", "best"),
        description="What would have been best, once the group is judged.",
    )


class PracticeDocument(Document):
    """The practice dataset; no lessons until it is made."""

    dataset: str
    lessons: list[LessonDocument]


class RecordingLessonDocument(Document, shows=RecordingLesson):
    """One lesson on the practice recording."""

    name: LessonName = Field(description="Which.")
    question: str = Field(description="What to do.")
    hint: str = Field(description="With which keys.")
    state: Literal["open", "almost", "right"] = Field(
        description="Weighed against the film's truth."
    )
    feedback: str = Field(description="What is right and what is not, in words and numbers.")
    frame: int = Field(description="Where to look: a frame of the recording.")
    right: int = Field(description="How many shots, frames or links are right.")
    total: int = Field(description="Of how many.")
    off: float | None = Field(
        description="How far from the truth: pixels of the grass (cameras), metres (side), live frames (link)."
    )


class RecordingPracticeDocument(Document):
    """The practice recording; no lessons until it is made."""

    dataset: str
    recording: int | None = Field(description="Id of the recording.")
    lessons: list[RecordingLessonDocument]
