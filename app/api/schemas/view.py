"""Changes to a view or a station that are neither lines nor ball."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Annotated

from pydantic import BaseModel, ConfigDict, Field, StrictBool, model_validator

from app.api.schemas.document import ListDocument
from app.api.schemas.group import image_address
from app.plural import plural
from app.soccer.choices import CalibrationChoice
from app.soccer.picture import ASPECTS, MAX_SHIFT, OPEN, PictureGeometry
from app.soccer.reasons import MAX_NOTE, Reason

_Shift = Annotated[float, Field(ge=-MAX_SHIFT, le=MAX_SHIFT)]
_Sigma = Annotated[float, Field(ge=0, le=1)]


class PictureEdit(BaseModel):
    """What was done to a picture since it was taken; what is absent its own lines say."""

    model_config = ConfigDict(
        extra="forbid",
        json_schema_extra={"examples": [{}, {"aspect": 4 / 3, "sigma": [0, 0, 0]}]},
    )

    aspect: float = Field(
        default=OPEN.aspect,
        ge=ASPECTS[0],
        le=ASPECTS[1],
        description="Of a pixel, width by height.",
    )
    shift: tuple[_Shift, _Shift] = Field(
        default=OPEN.shift,
        description="Of the optical axis from the middle, right and down, in half diagonals.",
    )
    sigma: tuple[_Sigma, _Sigma, _Sigma] = Field(
        default=OPEN.sigma,
        description="Standard deviations of the aspect and of both shifts: 0 is exactly known.",
    )

    def picture(self) -> PictureGeometry:
        """As a value."""
        return PictureGeometry(self.aspect, self.shift, self.sigma)


class ViewEdit(BaseModel):
    """Leave a view out or take it in again, choose its calibration, or say what its picture is."""

    model_config = ConfigDict(
        extra="forbid",
        json_schema_extra={
            "oneOf": [
                {"required": ["included"]},
                {"required": ["calibration"]},
                {"required": ["picture"]},
            ],
            "examples": [
                {"included": False, "reason": "not_same_instant"},
                {"included": True},
                {"calibration": "lines"},
                {"picture": {}},
            ],
        },
    )

    included: StrictBool = True
    reason: Reason | None = Field(default=None, description="Why the view is left out.")
    note: Annotated[str, Field(max_length=MAX_NOTE)] | None = Field(
        default=None, description="The same in one's own words; `other` needs it."
    )
    calibration: CalibrationChoice = "given"
    picture: PictureEdit | None = Field(
        default=None, description="What was done to the picture; null: it is as it was taken."
    )

    @model_validator(mode="after")
    def _one_thing(self) -> ViewEdit:
        if len({"included", "calibration", "picture"} & self.model_fields_set) != 1:
            raise ValueError("change one of included, calibration and picture at a time")
        if "included" not in self.model_fields_set and (self.reason or self.note):
            raise ValueError("a reason and a note belong to a view that is left out")
        return self


class StationEdit(BaseModel):
    """Choose which calibration of a static camera counts."""

    model_config = ConfigDict(
        extra="forbid", json_schema_extra={"examples": [{"calibration": "lines"}]}
    )

    calibration: CalibrationChoice


class Neighbour(BaseModel):
    """A frame of the same camera just before or after that of a view."""

    offset: int = Field(description="Frames later; below zero: before.")
    label: str
    image: str = Field(description="Address of the frame.")


class NeighbourList(ListDocument[Neighbour]):
    """The frames around a view's, in their order; `sentence` says why there are none."""

    sentence: str | None

    @staticmethod
    def of(view: int, offsets: Sequence[int], why_none: str) -> NeighbourList:
        """The document for a view and the offsets that there are."""
        items = [
            Neighbour(
                offset=offset,
                label=frames_away(offset),
                image=f"{image_address(view)}?offset={offset}",
            )
            for offset in offsets
        ]
        return NeighbourList(items=items, sentence=None if items else why_none)


def frames_away(offset: int) -> str:
    """``1 frame later``, ``3 frames before``."""
    return f"{plural(abs(offset), 'frame')} {'later' if offset > 0 else 'before'}"
