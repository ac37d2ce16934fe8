"""Documents of groups, views and annotations."""

from __future__ import annotations

from collections.abc import Sequence
from datetime import datetime
from typing import Annotated, Any, Literal

from fastapi import Response
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
from app.features.groups.solution_schemas import SolutionDocument
from app.features.groups.state import GroupState
from app.features.policies.schemas import PolicyDocument
from app.http.documents import Document, IdentityCache, ListDocument, make_document_response
from app.soccer.annotation import BallAnnotation, Lines, format_followed_from_group
from app.soccer.choices import CalibrationChoice, VerdictState
from app.soccer.frames import MAX_PIXEL, Box, ImagePoint
from app.soccer.group import (
    MAX_NOTE,
    Group,
    Reason,
    View,
    ViewExclusion,
    is_numbered_in_time,
    make_view_letter,
)
from app.soccer.picture import ASPECTS, MAX_SHIFT, OPEN, PictureGeometry
from app.soccer.pitch import MARKINGS, canonical_marking
from app.wording import plural


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


class Point(BaseModel):
    """A point of an image, pixels of the annotated size, (0, 0) the centre of the first pixel."""

    model_config = ConfigDict(extra="forbid")

    x: Pixel
    y: Pixel


Points = Annotated[list[Point], Field(fail_fast=True)]
"""Of one marking; the first that is wrong is told, for each costs as much as ten that are right."""
LineEdits = Annotated[
    dict[Marking, Points | None],
    BeforeValidator(_require_distinct_markings),
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


class Ball(BaseModel):
    """One ball as annotated."""

    box: BoxNumbers | None
    point: PointNumbers | None
    occluded: bool
    out_of_view: bool
    source: Literal["dataset", "person", "prediction"] = Field(
        description="Who says so; `prediction`: a person accepted it from `predicted_by`."
    )
    predicted_by: str | None = Field(
        description="Name of the set of predictions, a `ball run` of a recording, or `followed from` with the "
        "key of a group."
    )
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


def _build_line_documents(lines: Lines) -> LineDocuments:
    return {
        marking: [Point.model_construct(x=point.x, y=point.y) for point in points]
        for marking, points in lines.items()
    }


_kept_documents: IdentityCache[Lines, LineDocuments] = IdentityCache(
    _build_line_documents, size=1024
)


def lines_to_document(lines: Lines) -> LineDocuments:
    """Lines as they travel."""
    return _kept_documents(lines)


class DatasetReference(Document):
    """The dataset that a group belongs to."""

    id: int
    name: str


class PitchSize(Document):
    """Length and width of the pitch, metres."""

    length: float
    width: float


class VerdictDocument(Document):
    """What people decided; `stale` when the group changed afterwards."""

    state: VerdictState
    reason: str | None
    note: str | None
    by: str | None = Field(validation_alias="actor")
    at: datetime | None
    stale: bool
    fixed: bool = Field(description="Mended: edited, accepted as such, and it fails no gate.")
    override: str | None = Field(description="The gate that it was accepted against.")


class StationDocument(Document):
    """The camera station of a view; a shared one is a static camera."""

    id: int
    key: str
    shared: bool
    calibration: CalibrationChoice = Field(description="Which calibration counts when both exist.")
    has_given: bool
    picture: PictureGeometry | None = Field(
        description="What was done to the picture since the camera took it; null: nothing is recorded."
    )
    etag: str = Field(description="For If-Match on `/stations/{id}/lines`.")


class ViewDocument(Document):
    """One image of the instant, as annotated."""

    id: int
    key: str
    letter: str
    label: str
    width: int
    height: int
    included: bool
    left_out: ViewExclusion | None = Field(
        description="Reason why a person left the view out, if they gave one."
    )
    station: StationDocument
    lines: LineDocuments
    proposed: list[str] = Field(
        description="Markings whose source is `proposed`: a person accepted their points as they "
        "were proposed from the paint."
    )
    not_visible: list[str] = Field(
        description="Markings that a person says the picture does not show: JaC does not count them "
        "as missing."
    )
    balls: list[Ball]
    image: str | None = Field(description="Address of the frame, where there is one.")
    neighbours: str | None = Field(
        description="Address of the list of frames just before and after; null where the "
        "dataset's frames are not numbered by time."
    )


class GroupDocument(Document):
    """A group, complete: what people said and what follows from it."""

    id: int
    number: int = Field(description="Place in the dataset, from 1.")
    dataset: DatasetReference
    key: str
    label: str
    match: str
    split: str
    pitch: PitchSize
    revision: int
    etag: str = Field(description="The ETag header again, quotes included.")
    can_undo: bool
    can_redo: bool
    verdict: VerdictDocument
    verdicts: list[VerdictDocument] = Field(description="The last verdict of every person.")
    policy: PolicyDocument
    views: list[ViewDocument]
    solution: SolutionDocument | None

    @staticmethod
    def of(state: GroupState) -> GroupDocument:
        """The document of a group's state."""
        group = state.group
        return GroupDocument.model_construct(
            id=state.id,
            number=state.number,
            dataset=DatasetReference(id=state.dataset_id, name=state.dataset),
            key=group.key,
            label=group.label or group.key,
            match=group.match,
            split=group.split,
            pitch=PitchSize.model_validate(group.pitch),
            revision=state.revision,
            etag=state.etag,
            can_undo=state.can_undo,
            can_redo=state.can_redo,
            verdict=VerdictDocument.model_validate(state.verdict),
            verdicts=[VerdictDocument.model_validate(verdict) for verdict in state.verdicts],
            policy=PolicyDocument.model_validate(state.policy),
            views=[
                _build_view_document(state, view, index, label)
                for index, (view, label) in enumerate(
                    zip(group.views, make_view_labels(group), strict=True)
                )
            ],
            solution=None
            if state.solution is None
            else SolutionDocument.of(state.solution, group, state.dismissed),
        )


def make_group_response(state: GroupState) -> Response:
    """The document of a group, its ETag in the header."""
    headers = {"ETag": state.etag, "Cache-Control": "private, no-cache"}
    return make_document_response(GroupDocument.of(state), headers=headers)


def make_view_labels(group: Group) -> list[str]:
    """What people call the views: the camera's number, or the main camera and its replays."""
    labels = []
    for index, view in enumerate(group.views):
        camera = view.station.key.removeprefix("cam") if view.station.shared else ""
        if camera.isdigit():
            labels.append(f"Camera {camera}")
        elif index == 0:
            labels.append("Main camera")
        else:
            labels.append(f"Replay {index}")
    return labels


def url_of_image(view_id: int) -> str:
    """Where the frame of a view is served."""
    return f"/api/v1/views/{view_id}/image"


def _build_view_document(state: GroupState, view: View, index: int, label: str) -> ViewDocument:
    view_id, why = state.view_ids[view.key], view.left_out
    return ViewDocument.model_construct(
        id=view_id,
        key=view.key,
        letter=make_view_letter(index),
        label=label,
        width=view.size.width,
        height=view.size.height,
        included=view.included,
        left_out=None if why is None else why,
        station=_build_station_document(state, view),
        lines=lines_to_document(view.station.lines),
        proposed=[*view.station.proposed],
        not_visible=[*view.station.not_visible],
        balls=[Ball.of(ball, edited=view.key in state.stored.edited_views) for ball in view.balls],
        image=None if view.media is None else url_of_image(view_id),
        neighbours=_build_neighbours_url(state.key, view, view_id),
    )


def _build_neighbours_url(group: str, view: View, view_id: int) -> str | None:
    media = view.media
    if media is None or not is_numbered_in_time(media, group, view.station.shared):
        return None
    return f"/api/v1/views/{view_id}/neighbours"


def _build_station_document(state: GroupState, view: View) -> StationDocument:
    station = view.station
    values: dict[str, Any] = {
        "id": state.station_ids[station.key],
        "key": station.key,
        "shared": station.shared,
        "calibration": station.calibration,
        "has_given": station.given is not None,
        "picture": None if station.picture is None else station.picture,
        "etag": state.station_etags[station.key],
    }
    return StationDocument.model_construct(**values)


_Shift = Annotated[float, Field(ge=-MAX_SHIFT, le=MAX_SHIFT)]
_Sigma = Annotated[float, Field(ge=0, le=1)]


class PictureGeometryEdit(BaseModel):
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


class StationCalibrationSourceEdit(BaseModel):
    """Choose which calibration of a static camera counts."""

    model_config = ConfigDict(
        extra="forbid", json_schema_extra={"examples": [{"calibration": "lines"}]}
    )

    calibration: CalibrationChoice


class NeighbourFrame(BaseModel):
    """A frame of the same camera just before or after that of a view."""

    offset: int = Field(description="Frames later; below zero: before.")
    label: str
    image: str = Field(description="Address of the frame.")


class NeighbourFrameList(ListDocument[NeighbourFrame]):
    """The frames around a view's, in their order; `sentence` says why there are none."""

    sentence: str | None

    @staticmethod
    def of(view: int, offsets: Sequence[int], why_none: str) -> NeighbourFrameList:
        """The document for a view and the offsets that there are."""
        items = [
            NeighbourFrame(
                offset=offset,
                label=describe_frame_offset(offset),
                image=f"{url_of_image(view)}?offset={offset}",
            )
            for offset in offsets
        ]
        return NeighbourFrameList(items=items, sentence=None if items else why_none)


def describe_frame_offset(offset: int) -> str:
    """``1 frame later``, ``3 frames before``."""
    return f"{plural(abs(offset), 'frame')} {'later' if offset > 0 else 'before'}"
