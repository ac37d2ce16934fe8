"""Where an annotation of a foreign COCO file puts its object: a box, or one point; and of which image it is.

Their pixels begin at the corner of the first pixel, ours at its centre: boxes and keypoints alike
are half a pixel less here (``soccer.frames``).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from app.formats import fields
from app.formats.fields import IdIndex, id_to_text
from app.formats.picture_finder import split_picture_name
from app.formats.report import ReaderReport
from app.json_text import quote_text
from app.soccer.annotation import BallAnnotation
from app.soccer.frames import Box, box_from_corner_origin

Annotation = tuple[str, Mapping[str, Any]]
"""Its place in the file (``annotations[3]``), and itself."""


class AnnotationsByImage:
    """The annotations of each image.

    Args:
        images: The list ``images``.
        annotations: The list ``annotations``.
        path: The file, for problems.
        report: Takes what joins no image, and what is there twice.

    Attributes:
        of_image: Annotations of each image, in the order of the file; captions are counted alone.
        captions: Whether all annotations are captions.
    """

    def __init__(
        self, images: Sequence[Any], annotations: Sequence[Any], path: str, report: ReaderReport
    ):
        self._path, self._report = path, report
        self._ids: IdIndex[int] = IdIndex()
        self._names: dict[str, list[int]] = {}
        self.of_image: list[list[Annotation]] = [[] for _ in images]
        for index, item in enumerate(images):
            self._add_image(index, item)
        captions = shared = 0
        seen: dict[str, Mapping[str, Any]] = {}
        for index, item in enumerate(annotations):
            record = f"annotations[{index}]"
            image = self._find_image(item, record)
            if image is None:
                continue
            if isinstance(item.get("caption"), str) and "category_id" not in item:
                captions += 1
                continue
            identity = id_to_text(item.get("id"))
            other = item if identity is None else seen.setdefault(identity, item)
            if other is not item and other == item:
                self._report_problem(
                    record,
                    "id",
                    f"is {identity}, the id of an equal annotation before it; this one is left out",
                )
                continue
            shared += other is not item
            self.of_image[image].append((record, item))
        self.captions = captions > 0 and captions == len(annotations)
        if captions:
            report.counts["captions"] += captions
        if shared:
            report.add_remark(
                f"{path}: {shared:,} annotations have the id of another one; all are read"
            )

    def is_unique_image_name(self, name: str) -> bool:
        """Whether one image alone has a name, as the last part of its own."""
        return len(self._names.get(name, [])) == 1

    def _report_problem(self, record: str, field: str | None, problem: str) -> None:
        self._report.add_problem_at(self._path, record, field, problem)

    def _add_image(self, index: int, item: Any) -> None:
        if not isinstance(item, dict):
            return
        if parts := _split_image_name(item.get("file_name")):
            self._names.setdefault(parts[-1], []).append(index)
        value = item.get("id")
        if not self._ids.add(value, index):
            known = id_to_text(value) is not None
            problem = (
                f"is {quote_value(value)}, which is also the id of another image"
                if known
                else "is missing"
            )
            self._report_problem(
                f"images[{index}]", "id", f"{problem}; no annotations are assigned to this image"
            )

    def _find_image(self, item: Any, record: str) -> int | None:
        """The image of an annotation, by its id or else by its name; None is reported."""
        if not isinstance(item, dict):
            self._report_problem(record, None, "is not an object; left out")
            return None
        if "image_id" not in item:
            self._report_problem(record, "image_id", "is missing; left out")
            return None
        value = item["image_id"]
        image = self._ids.find(value)
        if (
            image is None
            and (parts := _split_image_name(value))
            and self.is_unique_image_name(parts[-1])
        ):
            return self._names[parts[-1]][0]
        if image is None:
            self._report.counts["annotations without image"] += 1
            problem = f"is {quote_value(value)}, which no image of the file has; left out"
            self._report_problem(record, "image_id", problem)
        return image


def quote_value(value: Any) -> str:
    """A value as the file spells it, no longer than a sentence can take."""
    if isinstance(value, str):
        return quote_text(value, 40)
    return "null" if value is None else str(value)[:40]


def _split_image_name(name: Any) -> tuple[str, ...]:
    return split_picture_name(name) if isinstance(name, str) else ()


CENTERS = ("center", "centre", "ball", "middle", "point")
"""Names of the keypoint that is the ball's centre, where a category has several."""
_YES = ("true", "yes", "1")


class MissingPositionError(ValueError):
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


