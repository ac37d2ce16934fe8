"""Bodies of requests that edit views: lines, balls, pictures, calibrations."""

from __future__ import annotations

from typing import Annotated, Any

from pydantic import (
    AfterValidator,
    BaseModel,
    BeforeValidator,
    ConfigDict,
    Field,
    StrictBool,
    WithJsonSchema,
    model_validator,
)

from app.errors import UnknownMarkingError
from app.http.documents import RequestBody
from app.soccer.annotation import BallAnnotation, format_followed_from_group
from app.soccer.choices import CalibrationChoice
from app.soccer.frames import MAX_PIXEL, Box, ImagePoint
from app.soccer.group import MAX_NOTE, Reason
from app.soccer.picture import ASPECTS, MAX_SHIFT, OPEN, PictureGeometry
from app.soccer.pitch import MARKINGS, canonical_marking


def _validate_marking_name(name: str) -> str:
    try:
        return canonical_marking(name)
    except UnknownMarkingError as error:
        raise ValueError(error.message) from None


def _require_distinct_markings(lines: Any) -> Any:
    if isinstance(lines, dict):
        names = [name.strip() for name in lines if isinstance(name, str)]
        if len(set(names)) < len(names):
            raise ValueError("a marking is named twice")
    return lines


Marking = Annotated[
    str,
    AfterValidator(_validate_marking_name),
    WithJsonSchema({"type": "string", "enum": list(MARKINGS)}),
]
"""One of the 26 names; spaces at the ends do not matter."""


Pixel = Annotated[float, Field(ge=-MAX_PIXEL, le=MAX_PIXEL, allow_inf_nan=False, strict=True)]


Length = Annotated[float, Field(gt=0, le=MAX_PIXEL, allow_inf_nan=False, strict=True)]


BoxNumbers = tuple[Pixel, Pixel, Length, Length]
"""x, y of the top-left corner, width, height; pixels of the annotated size."""


PointNumbers = tuple[Pixel, Pixel]


class Point(RequestBody):
    """A point of an image, pixels of the annotated size, (0, 0) the centre of the first pixel."""

    x: Pixel
    y: Pixel


Points = Annotated[list[Point], Field(fail_fast=True)]
"""Of one marking; the first that is wrong is told, for each costs as much as ten that are right."""


LineEdits = Annotated[
    dict[Marking, Points | None],
    BeforeValidator(_require_distinct_markings),
]


class LinesEdit(
    RequestBody,
    examples=[
        {"lines": {"Middle line": [{"x": 640.5, "y": 120.0}, {"x": 655.0, "y": 700.0}]}},
        {"lines": {"Circle central": None}},
    ],
):
    """New points for some markings: null or no points delete one, absent ones stay."""

    lines: LineEdits
    proposed: Annotated[list[Marking], Field(max_length=len(MARKINGS))] = Field(
        default_factory=list,
        description=(
            "Markings whose points are as proposed from the paint: their source is `proposed` "
            "until a person moves them."
        ),
    )
    not_visible: Annotated[list[Marking], Field(max_length=len(MARKINGS))] = Field(
        default_factory=list,
        description=(
            "Markings without points that the picture does not show, hidden or worn: JaC does not "
            "count them as missing until a person draws them."
        ),
    )

    @model_validator(mode="after")
    def _check_not_visible(self) -> LinesEdit:
        for marking in self.not_visible:
            if marking not in self.lines or self.lines[marking]:
                raise ValueError(
                    f"`not_visible` contains {marking}, so {marking} must be null under `lines`"
                )
        return self

    def points(self) -> dict[str, tuple[ImagePoint, ...] | None]:
        """The edit in values of the pitch's vocabulary."""
        return points_by_marking(self.lines)


def points_by_marking(
    lines: dict[str, list[Point] | None],
) -> dict[str, tuple[ImagePoint, ...] | None]:
    """Line edits as values."""
    return {
        marking: None if points is None else tuple(ImagePoint(p.x, p.y) for p in points)
        for marking, points in lines.items()
    }


