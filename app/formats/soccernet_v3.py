"""SoccerNet-v3 and v3D: what their readers and writers share: names, the frames of one match, and one image record of
Labels-v3.json (``imageMetadata``, ``bboxes``, ``lines``) as a View and back.
"""

from __future__ import annotations

import re
from collections.abc import Collection, Mapping
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import PurePosixPath
from typing import Any

from app.errors import DatasetFormatError, UnknownMarkingError
from app.formats import fields
from app.formats.ball_names import is_ball_name
from app.formats.fields import find_exact_inverse
from app.formats.file_tree import FileTree
from app.formats.frame_names import IMAGE_SUFFIXES
from app.formats.report import ReaderReport
from app.soccer.annotation import CORNERS, BallAnnotation, Extras, Lines, make_lines
from app.soccer.frames import MAX_SIDE, Box, ImagePoint, ImageSize
from app.soccer.group import Media, View
from app.soccer.pitch import WITHOUT_GEOMETRY, canonical_marking

LABELS = "Labels-v3.json"
SPLITS = ("train", "valid", "test", "challenge")
MATCH_DEPTH = 3
"""League, season, match."""

_MATCH_NAME = re.compile(r"\d{4}-\d\d-\d\d - \d\d-\d\d (.{1,80}?) (\d{1,2}) - (\d{1,2}) (.{1,80})")
_GAME_TIME = re.compile(r"\s*(?:(\d)\s*-\s*)?(\d{1,3}:\d\d)\s*")
IMAGE_NAME = re.compile(r"(\d+)(?:_(\d+))?\.[A-Za-z]+", re.ASCII)
_HALVES = {"1": "first half", "2": "second half", "3": "extra time", "4": "extra time"}
IMAGE_LISTS = ("list_actions", "list_replays")
JOINED_LISTS = (*IMAGE_LISTS, "reconstructions")
"""Lists of image names about the whole file, made anew when it is written."""
# SoccerNet spells this one with a space at the end; its readers look it up that way.
_SPELLING = {"Goal left post left": "Goal left post left "}


def group_label(match: str, action: str, metadata: dict[str, Any]) -> str:
    """What people read: teams, score and time of play.

    Example:
        >>> name = "england_epl/2014-2015/2015-02-21 - 18-00 Chelsea 1 - 1 Burnley"
        >>> group_label(name, "7.png", {"gameTime": "1 - 12:41"})
        'Chelsea 1 – 1 Burnley · 12:41 · first half'
    """
    folder = match.rsplit("/", 1)[-1]
    found = _MATCH_NAME.fullmatch(folder)
    teams = f"{found[1]} {found[2]} – {found[3]} {found[4]}" if found else folder
    time = _GAME_TIME.fullmatch(str(metadata.get("gameTime", "")))
    if time is None:
        return f"{teams} · {PurePosixPath(action).stem}"
    half = _HALVES.get(time[1] or str(metadata.get("half", "")).removesuffix(".0"))
    return " · ".join(part for part in (teams, time[2], half) if part)


def parse_image_numbers(image: str) -> tuple[int, int | None] | None:
    """Action and replay number of an image name (``7_1.png``); None for any other name."""
    found = IMAGE_NAME.fullmatch(image)
    if found is None:
        return None
    return int(found[1]), None if found[2] is None else int(found[2])


LABELS_3D = "Labels-v3D.json"

TABLE = "SNv3D.csv"
SPLIT_FILES = {"train": "SNv3D-train.txt", "test": "SNv3D-test.txt"}


ARCHIVE = "Frames-v3.zip"
FOLDERS = ("", "v3_frames/", "Frames-v3/", "frames/")
"""Where the frames lie below the match or inside the archive, by precedence."""


