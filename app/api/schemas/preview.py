"""A what-if: edits of several views that are solved and not saved."""

from __future__ import annotations

from typing import Annotated

from pydantic import BaseModel, ConfigDict, Field, StrictBool

from app.api.schemas.annotation import BallEdit, LineEdits
from app.api.schemas.document import Document
from app.api.schemas.solution import SolutionDocument
from app.api.schemas.view import PictureEdit


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
        description="null: as it was taken; absent: the picture stays what it is said to be.",
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
