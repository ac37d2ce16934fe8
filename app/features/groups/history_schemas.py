"""Documents of a group's history and of previews."""

from __future__ import annotations

from typing import Annotated, Self

from pydantic import BaseModel, ConfigDict, Field, StrictBool

from app.features.groups.history import ChangedView, EntryChanges
from app.features.groups.schemas import (
    Ball,
    BallEdit,
    LineDocuments,
    LineEdits,
    PictureEdit,
    PitchSize,
    image_address,
    lines_document,
)
from app.features.groups.solution_schemas import SolutionDocument
from app.features.queue.schemas import LogEntryDocument
from app.http.documents import Document
from app.soccer.group import View, view_letter


class ViewThen(Document):
    """A view as it was said to be at a time."""

    included: bool
    calibration: str = Field(description="Which calibration counts when both exist.")
    lines: LineDocuments
    balls: list[Ball]

    @classmethod
    def of(cls, view: View) -> Self:
        """The document of a view."""
        return cls(
            included=view.included,
            calibration=view.station.calibration,
            lines=lines_document(view.station.lines),
            balls=[Ball.of(ball) for ball in view.balls],
        )


class ChangedViewDocument(Document):
    """A view that an entry has changed; `before` and `after` are null where it was not there."""

    key: str
    letter: str
    width: int
    height: int
    image: str | None = Field(description="Address of the frame, where there is one now.")
    before: ViewThen | None
    after: ViewThen | None

    @classmethod
    def of(cls, changed: ChangedView) -> Self:
        """The document of a changed view."""
        there = changed.after or changed.before
        assert there is not None
        shown = changed.id is not None and there.media is not None
        return cls(
            key=changed.key,
            letter=view_letter(changed.index),
            width=there.size.width,
            height=there.size.height,
            image=image_address(changed.id) if shown and changed.id is not None else None,
            before=None if changed.before is None else ViewThen.of(changed.before),
            after=None if changed.after is None else ViewThen.of(changed.after),
        )


class StepDocument(Document):
    """What an entry has changed: the views that differ, and the pitch."""

    entry: LogEntryDocument
    views: list[ChangedViewDocument]
    pitch_before: PitchSize | None = Field(description="null: there was nothing before it.")
    pitch_after: PitchSize

    @classmethod
    def of(cls, step: EntryChanges) -> Self:
        """The document of a step."""
        old = step.pitch_before
        return cls(
            entry=LogEntryDocument.of(step.entry),
            views=[ChangedViewDocument.of(view) for view in step.views],
            pitch_before=None if old is None else PitchSize.model_validate(old),
            pitch_after=PitchSize.model_validate(step.pitch_after),
        )


class ViewPreview(BaseModel):
    """Changes to one view; what is absent stays as it is."""

    model_config = ConfigDict(extra="forbid")

    lines: LineEdits = Field(default_factory=dict)
    ball: BallEdit | None = Field(
        default=None, description="null: the view has no ball; absent: the ball stays as it is."
    )
    included: StrictBool | None = None
    picture: PictureEdit | None = Field(
        default=None,
        description="null: as the camera took it; absent: unchanged.",
    )


class PreviewRequest(BaseModel):
    """Changes by the key of the view."""

    model_config = ConfigDict(
        extra="forbid",
        json_schema_extra={
            "examples": [{"views": {"7_1.png": {"ball": {"box": [801.5, 322.0, 14.0, 14.5]}}}}]
        },
    )

    views: Annotated[dict[str, ViewPreview], Field(max_length=64)]


class PreviewDocument(Document):
    """The solution as it would be."""

    solution: SolutionDocument