def ball_from_annotation(item: Mapping[str, Any], names: Sequence[str] = ()) -> BallAnnotation:
    """The ball of an annotation: its box; where that has no area, the point that it is at.

    Args:
        item: The annotation.
        names: Of the keypoints of its category.

    Raises:
        NoPlaceError: It has no box, keypoint or polygon that says where.
    """
    hidden, box = False, None
    try:
        box = _read_bbox(item)
    except MissingPositionError:
        # A box that cannot be read takes no keypoint along.
        if not item.get("keypoints"):
            raise
    if box is None or not (box.width and box.height):
        points = _read_labelled_keypoints(item.get("keypoints"), names)
        if points:
            point = _choose_center_keypoint(points)
            box, hidden = Box(point.x, point.y, 0.0, 0.0), not point.visible
    if box is None:
        box = _box_around_polygons(item.get("segmentation"))
    if max(box.x + box.width, box.y + box.height) <= 1 and min(box.x, box.y) >= 0:
        raise MissingPositionError("bbox", "is in fractions of the image, and COCO's are in pixels")
    ours = box_from_corner_origin(box)
    occluded = hidden or is_occluded(item)
    if ours.width and ours.height:
        return BallAnnotation(box=ours, occluded=occluded)
    return BallAnnotation(point=ours.center, occluded=occluded)


def box_from_annotation(item: Mapping[str, Any]) -> Box:
    """The box of any other object, without area where all that is known of it is a point.

    Raises:
        NoPlaceError: It has no box, keypoint or polygon that says where.
    """
    box = _read_bbox(item)
    if box is None:
        points = _read_labelled_keypoints(item.get("keypoints"), ())
        corners = [(point.x, point.y) for point in points]
        box = _bounding_box(corners) if corners else _box_around_polygons(item.get("segmentation"))
    return box_from_corner_origin(box)


def is_occluded(item: Mapping[str, Any]) -> bool:
    """Whether an annotation says that its object is hidden in part: itself, or in ``attributes``."""
    attributes = item.get("attributes")
    inside = attributes.get("occluded") if isinstance(attributes, dict) else None
    return any(
        value == 1 or (isinstance(value, str) and value.strip().lower() in _YES)
        for value in (item.get("occluded"), inside)
    )


def _read_bbox(item: Mapping[str, Any]) -> Box | None:
    """``bbox``; None where there is none."""
    value = item.get("bbox")
    if value is None or value == []:
        return None
    try:
        x, y, width, height = map(fields.parse_pixel_coordinate, fields.parse_numbers(value, 4))
    except ValueError as error:
        raise MissingPositionError("bbox", str(error)) from error
    if width < 0 or height < 0:
        raise MissingPositionError("bbox", "has a negative width or height")
    return Box(x, y, width, height)


def _read_labelled_keypoints(value: Any, names: Sequence[str]) -> list[Keypoint]:
    """The keypoints that are labelled."""
    if value is None:
        return []
    try:
        flat = fields.require_list(value)
        if len(flat) % 3:
            raise ValueError(f"has {len(flat)} numbers, which are not three for each point")
        found = []
        for index in range(len(flat) // 3):
            x, y, label = flat[3 * index : 3 * index + 3]
            # 0: not annotated, whatever its numbers are; 1: annotated and hidden.
            if (seen := fields.parse_number(label)) > 0:
                name = names[index] if index < len(names) else ""
                found.append(
                    Keypoint(
                        fields.parse_pixel_coordinate(x),
                        fields.parse_pixel_coordinate(y),
                        seen > 1,
                        name,
                    )
                )
    except ValueError as error:
        raise MissingPositionError("keypoints", str(error)) from error
    return found


def _choose_center_keypoint(points: Sequence[Keypoint]) -> Keypoint:
    if len(points) == 1:
        return points[0]
    named = [point for point in points if point.name.strip().lower() in CENTERS]
    if len(named) != 1:
        problem = f"has {len(points)} points, and none of them alone is called center"
        raise MissingPositionError("keypoints", problem)
    return named[0]


def _box_around_polygons(value: Any) -> Box:
    if isinstance(value, dict):
        problem = "is missing, and the segmentation is a mask (RLE), which is not read"
        raise MissingPositionError("bbox", problem)
    if not isinstance(value, list) or not value:
        raise MissingPositionError("bbox", "is missing, and so are keypoints and a segmentation")
    corners: list[tuple[float, float]] = []
    try:
        for polygon in value:
            flat = list(map(fields.parse_pixel_coordinate, fields.require_list(polygon)))
            if len(flat) % 2 or len(flat) < 6:
                raise ValueError("has a polygon of fewer than three points")
            corners += zip(flat[::2], flat[1::2], strict=True)
        box = _bounding_box(corners)
        if not (box.width and box.height):
            raise ValueError("has no area")
    except ValueError as error:
        raise MissingPositionError("segmentation", str(error)) from error
    return box


def _bounding_box(points: Sequence[tuple[float, float]]) -> Box:
    x, y = min(x for x, _ in points), min(y for _, y in points)
    return Box(x, y, max(x for x, _ in points) - x, max(y for _, y in points) - y)
