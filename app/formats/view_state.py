"""What was said of one view as plain JSON values, for formats that have room for all of it.

COCO images carry it under ``touchline``, Parquet in columns: so an export can be read again and
gives the same group.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from typing import Any

from app.errors import DatasetFormatError, InputError, UnknownMarkingError, UnsafePathError
from app.formats import fields
from app.formats.camera_json import camera_from_json, camera_to_json
from app.formats.report import ReaderReport
from app.formats.safe_path import require_safe_path
from app.formats.soccernet_v3 import BALLS, GAME, IMAGE, RECORD, REST
from app.formats.split_names import read_split_name
from app.geometry.camera import validate_camera_covariance
from app.soccer.annotation import BallAnnotation, Extras, Lines, make_lines
from app.soccer.codec import (
    ball_to_json,
    covariance_to_json,
    lines_to_json,
    picture_geometry_to_json,
    view_exclusion_to_json,
)
from app.soccer.frames import MAX_SIDE, Box, ImagePoint, ImageSize
from app.soccer.group import CALIBRATIONS, Group, Station, View, ViewExclusion, make_view_exclusion
from app.soccer.picture import PictureGeometry
from app.soccer.pitch import Pitch, canonical_marking
from app.wording import plural

MAX_TEXT = 1000
"""Longest key or label, characters."""
_SHAPES: Mapping[str, type] = {IMAGE: dict, RECORD: dict, GAME: dict, REST: dict, BALLS: list}
"""Of what ``Extras.metadata`` holds under names of ours."""


@dataclass(frozen=True)
class GroupHead:
    """What a view says about its group; views of one key make one group."""

    key: str
    match: str
    split: str
    label: str
    pitch: Pitch
    views: int = 0
    """How many views the group has; 0 where that is not known."""

    def make_group(self, views: tuple[View, ...]) -> Group:
        """The group of that head."""
        return Group(self.key, views, self.match, self.pitch, self.split, self.label)


def group_head_to_json(group: Group) -> dict[str, Any]:
    """What a group is without its views."""
    return {
        "group": group.key,
        "match": group.match,
        "split": group.split,
        "label": group.label,
        "pitch": [float(group.pitch.length), float(group.pitch.width)],
        "views": len(group.views),
    }


def view_to_json(view: View) -> dict[str, Any]:
    """Everything that was said of a view but its size, its media and its extras."""
    station, given, why = view.station, view.station.given, view.left_out
    covariance = station.given_covariance
    return {
        "view": view.key,
        "included": view.included,
        **({} if why is None else {"left_out": view_exclusion_to_json(why)}),
        "station": station.key,
        "shared": station.shared,
        "flipped": station.flipped,
        "calibration": station.calibration,
        "given": None if given is None else camera_to_json(given),
        **({} if covariance is None else {"given_covariance": covariance_to_json(covariance)}),
        **(
            {}
            if station.picture is None
            else {"picture": picture_geometry_to_json(station.picture)}
        ),
        "lines": lines_to_json(station.lines_with_not_visible),
        **({"proposed": [*station.proposed]} if station.proposed else {}),
        "balls": [ball_to_json(ball) for ball in view.balls],
    }


class RecordFieldReader:
    """Reads one record's values; whatever is wrong is an error with file, record and field."""

    def __init__(self, value: Any, path: str, record: str):
        self.path, self.record = path, record
        self.value: Mapping[str, Any] = value if isinstance(value, dict) else {}
        if not isinstance(value, dict):
            raise self.make_field_error(None, "is not an object")

    def make_field_error(self, field: str | None, problem: str) -> DatasetFormatError:
        """What is wrong with a field."""
        return DatasetFormatError(self.path, self.record, field, problem)

    def read_short_text(self, name: str, default: str | None = None) -> str:
        """A short text; ``default`` where there is none."""
        found = self.value.get(name, default)
        if found is None and default is not None:
            return default
        if not isinstance(found, str) or len(found) > MAX_TEXT:
            raise self.make_field_error(
                name, "is not a text, or too long" if name in self.value else "is missing"
            )
        return found

    def read_path_safe_text(self, name: str) -> str:
        """A text that may become part of a path."""
        found = self.read_short_text(name)
        try:
            return require_safe_path(found)
        except UnsafePathError as error:
            raise self.make_field_error(name, error.message) from error

    def read_flag(self, name: str, default: bool) -> bool:
        """True or false."""
        found = self.value.get(name)
        return found if isinstance(found, bool) else default

    def read_size(self) -> ImageSize:
        """``width`` and ``height``."""
        sides = []
        for name in ("width", "height"):
            try:
                side = fields.parse_whole_number(self.value.get(name))
            except ValueError as error:
                raise self.make_field_error(name, str(error)) from error
            if not 2 <= side <= MAX_SIDE:
                raise self.make_field_error(name, f"is {side} pixels, not 2 to {MAX_SIDE:,}")
            sides.append(side)
        return ImageSize(*sides)

    def read_group_head(self) -> GroupHead:
        """Back from ``group_head_to_json``."""
        try:
            length, width = fields.parse_numbers(self.value.get("pitch") or [105.0, 68.0], 2)
            pitch = Pitch(length, width)
        except (ValueError, InputError) as error:
            raise self.make_field_error("pitch", str(error)) from error
        match = self.read_short_text("match", "")
        return GroupHead(
            self.read_path_safe_text("group"),
            self.read_path_safe_text("match") if match else "",
            self.read_short_text("split", ""),
            self.read_short_text("label", ""),
            pitch,
            self.read_count("views"),
        )

    def read_count(self, name: str) -> int:
        """A whole number from 0; 0 where there is none."""
        try:
            return max(fields.parse_whole_number(self.value.get(name) or 0), 0)
        except ValueError as error:
            raise self.make_field_error(name, str(error)) from error

    def read_view(self, size: ImageSize, extras: Extras) -> View:
        """Back from ``view_to_json``."""
        key = self.read_path_safe_text("view")
        calibration = self.read_short_text("calibration", "given")
        if calibration not in CALIBRATIONS:
            raise self.make_field_error("calibration", f"must be one of {', '.join(CALIBRATIONS)}")
        given, (lines, not_visible) = self.value.get("given"), self.read_lines()
        station = Station(
            key=self.read_path_safe_text("station"),
            size=size,
            shared=self.read_flag("shared", False),
            lines=lines,
            calibration=calibration,
            flipped=self.read_flag("flipped", False),
            picture=self.read_picture_geometry(),
            proposed=self.read_proposed_lines(lines),
            not_visible=not_visible,
        )
        camera = None if given is None else camera_from_json(given, self.path, self.record)
        try:
            station = station.with_given_camera(camera, self.read_covariance())
        except InputError as error:
            raise self.make_field_error("given_covariance", error.message) from error
        included = self.read_flag("included", True)
        why = None if included else self.read_view_exclusion()
        return View(key, station, self.read_balls(), None, included, extras, why)

    def read_covariance(self) -> tuple[float, ...] | None:
        """What is known of the given camera, 64 numbers row by row; None where nothing is."""
        found = self.value.get("given_covariance")
        if found is None:
            return None
        try:
            if self.value.get("given") is None:
                raise ValueError(
                    "is the covariance of a given camera, but the view has none: add `given`, or"
                    " leave the covariance out"
                )
            return validate_camera_covariance(fields.parse_numbers(found, 64))
        except ValueError as error:
            raise self.make_field_error("given_covariance", str(error)) from error

    def read_picture_geometry(self) -> PictureGeometry | None:
        """What was done to the picture since it was taken; None where nothing was."""
        found = self.value.get("picture")
        if found is None:
            return None
        try:
            value = fields.require_object(found)
            aspect = fields.parse_numbers([value.get("aspect")], 1)[0]
            right, down = fields.parse_numbers(value.get("shift"), 2)
            sigma = fields.parse_numbers(value.get("sigma"), 3)
            return PictureGeometry(aspect, (right, down), (sigma[0], sigma[1], sigma[2]))
        except (ValueError, InputError) as error:
            raise self.make_field_error("picture", str(error)) from error

    def read_view_exclusion(self) -> ViewExclusion | None:
        """Why a view was left out: ``{"reason": ..., "note": ...}``; None where nobody said."""
        found = self.value.get("left_out")
        if found is None:
            return None
        try:
            value = fields.require_object(found)
            reason, note = value.get("reason"), value.get("note")
            if not isinstance(reason, str) or not isinstance(note, str | None):
                raise ValueError("needs a reason, and a note that is a text or null")
            return make_view_exclusion(reason, note)
        except (ValueError, InputError) as error:
            raise self.make_field_error("left_out", str(error)) from error

    def read_lines(self) -> tuple[Lines, tuple[str, ...]]:
        """Back from ``lines_to_json``: the lines, and what is said not to be visible."""
        lines = {}
        try:
            for name, points in fields.require_object(self.value.get("lines") or {}).items():
                lines[canonical_marking(name)] = [
                    self._read_point(p) for p in fields.require_list(points)
                ]
        except UnknownMarkingError as error:
            raise self.make_field_error("lines", error.message) from error
        except ValueError as error:
            raise self.make_field_error("lines", str(error)) from error
        return make_lines(lines), tuple(sorted(name for name in lines if not lines[name]))

    def read_proposed_lines(self, lines: Lines) -> tuple[str, ...]:
        """Names of the lines that were accepted as they were proposed."""
        try:
            found = set(fields.require_list(self.value.get("proposed") or []))
        except (TypeError, ValueError) as error:
            raise self.make_field_error("proposed", "is not a list of markings") from error
        return tuple(name for name in lines if name in found)

    def read_balls(self) -> tuple[BallAnnotation, ...]:
        """Back from ``ball_to_json``."""
        try:
            values = fields.require_list(self.value.get("balls") or [])
            return tuple(self._read_ball(fields.require_object(item)) for item in values)
        except ValueError as error:
            raise self.make_field_error("balls", str(error)) from error

    def _read_ball(self, value: Mapping[str, Any]) -> BallAnnotation:
        box, point = value.get("box"), value.get("point")
        out_of_view = value.get("out_of_view") is True
        if (box is None) == (point is None) and not out_of_view:
            raise ValueError("has a ball with both a box and a point, or with neither")
        return BallAnnotation(
            box=None if box is None else self.parse_box(box),
            point=None if point is None else self._read_point(point),
            occluded=value.get("occluded") is True,
            out_of_view=out_of_view,
            predicted_by=str(value.get("predicted_by") or ""),
            inferred=value.get("inferred") is True,
        )

    @staticmethod
    def parse_box(value: Any) -> Box:
        """``[x, y, w, h]``, pixels.

        Raises:
            ValueError: Anything else, or a box without area.
        """
        x, y, width, height = (
            fields.parse_pixel_coordinate(item) for item in fields.parse_numbers(value, 4)
        )
        if width <= 0 or height <= 0:
            raise ValueError("has a box without area")
        return Box(x, y, width, height)

    @staticmethod
    def _read_point(value: Any) -> ImagePoint:
        x, y = (fields.parse_pixel_coordinate(item) for item in fields.parse_numbers(value, 2))
        return ImagePoint(x, y)


