"""Changes to a view or a station that are neither lines nor ball."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Annotated, Literal

from pydantic import BaseModel, ConfigDict, Field, StrictBool, model_validator

from app.api.schemas.group import image_address
from app.soccer.reasons import MAX_NOTE, Reason


class ViewEdit(BaseModel):
    """Leave a view out of its group or take it in again, or choose which calibration counts."""

    model_config = ConfigDict(
        extra="forbid",
        json_schema_extra={
            "oneOf": [{"required": ["included"]}, {"required": ["calibration"]}],
            "examples": [
                {"included": False, "reason": "not_same_instant"},
                {"included": True},
                {"calibration": "lines"},
            ],
        },
    )

    included: StrictBool = True
    reason: Reason | None = Field(default=None, description="Why the view is left out.")
    note: Annotated[str, Field(max_length=MAX_NOTE)] | None = Field(
        default=None, description="The same in one's own words; `other` needs it."
    )
    calibration: Literal["given", "lines"] = "given"

    @model_validator(mode="after")
    def _one_thing(self) -> ViewEdit:
        if len({"included", "calibration"} & self.model_fields_set) != 1:
            raise ValueError("change one of included and calibration at a time")
        if "calibration" in self.model_fields_set and (self.reason or self.note):
            raise ValueError("a reason and a note belong to a view that is left out")
        return self


class StationEdit(BaseModel):
    """Choose which calibration of a static camera counts."""

    model_config = ConfigDict(
        extra="forbid", json_schema_extra={"examples": [{"calibration": "lines"}]}
    )

    calibration: Literal["given", "lines"]


class Neighbour(BaseModel):
    """A frame of the same camera just before or after that of a view."""

    offset: int = Field(description="Frames later; below zero: before.")
    label: str
    image: str = Field(description="Address of the frame.")


class NeighbourList(BaseModel):
    """The frames around a view's, in their order; `sentence` says why there are none."""

    items: list[Neighbour]
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
    frames = "1 frame" if abs(offset) == 1 else f"{abs(offset)} frames"
    return f"{frames} {'later' if offset > 0 else 'before'}"
