"""Where an annotation of a foreign COCO file puts its object: a box, or one point.

Their pixels begin at the corner of the first pixel, ours at its centre: boxes and keypoints alike
are half a pixel less here (``corner_origin``).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from app.formats import fields
from app.formats.corner_origin import box_from_corner
from app.soccer.annotation import BallAnnotation
from app.soccer.frames import Box

CENTERS = ("center", "centre", "ball", "middle", "point")
"""Names of the keypoint that is the ball's centre, where a category has several."""
_YES = ("true", "yes", "1")


class NoPlaceError(ValueError):
    """An annotation that does not say where its object is."""

    def __init__(self, field: str, problem: str):
        super().__init__(problem)
        self.field = field
        self.problem = problem


@dataclass(frozen=True)
class Keypoint:
    """A labelled keypoint, pixels of the file."""

    x: float
    y: float
    visible: bool
    name: str


def ball_of(item: Mapping[str, Any], names: Sequence[str] = ()) -> BallAnnotation:
    """The ball of an annotation: its box; where that has no area, the point that it is at.

    Args:
        item: The annotation.
        names: Of the keypoints of its category.

    Raises:
        NoPlaceError: It has no box, keypoint or polygon that says where.
    """
    hidden, box = False, None
    try:
        box = _box(item)
    except NoPlaceError:
        # A box that cannot be read takes no keypoint along.
        if not item.get("keypoints"):
            raise
    if box is None or not (box.width and box.height):
        points = _keypoints(item.get("keypoints"), names)
        if points:
            point = _center(points)
            box, hidden = Box(point.x, point.y, 0.0, 0.0), not point.visible
    if box is None:
        box = _around_polygons(item.get("segmentation"))
    if max(box.x + box.width, box.y + box.height) <= 1 and min(box.x, box.y) >= 0:
        raise NoPlaceError("bbox", "is in fractions of the image, and COCO's are in pixels")
    ours = box_from_corner(box)
    occluded = hidden or is_occluded(item)
    if ours.width and ours.height:
        return BallAnnotation(box=ours, occluded=occluded)
    return BallAnnotation(point=ours.center, occluded=occluded)


def box_of(item: Mapping[str, Any]) -> Box:
    """The box of any other object, without area where all that is known of it is a point.

    Raises:
        NoPlaceError: It has no box, keypoint or polygon that says where.
    """
    box = _box(item)
    if box is None:
        points = _keypoints(item.get("keypoints"), ())
        corners = [(point.x, point.y) for point in points]
        box = _bounds(corners) if corners else _around_polygons(item.get("segmentation"))
    return box_from_corner(box)


def is_occluded(item: Mapping[str, Any]) -> bool:
    """Whether an annotation says that its object is hidden in part: itself, or in ``attributes``."""
    attributes = item.get("attributes")
    inside = attributes.get("occluded") if isinstance(attributes, dict) else None
    return any(
        value == 1 or (isinstance(value, str) and value.strip().lower() in _YES)
        for value in (item.get("occluded"), inside)
    )


def _box(item: Mapping[str, Any]) -> Box | None:
    """``bbox``; None where there is none."""
    value = item.get("bbox")
    if value is None or value == []:
        return None
    try:
        x, y, width, height = map(fields.pixel, fields.numbers(value, 4))
    except ValueError as error:
        raise NoPlaceError("bbox", str(error)) from error
    if width < 0 or height < 0:
        raise NoPlaceError("bbox", "has a negative width or height")
    return Box(x, y, width, height)


def _keypoints(value: Any, names: Sequence[str]) -> list[Keypoint]:
    """The keypoints that are labelled."""
    if value is None:
        return []
    try:
        flat = fields.sequence(value)
        if len(flat) % 3:
            raise ValueError(f"has {len(flat)} numbers, which are not three for each point")
        found = []
        for index in range(len(flat) // 3):
            x, y, label = flat[3 * index : 3 * index + 3]
            # 0: not annotated, whatever its numbers are; 1: annotated and hidden.
            if (seen := fields.number(label)) > 0:
                name = names[index] if index < len(names) else ""
                found.append(Keypoint(fields.pixel(x), fields.pixel(y), seen > 1, name))
    except ValueError as error:
        raise NoPlaceError("keypoints", str(error)) from error
    return found


def _center(points: Sequence[Keypoint]) -> Keypoint:
    if len(points) == 1:
        return points[0]
    named = [point for point in points if point.name.strip().lower() in CENTERS]
    if len(named) != 1:
        problem = f"has {len(points)} points, and none of them alone is called center"
        raise NoPlaceError("keypoints", problem)
    return named[0]


def _around_polygons(value: Any) -> Box:
    if isinstance(value, dict):
        problem = "is missing, and the segmentation is a mask (RLE), which is not read"
        raise NoPlaceError("bbox", problem)
    if not isinstance(value, list) or not value:
        raise NoPlaceError("bbox", "is missing, and so are keypoints and a segmentation")
    corners: list[tuple[float, float]] = []
    try:
        for polygon in value:
            flat = list(map(fields.pixel, fields.sequence(polygon)))
            if len(flat) % 2 or len(flat) < 6:
                raise ValueError("has a polygon of fewer than three points")
            corners += zip(flat[::2], flat[1::2], strict=True)
        box = _bounds(corners)
        if not (box.width and box.height):
            raise ValueError("has no area")
    except ValueError as error:
        raise NoPlaceError("segmentation", str(error)) from error
    return box


def _bounds(points: Sequence[tuple[float, float]]) -> Box:
    x, y = min(x for x, _ in points), min(y for _, y in points)
    return Box(x, y, max(x for x, _ in points) - x, max(y for _, y in points) - y)
