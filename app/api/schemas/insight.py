"""What would help a group, and what each marking of a view is worth."""

from __future__ import annotations

from typing import Any

from pydantic import Field, model_validator

from app.api.schemas.document import Document, ListDocument
from app.api.schemas.solution import XY, FixDocument, GuideDocument, Jac, OfferDocument
from app.review.editing.influence import Influence
from app.review.editing.remedies import Remedy


class RemedyEdit(FixDocument):
    """An edit as findings propose it, or a point moved."""

    point: XY | None = Field(
        description="Where `move_point` puts its point, or where the ball of `look_ball` would be."
    )


class RemedyDocument(Document):
    """What the solver has tried out: an edit, or where a person should look and draw."""

    gate: str = Field(description="The gate that fails now.")
    view: str | None
    sentence: str = Field(description='Reads on after "would pass if".')
    edit: RemedyEdit
    offers: list[OfferDocument] = Field(
        description="Edits that carry it out; none where a person has to look or draw."
    )
    guide: GuideDocument | None = Field(
        description="Where that person is led; null where edits are offered."
    )
    value: float | None = Field(description="The gate's value after the edit.")
    passes: bool = Field(description="Whether the whole group would pass after the edit.")

    @model_validator(mode="before")
    @classmethod
    def _with_point(cls, value: Any) -> Any:
        if isinstance(value, Remedy):
            return {**vars(value), "edit": {**vars(value.fix), "point": value.point}}
        return value


class Remedies(ListDocument[RemedyDocument]):
    """What would make a group pass, the gentlest first; empty when it passes."""


class InfluenceDocument(Document, shows=Influence):
    """What the camera would be without one marking."""

    jac: Jac | None = Field(description="JaC of the view as it is, by gamma in per cent.")
    jac_without: Jac | None = Field(
        description="JaC of the other markings, with a camera that is calibrated without this one."
    )
    largest_px_without: float | None = Field(
        description="Distance of its points from the marking, with a camera that is calibrated "
        "without them."
    )


class Influences(ListDocument[InfluenceDocument]):
    """The influence of every annotated marking of a view."""