def _describe_ball_alternatives(schema: dict[str, Any]) -> None:
    """Describe the ball edit as the three things that it may be, each complete in itself."""
    fields = schema.pop("properties")
    del schema["type"], schema["additionalProperties"]
    box, point = (fields[name].pop("anyOf")[0] for name in ("box", "point"))
    nowhere = {"type": "null"}

    def build_alternative(title: str, place: str, **own: Any) -> dict[str, Any]:
        own = {"box": nowhere, "point": nowhere, "out_of_view": {"const": False}, **own}
        properties = {name: fields[name] | own.get(name, {}) for name in fields}
        properties[place].pop("default", None)
        return {
            "title": title,
            "type": "object",
            "properties": properties,
            "required": [place],
            "additionalProperties": False,
        }

    schema["examples"] = [
        {"box": [801.5, 322.0, 14.0, 14.5]},
        {"point": [808.5, 329.0]},
        {"out_of_view": True},
    ]
    schema["oneOf"] = [
        build_alternative("BallByBox", "box", box=box),
        build_alternative("BallByPoint", "point", point=point),
        build_alternative(
            "BallOutOfView", "out_of_view", out_of_view={"const": True}, followed_from=nowhere
        ),
    ]


class BallEdit(BaseModel):
    """The ball of a view: its box, or its centre alone, or that it is out of view."""

    model_config = ConfigDict(extra="forbid", json_schema_extra=_describe_ball_alternatives)

    box: BoxNumbers | None = None
    point: PointNumbers | None = None
    occluded: StrictBool = False
    out_of_view: StrictBool = False
    inferred: StrictBool = Field(
        default=False,
        description="Put where the 3D ball of the other views is seen: exported, and no evidence.",
    )
    followed_from: Annotated[str, Field(min_length=1, max_length=1000)] | None = Field(
        default=None,
        description="Key of the group from whose ball it was followed through the frames of the camera: "
        "that is its source. null: a person placed it.",
    )

    @model_validator(mode="after")
    def _check_one_place(self) -> BallEdit:
        placed = (self.box is not None) + (self.point is not None)
        if placed == 2:
            raise ValueError("give a box or a point, not both")
        if placed and self.out_of_view:
            raise ValueError("a ball that is out of view has neither a box nor a point")
        if self.out_of_view and self.followed_from is not None:
            raise ValueError("a ball that is out of view was not followed there")
        if not placed and not self.out_of_view:
            raise ValueError(
                "give a box, a point or out_of_view: true; to remove the ball, send null in place"
                " of the whole ball"
            )
        return self

    def ball(self) -> BallAnnotation:
        """The annotation that it says."""
        return BallAnnotation(
            box=None if self.box is None else Box(*self.box),
            point=None if self.point is None else ImagePoint(*self.point),
            occluded=self.occluded,
            out_of_view=self.out_of_view,
            inferred=self.inferred and not self.out_of_view,
            predicted_by=""
            if self.followed_from is None
            else format_followed_from_group(self.followed_from),
        )


_Shift = Annotated[float, Field(ge=-MAX_SHIFT, le=MAX_SHIFT)]


_Sigma = Annotated[float, Field(ge=0, le=1)]


class PictureGeometryEdit(RequestBody, examples=[{}, {"aspect": 4 / 3, "sigma": [0, 0, 0]}]):
    """What was done to a picture since it was taken; what is absent its own lines say."""

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
    picture: PictureGeometryEdit | None = Field(
        default=None, description="What was done to the picture; null: it is as it was taken."
    )

    @model_validator(mode="after")
    def _check_one_change(self) -> ViewEdit:
        if len({"included", "calibration", "picture"} & self.model_fields_set) != 1:
            raise ValueError("change one of included, calibration and picture at a time")
        if "included" not in self.model_fields_set and (self.reason or self.note):
            raise ValueError("a reason and a note belong to a view that is left out")
        return self


class StationCalibrationSourceEdit(RequestBody, examples=[{"calibration": "lines"}]):
    """Choose which calibration of a static camera counts."""

    calibration: CalibrationChoice
