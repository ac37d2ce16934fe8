"""One image record of Labels-v3.json (``imageMetadata``, ``bboxes``, ``lines``) and a View."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

from app.errors import DatasetFormatError, UnknownMarkingError
from app.formats import fields
from app.formats.ball_names import is_ball
from app.formats.fields import exact_inverse
from app.formats.report import Report
from app.formats.sn_calibration import soccernet_marking_name
from app.soccer.annotation import CORNERS, BallAnnotation, Extras, Lines, make_lines
from app.soccer.frames import MAX_SIDE, Box, ImagePoint, ImageSize
from app.soccer.group import View
from app.soccer.pitch import WITHOUT_GEOMETRY, canonical_marking

BALL = "Ball"

IMAGE = "imageMetadata"
RECORD = "record"
BALLS = "balls"
GAME = "GameMetadata"
REST = "labels"
OTHERS = (RECORD, BALLS, GAME, REST)
"""What ``Extras.metadata`` holds of a view besides its imageMetadata."""

_LINKS = ("linked_replays", "linked_action")
_OURS = (IMAGE, "bboxes", "lines", *_LINKS)


@dataclass
class ImageRecord:
    """One image as annotated; ``extras`` is everything that the pipeline does not use."""

    size: ImageSize
    lines: Lines
    balls: tuple[BallAnnotation, ...]
    extras: Extras


@dataclass
class _RecordBuilder:
    """Collects one record; what is unsound is reported and kept for the way back."""

    path: str
    record: str
    report: Report
    lines: dict[str, list[ImagePoint]] = field(default_factory=dict)
    balls: list[BallAnnotation] = field(default_factory=list)
    ball_fields: list[dict[str, Any]] = field(default_factory=list)
    boxes: list[Mapping[str, Any]] = field(default_factory=list)
    other_lines: list[Mapping[str, Any]] = field(default_factory=list)

    def report_problem(self, where: str, problem: str) -> None:
        self.report.note(self.path, self.record, where, problem)


def record_from_json(value: Any, path: str, record: str, report: Report) -> ImageRecord:
    """The annotations of one image.

    Several balls are all kept. Boxes of people, null and unknown classes go to ``extras`` as they
    are in the file.

    Raises:
        DatasetFormatError: No object, or without a usable width and height.
    """
    if not isinstance(value, dict):
        raise DatasetFormatError(path, record, None, "is not an image record")
    metadata = value.get(IMAGE)
    if not isinstance(metadata, dict):
        raise DatasetFormatError(path, record, IMAGE, "is missing or not an object")
    size = _read_image_size(metadata, path, record)
    builder = _RecordBuilder(path, record, report)
    for index, item in enumerate(_read_list(value, "bboxes", builder)):
        _add_box(item, f"bboxes[{index}]", builder)
    for index, item in enumerate(_read_list(value, "lines", builder)):
        _add_line(item, f"lines[{index}]", builder)
    return ImageRecord(
        size,
        make_lines(builder.lines),
        tuple(builder.balls),
        _collect_extras(value, metadata, builder),
    )


def _collect_extras(
    value: Mapping[str, Any], metadata: Mapping[str, Any], builder: _RecordBuilder
) -> Extras:
    kept: dict[str, Any] = {IMAGE: dict(metadata)}
    rest = {name: item for name, item in value.items() if name not in _OURS}
    if rest:
        kept[RECORD] = rest
    if any(builder.ball_fields):
        kept[BALLS] = builder.ball_fields
    return Extras(tuple(builder.boxes), tuple(builder.other_lines), kept)


def _read_image_size(metadata: Mapping[str, Any], path: str, record: str) -> ImageSize:
    sides = []
    for name in ("width", "height"):
        where = f"{IMAGE}.{name}"
        if name not in metadata:
            raise DatasetFormatError(path, record, where, "is missing")
        try:
            side = fields.whole_number(metadata[name])
        except ValueError as error:
            raise DatasetFormatError(path, record, where, str(error)) from error
        if not 2 <= side <= MAX_SIDE:
            raise DatasetFormatError(
                path, record, where, f"is {side} pixels, not 2 to {MAX_SIDE:,}"
            )
        sides.append(side)
    return ImageSize(*sides)


def _read_list(value: Mapping[str, Any], name: str, builder: _RecordBuilder) -> list[Any]:
    if value.get(name) is None:
        return []
    try:
        return fields.require_list(value[name])
    except ValueError as error:
        builder.report_problem(name, str(error))
        return []


def _add_box(item: Any, where: str, builder: _RecordBuilder) -> None:
    if not isinstance(item, dict):
        builder.report_problem(where, "is not an object")
        return
    name = item.get("class")
    if name is not None and not isinstance(name, str):
        builder.report_problem(f"{where}.class", "is neither text nor null")
    if not isinstance(name, str) or not is_ball(name):
        builder.boxes.append(item)
        return
    try:
        builder.balls.append(_ball_from_box(item))
    except ValueError as error:
        builder.report_problem(f"{where}.points", str(error))
        builder.boxes.append(item)
        return
    known = ("class", "points", "occluded")
    rest = {key: value for key, value in item.items() if key not in known}
    builder.ball_fields.append({} if rest == {"ID": None} else rest)


def _ball_from_box(item: Mapping[str, Any]) -> BallAnnotation:
    """The ball of a box; corners in any order; a box without area is its centre alone."""
    points = fields.require_object(item.get("points"))
    missing = [corner for corner in CORNERS if corner not in points]
    if missing:
        raise ValueError(f"has no {missing[0]}")
    x1, y1, x2, y2 = (fields.pixel_coordinate(points[corner]) for corner in CORNERS)
    box = Box(min(x1, x2), min(y1, y2), abs(x2 - x1), abs(y2 - y1))
    occluded = item.get("occluded") is True
    if box.width == 0 or box.height == 0:
        return BallAnnotation(point=box.center, occluded=occluded)
    return BallAnnotation(box=box, occluded=occluded)


def _add_line(item: Any, where: str, builder: _RecordBuilder) -> None:
    if not isinstance(item, dict):
        builder.report_problem(where, "is not an object")
        return
    name = item.get("class")
    try:
        marking = canonical_marking(name) if isinstance(name, str) else None
        if name is not None and marking is None:
            builder.report_problem(
                f"{where}.class", "is neither text nor null; kept without geometry"
            )
        points = _pair_coordinates(item.get("points")) if marking else []
    except UnknownMarkingError as error:
        marking, points = None, []
        if error.marking.strip() not in WITHOUT_GEOMETRY:
            builder.report_problem(f"{where}.class", f"{error.message}; kept without geometry")
    except ValueError as error:
        marking, points = None, []
        builder.report_problem(f"{where}.points", f"{error}; kept without geometry")
    if marking is None:
        builder.other_lines.append(item)
    elif points:
        builder.lines.setdefault(marking, []).extend(points)


def _pair_coordinates(value: Any) -> list[ImagePoint]:
    flat = [fields.pixel_coordinate(item) for item in fields.require_list(value)]
    if len(flat) % 2:
        raise ValueError(f"has {len(flat)} numbers, which make no pairs of x and y")
    return [ImagePoint(x, y) for x, y in zip(flat[::2], flat[1::2], strict=True)]


def record_to_json(view: View, split: str = "") -> dict[str, Any]:
    """The record of a view: what the source said, with the present lines and balls."""
    kept = view.extras.metadata
    metadata = _image_metadata(kept)
    for name, side in (("width", view.size.width), ("height", view.size.height)):
        # The source's own spelling of the same number ("1280") stays.
        metadata[name] = metadata[name] if _is_same_length(metadata.get(name), side) else side
    if split:
        metadata["set"] = split
    lines = [
        {"class": soccernet_marking_name(marking), "points": [c for point in points for c in point]}
        for marking, points in view.station.lines.items()
    ]
    return {
        IMAGE: metadata,
        "bboxes": [*_balls_to_json(view), *map(dict, view.extras.boxes)],
        "lines": [*lines, *map(dict, view.extras.lines)],
        **(kept.get(RECORD) or {}),
    }


def _image_metadata(kept: Mapping[str, Any]) -> dict[str, Any]:
    """The source's imageMetadata; groups of other origin keep its fields without the envelope."""
    if IMAGE in kept:
        return dict(kept[IMAGE])
    return {name: item for name, item in kept.items() if name not in OTHERS}


def _is_same_length(value: Any, side: int) -> bool:
    try:
        return fields.whole_number(value) == side
    except ValueError:
        return False


def _balls_to_json(view: View) -> list[dict[str, Any]]:
    rest = view.extras.metadata.get(BALLS) or []
    written = []
    for index, ball in enumerate(view.balls):
        points = _ball_corners(ball)
        if points is None:
            continue
        value: dict[str, Any] = {"class": BALL, "ID": None}
        value |= rest[index] if index < len(rest) else {}
        value |= {"points": points} | ({"occluded": True} if ball.occluded else {})
        written.append(value)
    return written


def _ball_corners(ball: BallAnnotation) -> dict[str, float] | None:
    """Corners of the box; a centre alone is a box without area; None out of view."""
    if ball.out_of_view or ball.center is None:
        return None
    if ball.box is None:
        x, y = ball.center
        return {"x1": x, "y1": y, "x2": x, "y2": y}
    box = ball.box
    return {
        "x1": box.x,
        "y1": box.y,
        "x2": exact_inverse(box.x + box.width, box.width, lambda x2: x2 - box.x),
        "y2": exact_inverse(box.y + box.height, box.height, lambda y2: y2 - box.y),
    }