class MatchFrameFinder:
    """Finds the frame of an image name.

    Args:
        tree: Folder or zip that holds the match.
        match: The match's folder in it, ``""`` or with a slash at its end.
        names: Files of that folder, relative to it.
        report: Takes one problem when the archive is damaged.
    """

    def __init__(self, tree: FileTree, match: str, names: Collection[str], report: ReaderReport):
        self._tree, self._match = tree, match
        self._loose = {name for name in names if _is_image_name(name)}
        self._members: dict[str, str] = {}
        if ARCHIVE in names:
            self._open_archive(report)

    def _open_archive(self, report: ReaderReport) -> None:
        try:
            archive = self._tree.open_nested_zip(self._match + ARCHIVE, report)
        except DatasetFormatError as error:
            problem = f"{error.problem} Its match is imported without these frames."
            report.add_problem_at(error.path, error.record, error.field, problem)
            return
        images = filter(_is_image_name, archive.names())
        self._members = {name: archive.stored_name(name) for name in images}
        archive.close()

    @property
    def has_frames(self) -> bool:
        """Whether there are frames at all."""
        return bool(self._members or self._loose)

    def find_frame(self, image: str) -> Media | None:
        """Where the frame of an image name (``7_1.png``) lies, or None."""
        for folder in FOLDERS:
            if folder + image in self._members:
                return self._tree.media_in_zip(self._match + ARCHIVE, self._members[folder + image])
        for folder in FOLDERS:
            if folder + image in self._loose:
                return self._tree.media(self._match + folder + image)
        return None

    @cached_property
    def _names_by_numbers(self) -> dict[tuple[int, int | None] | None, str]:
        names = {PurePosixPath(place).name for place in (*self._members, *self._loose)}
        return {parse_image_numbers(name): name for name in sorted(names, reverse=True)}

    def find_frame_by_numbers(self, image: str) -> Media | None:
        """The same where a table says no more of a name than its numbers: also ``0007.jpg``."""
        other = self._names_by_numbers.get(parse_image_numbers(image), image)
        return self.find_frame(image) or self.find_frame(other)


def _is_image_name(name: str) -> bool:
    return PurePosixPath(name).suffix.lower() in IMAGE_SUFFIXES


def soccernet_marking_name(marking: str) -> str:
    """A marking's name as SoccerNet files spell it."""
    return _SPELLING.get(marking, marking)


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
    report: ReaderReport
    lines: dict[str, list[ImagePoint]] = field(default_factory=dict)
    balls: list[BallAnnotation] = field(default_factory=list)
    ball_fields: list[dict[str, Any]] = field(default_factory=list)
    boxes: list[Mapping[str, Any]] = field(default_factory=list)
    other_lines: list[Mapping[str, Any]] = field(default_factory=list)

    def report_problem(self, where: str, problem: str) -> None:
        self.report.add_problem_at(self.path, self.record, where, problem)


def record_from_json(value: Any, path: str, record: str, report: ReaderReport) -> ImageRecord:
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
            side = fields.parse_whole_number(metadata[name])
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
    if not isinstance(name, str) or not is_ball_name(name):
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
    x1, y1, x2, y2 = (fields.parse_pixel_coordinate(points[corner]) for corner in CORNERS)
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
    flat = [fields.parse_pixel_coordinate(item) for item in fields.require_list(value)]
    if len(flat) % 2:
        raise ValueError(f"has {len(flat)} numbers, which make no pairs of x and y")
    return [ImagePoint(x, y) for x, y in zip(flat[::2], flat[1::2], strict=True)]


def record_to_json(view: View, split: str = "") -> dict[str, Any]:
    """The record of a view: what the source said, with the present lines and balls."""
    kept = view.extras.metadata
    metadata = _extract_image_metadata(kept)
    for name, side in (("width", view.size.width), ("height", view.size.height)):
        # The source's own spelling of the same number ("1280") stays.
        metadata[name] = metadata[name] if _equals_side_length(metadata.get(name), side) else side
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


def _extract_image_metadata(kept: Mapping[str, Any]) -> dict[str, Any]:
    """The source's imageMetadata; groups of other origin keep its fields without the envelope."""
    if IMAGE in kept:
        return dict(kept[IMAGE])
    return {name: item for name, item in kept.items() if name not in OTHERS}


def _equals_side_length(value: Any, side: int) -> bool:
    try:
        return fields.parse_whole_number(value) == side
    except ValueError:
        return False


def _balls_to_json(view: View) -> list[dict[str, Any]]:
    rest = view.extras.metadata.get(BALLS) or []
    written = []
    for index, ball in enumerate(view.balls):
        points = _ball_to_corners_json(ball)
        if points is None:
            continue
        value: dict[str, Any] = {"class": BALL, "ID": None}
        value |= rest[index] if index < len(rest) else {}
        value |= {"points": points} | ({"occluded": True} if ball.occluded else {})
        written.append(value)
    return written


def _ball_to_corners_json(ball: BallAnnotation) -> dict[str, float] | None:
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
        "x2": find_exact_inverse(box.x + box.width, box.width, lambda x2: x2 - box.x),
        "y2": find_exact_inverse(box.y + box.height, box.height, lambda y2: y2 - box.y),
    }
