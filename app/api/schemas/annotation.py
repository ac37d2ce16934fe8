"""Annotations as they travel: points of lines and boxes of balls, and the edits of both."""

from __future__ import annotations

from typing import Annotated, Any, Literal

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

from app.api.schemas.identity_cache import IdentityCache
from app.errors import UnknownMarkingError
from app.soccer.annotation import BallAnnotation, Lines
from app.soccer.frames import MAX_PIXEL, Box, ImagePoint
from app.soccer.pitch import MARKINGS, canonical_marking


def _known(name: str) -> str:
    try:
        return canonical_marking(name)
    except UnknownMarkingError as error:
        raise ValueError(error.message) from None


def _distinct(lines: Any) -> Any:
    if isinstance(lines, dict):
        names = [name.strip() for name in lines if isinstance(name, str)]
        if len(set(names)) < len(names):
            raise ValueError("a marking is named twice")
    return lines


Marking = Annotated[
    str, AfterValidator(_known), WithJsonSchema({"type": "string", "enum": list(MARKINGS)})
]
"""One of the 26 names; spaces at the ends do not matter."""
Pixel = Annotated[float, Field(ge=-MAX_PIXEL, le=MAX_PIXEL, allow_inf_nan=False, strict=True)]
Length = Annotated[float, Field(gt=0, le=MAX_PIXEL, allow_inf_nan=False, strict=True)]
BoxNumbers = tuple[Pixel, Pixel, Length, Length]
"""x, y of the top-left corner, width, height; pixels of the annotated size."""
PointNumbers = tuple[Pixel, Pixel]


class Point(BaseModel):
    """A point of an image, pixels of the annotated size, (0, 0) the centre of the first pixel."""

    model_config = ConfigDict(extra="forbid")

    x: Pixel
    y: Pixel


Points = Annotated[list[Point], Field(fail_fast=True)]
"""Of one marking; the first that is wrong is told, for each costs as much as ten that are right."""
LineEdits = Annotated[
    dict[Marking, Points | None],
    BeforeValidator(_distinct),
]


class LinesEdit(BaseModel):
    """New points for some markings: null or no points delete one, absent ones stay."""

    model_config = ConfigDict(
        extra="forbid",
        json_schema_extra={
            "examples": [
                {"lines": {"Middle line": [{"x": 640.5, "y": 120.0}, {"x": 655.0, "y": 700.0}]}},
                {"lines": {"Circle central": None}},
            ]
        },
    )

    lines: LineEdits
    proposed: Annotated[list[Marking], Field(max_length=len(MARKINGS))] = Field(
        default_factory=list,
        description="Those of them whose points are as they were proposed from the paint: their "
        "source is `proposed`, until somebody moves them.",
    )
    not_visible: Annotated[list[Marking], Field(max_length=len(MARKINGS))] = Field(
        default_factory=list,
        description="Those of them without points that the picture does not show, hidden or worn: "
        "JaC does not count them as missing, until somebody draws them.",
    )

    @model_validator(mode="after")
    def _check_not_visible(self) -> LinesEdit:
        for marking in self.not_visible:
            if marking not in self.lines or self.lines[marking]:
                raise ValueError(
                    f"`not_visible` names {marking}, which needs null under `lines` then"
                )
        return self

    def points(self) -> dict[str, tuple[ImagePoint, ...] | None]:
        """The edit in values of the pitch's vocabulary."""
        return points_of(self.lines)


def points_of(lines: dict[str, list[Point] | None]) -> dict[str, tuple[ImagePoint, ...] | None]:
    """Line edits as values."""
    return {
        marking: None if points is None else tuple(ImagePoint(p.x, p.y) for p in points)
        for marking, points in lines.items()
    }


def _as_union(schema: dict[str, Any]) -> None:
    """Describe the ball edit as the three things that it may be, each complete in itself."""
    said = schema.pop("properties")
    del schema["type"], schema["additionalProperties"]
    box, point = (said[name].pop("anyOf")[0] for name in ("box", "point"))
    nowhere = {"type": "null"}

    def one(title: str, place: str, **own: Any) -> dict[str, Any]:
        own = {"box": nowhere, "point": nowhere, "out_of_view": {"const": False}, **own}
        properties = {name: said[name] | own.get(name, {}) for name in said}
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
        one("BallByBox", "box", box=box),
        one("BallByPoint", "point", point=point),
        one("BallOutOfView", "out_of_view", out_of_view={"const": True}),
    ]


class BallEdit(BaseModel):
    """The ball of a view: its box, or its centre alone, or that it is out of view."""

    model_config = ConfigDict(extra="forbid", json_schema_extra=_as_union)

    box: BoxNumbers | None = None
    point: PointNumbers | None = None
    occluded: StrictBool = False
    out_of_view: StrictBool = False
    inferred: StrictBool = Field(
        default=False,
        description="Put where the 3D ball of the other views is seen: exported, and no evidence.",
    )

    @model_validator(mode="after")
    def _one_place(self) -> BallEdit:
        placed = (self.box is not None) + (self.point is not None)
        if placed == 2:
            raise ValueError("give a box or a point, not both")
        if placed and self.out_of_view:
            raise ValueError("a ball that is out of view has neither a box nor a point")
        if not placed and not self.out_of_view:
            raise ValueError(
                "give a box, a point or out_of_view: true; null in place of the whole ball "
                "says that there is none"
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
        )


class Ball(BaseModel):
    """One ball as annotated."""

    box: BoxNumbers | None
    point: PointNumbers | None
    occluded: bool
    out_of_view: bool
    source: Literal["dataset", "person", "prediction"] = Field(
        description="Who says so; `prediction`: a person accepted it from `predicted_by`."
    )
    predicted_by: str | None = Field(description="Name of the set of predictions.")
    inferred: bool = Field(
        description="Put where the 3D ball of the other views is seen; it confirms nothing."
    )

    @staticmethod
    def of(ball: BallAnnotation, *, edited: bool = False) -> Ball:
        """The document of an annotation; ``edited``: a person has changed it."""
        box, point = ball.box, ball.point
        return Ball.model_construct(
            box=None if box is None else (box.x, box.y, box.width, box.height),
            point=None if point is None else (point.x, point.y),
            occluded=ball.occluded,
            out_of_view=ball.out_of_view,
            source="prediction" if ball.predicted_by else "person" if edited else "dataset",
            predicted_by=ball.predicted_by or None,
            inferred=ball.inferred,
        )


LineDocuments = dict[str, list[Point]]


def _line_documents(lines: Lines) -> LineDocuments:
    return {
        marking: [Point.model_construct(x=point.x, y=point.y) for point in points]
        for marking, points in lines.items()
    }


_kept_documents: IdentityCache[Lines, LineDocuments] = IdentityCache(_line_documents, size=1024)


def lines_document(lines: Lines) -> LineDocuments:
    """Lines as they travel."""
    return _kept_documents(lines)