def extras_from_json(value: Any) -> Extras:
    """Back from ``Extras.to_plain_values``; what is none of it is left out."""
    if not isinstance(value, dict):
        return Extras()
    boxes, lines = (
        tuple(item for item in _list_or_empty(value.get(name)) if isinstance(item, dict))
        for name in ("boxes", "lines")
    )
    return Extras(boxes, lines, _read_metadata(value.get("metadata")))


def _read_metadata(value: Any) -> dict[str, Any]:
    """What a source said of an image; what has a name of ours and another shape is left out."""
    if not isinstance(value, dict):
        return {}
    fit: dict[str, Any] = {
        name: item for name, item in value.items() if isinstance(item, _SHAPES.get(name, object))
    }
    if BALLS in fit:
        fit[BALLS] = [item if isinstance(item, dict) else {} for item in fit[BALLS]]
    return fit


def _list_or_empty(value: Any) -> list[Any]:
    return value if isinstance(value, list) else []


@dataclass(frozen=True)
class ViewWithGroupHead:
    """A view, its place in its group, and its group's head."""

    head: GroupHead
    position: int
    view: View


class GroupAssembler:
    """Puts together views whose group has one key.

    A group is ready when it has as many views as it says; views of static cameras may lie in
    several files. Stations of one key become one, so that a thousand groups share it.
    """

    def __init__(self, report: ReaderReport):
        self._report = report
        self._waiting: dict[str, list[ViewWithGroupHead]] = {}
        self._shared: dict[str, Station] = {}
        self._done: set[str] = set()
        """Groups that were ready: whatever comes of them afterwards comes twice."""

    def add(self, item: ViewWithGroupHead, path: str) -> Iterator[Group]:
        """The group that this view completes, if it does; ``path`` is the file that it comes from."""
        key = item.head.key
        waiting = [] if key in self._done else self._waiting.setdefault(key, [])
        if key in self._done or any(other.view.key == item.view.key for other in waiting):
            self._report.add_problem_at(
                path, key, item.view.key, "comes twice; the first one counts"
            )
            return
        waiting.append(item)
        if len(waiting) == item.head.views:
            self._done.add(key)
            yield self._make_group(self._waiting.pop(key))

    def release_incomplete_groups(self) -> Iterator[Group]:
        """Groups that have fewer views than they say, as they are, which is said."""
        lacking = [
            f"{key} ({len(items)} of {items[0].head.views})"
            for key, items in self._waiting.items()
            if items[0].head.views > len(items)
        ]
        if lacking:
            count = plural(len(lacking), "group has", "groups have")
            shown = ", ".join(lacking[:5]) + (", ..." if len(lacking) > 5 else "")
            self._report.add_remark(f"{count} fewer views than when it was written: {shown}")
        for key in list(self._waiting):
            yield self._make_group(self._waiting.pop(key))

    def _make_group(self, items: list[ViewWithGroupHead]) -> Group:
        self._report.imported += len(items)
        items.sort(key=lambda item: item.position)
        head = items[0].head
        head = replace(head, split=read_split_name(head.split, self._report))
        return head.make_group(tuple(self._with_shared_station(item.view) for item in items))

    def _with_shared_station(self, view: View) -> View:
        station = view.station
        if not station.shared:
            return view
        return replace(view, station=self._shared.setdefault(station.key, station))
