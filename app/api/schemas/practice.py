"""Practice: lessons, what they ask, and what became of them."""

from __future__ import annotations

from typing import Literal

from pydantic import BaseModel, Field

from app.review.practice.practice import Practice, PracticeLesson

LessonState = Literal["open", "mended", "right", "almost", "wrong"]


class PracticeBody(BaseModel):
    """How to begin."""

    again: bool = Field(
        default=False, description="Forget verdicts and edits of the lessons and begin again."
    )


class LessonDocument(BaseModel):
    """One practice group as a lesson."""

    group: int
    number: int = Field(description="From 1.")
    total: int
    title: str
    question: str = Field(description="What to look for; does not give the answer away.")
    hint: str = Field(description="Where to look, for somebody who is stuck.")
    verdict: str
    state: LessonState = Field(
        description="`mended`: edited rightly and not judged yet. Weighed against what the "
        "generator planted, never against what the solver found."
    )
    feedback: str | None = Field(description="Whether the answer was right, and why.")
    best: str | None = Field(description="What would have been best, once the group is judged.")

    @staticmethod
    def of(lesson: PracticeLesson) -> LessonDocument:
        """The document of a lesson."""
        return LessonDocument(
            group=lesson.group,
            number=lesson.number,
            total=lesson.total,
            title=f"Lesson {lesson.number} of {lesson.total}",
            question=lesson.question,
            hint=lesson.hint,
            verdict=lesson.verdict,
            state=lesson.feedback.state,
            feedback=lesson.feedback.sentence,
            best=lesson.feedback.best,
        )


class PracticeDocument(BaseModel):
    """The practice dataset; no lessons until it is made."""

    dataset: str
    lessons: list[LessonDocument]

    @staticmethod
    def of(practice: Practice) -> PracticeDocument:
        """The document of the whole practice."""
        lessons = [LessonDocument.of(lesson) for lesson in practice.lessons]
        return PracticeDocument(dataset=practice.dataset, lessons=lessons)
