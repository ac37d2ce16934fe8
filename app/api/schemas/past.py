"""What one entry of the log has changed of a group: its views before and after."""

from __future__ import annotations

from typing import Self

from pydantic import Field

from app.api.schemas.annotation import Ball, LineDocuments, lines_document
from app.api.schemas.document import Document
from app.api.schemas.group import PitchSize, image_address
from app.api.schemas.queue import LogEntryDocument
from app.review.editing.past import ChangedView, Step
from app.soccer.group import View, view_letter


class PastView(Document):
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
    before: PastView | None
    after: PastView | None

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
            before=None if changed.before is None else PastView.of(changed.before),
            after=None if changed.after is None else PastView.of(changed.after),
        )


class StepDocument(Document):
    """What an entry has changed: the views that differ, and the pitch."""

    entry: LogEntryDocument
    views: list[ChangedViewDocument]
    pitch_before: PitchSize | None = Field(description="null: there was nothing before it.")
    pitch_after: PitchSize

    @classmethod
    def of(cls, step: Step) -> Self:
        """The document of a step."""
        old = step.pitch_before
        return cls(
            entry=LogEntryDocument.of(step.entry),
            views=[ChangedViewDocument.of(view) for view in step.views],
            pitch_before=None if old is None else PitchSize.model_validate(old),
            pitch_after=PitchSize.model_validate(step.pitch_after),
        )
