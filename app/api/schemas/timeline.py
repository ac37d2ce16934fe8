"""A timeline as it travels: one list for each number, so that thousands of groups stay light."""

from __future__ import annotations

from typing import Annotated

from pydantic import BaseModel, Field

from app.review.queue.timeline import Timeline

Place = Annotated[list[float], Field(min_length=3, max_length=3)]
"""x, y, z. No tuple: in lists the checkers of OpenAPI documents stumble over them."""


class TimelineDocument(BaseModel):
    """Groups in the order of their numbers; the values of one group stand at one index."""

    total: int
    id: list[int]
    number: list[int]
    frame: list[int | None] = Field(
        description="Number of the video frame; null where the key of the group is none."
    )
    error_px: list[float | None] = Field(
        description="The larger reprojection error of the best pair, with or without a ball."
    )
    passes: list[bool | None] = Field(description="null while the group is not solved.")
    gate: list[str | None] = Field(description="The first failing gate.")
    status: list[str]
    stale: list[bool] = Field(description="Whether the inputs changed after the verdict.")
    sigma_m: list[float | None]
    point: list[Place | None] = Field(description="The 3D ball; pitch frame, metres, z down.")

    @staticmethod
    def of(timeline: Timeline) -> TimelineDocument:
        """The document of a timeline."""
        points = [None if point is None else list(point) for point in timeline.point]
        values = {**vars(timeline), "point": points}
        return TimelineDocument.model_construct(total=len(timeline.id), **values)
