"""Edits to JSON and back, for the log; and how many points an edit may have."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from app.db.json_columns import Json
from app.errors import TooManyPointsError
from app.features.groups.edit import (
    CompositeEdit,
    Edit,
    LineChanges,
    SetBallNoise,
    SetBalls,
    SetCalibrationSource,
    SetCameraPositions,
    SetLines,
    SetPaintReadings,
    SetPictureGeometry,
    SetPitch,
    SetStationCalibrationSource,
    SetStationCamera,
    SetStationLines,
    SetViewInclusion,
    StationEdit,
)
from app.soccer.annotation import Lines
from app.soccer.codec import (
    ball_from_json,
    ball_to_json,
    camera_from_json,
    camera_to_json,
    covariance_from_json,
    covariance_to_json,
    paint_digests_to_json,
    picture_geometry_from_json,
    picture_geometry_to_json,
    positions_from_json,
    positions_to_json,
)
from app.soccer.frames import ImagePoint
from app.soccer.group import Group


def edit_and_inverse_to_json(edit: Edit | StationEdit, inverse: Edit | StationEdit) -> Json:
    """An edit with the one that takes it back, as entries of the log have them."""
    return {"edit": edit_to_json(edit), "inverse": edit_to_json(inverse)}


def edit_to_json(edit: Edit | StationEdit) -> Json:
    """An edit with its name under ``edit``."""
    match edit:
        case SetLines(view, lines, proposed, not_visible):
            fields = _lines_to_json(lines, proposed, not_visible)
            return {"edit": "set_lines", "view": view, **fields}
        case SetBalls(view, balls, noise):
            fields = {"balls": [*map(ball_to_json, balls)], **_noise_to_json(noise)}
            return {"edit": "set_balls", "view": view, **fields}
        case SetViewInclusion(view, included, reason, note):
            why = {} if reason is None else {"reason": reason, "note": note}
            return {"edit": "include_view", "view": view, "included": included, **why}
        case SetCalibrationSource(view, calibration):
            return {"edit": "set_calibration", "view": view, "calibration": calibration}
        case SetPictureGeometry(view, picture):
            return {
                "edit": "set_picture",
                "view": view,
                "picture": picture_geometry_to_json(picture),
            }
        case SetPitch(length, width):
            return {"edit": "set_pitch", "length": float(length), "width": float(width)}
        case SetCameraPositions(positions):
            return {"edit": "set_positions", "positions": positions_to_json(positions)}
        case SetBallNoise(noise):
            return {"edit": "set_noise", "noise": {view: float(of) for view, of in noise.items()}}
        case CompositeEdit(edits):
            return {"edit": "several", "edits": [*map(edit_to_json, edits)]}
        case SetPaintReadings(paint):
            return {"edit": "set_paint", "paint": paint_digests_to_json(paint)}
        case _:
            return _station_edit_to_json(edit)


def _station_edit_to_json(edit: Edit | StationEdit) -> Json:
    match edit:
        case SetStationLines(lines, proposed, not_visible):
            return {"edit": "set_station_lines", **_lines_to_json(lines, proposed, not_visible)}
        case SetStationCalibrationSource(calibration):
            return {"edit": "set_station_calibration", "calibration": calibration}
        case SetStationCamera(given, covariance, calibration):
            return {
                "edit": "set_station_camera",
                "given": None if given is None else camera_to_json(given),
                "covariance": covariance_to_json(covariance),
                "calibration": calibration,
            }
    raise TypeError(f"no codec for {type(edit).__name__}")


def edit_from_json(value: Mapping[str, Any]) -> Edit:
    """Back from ``edit_to_json``, for edits of a group."""
    match value["edit"]:
        case "set_lines":
            return SetLines(
                value["view"], _lines_from_json(value["lines"]), *_parse_line_sources(value)
            )
        case "set_balls":
            balls = tuple(map(ball_from_json, value["balls"]))
            return SetBalls(value["view"], balls, float(value.get("noise", 1.0)))
        case "include_view":
            why = value.get("reason"), value.get("note")
            return SetViewInclusion(value["view"], value["included"], *why)
        case "set_calibration":
            return SetCalibrationSource(value["view"], value["calibration"])
        case "set_picture":
            return SetPictureGeometry(value["view"], picture_geometry_from_json(value["picture"]))
        case "set_pitch":
            return SetPitch(value["length"], value["width"])
        case "set_positions":
            return SetCameraPositions(positions_from_json(value["positions"]))
        case "set_noise":
            return SetBallNoise(value["noise"])
        case "several":
            return CompositeEdit(tuple(map(edit_from_json, value["edits"])))
    raise ValueError(f"the log holds an unknown edit: {value['edit']}")


def station_edit_from_json(value: Mapping[str, Any]) -> StationEdit:
    """Back from ``edit_to_json``, for edits of a station."""
    match value["edit"]:
        case "set_station_lines":
            return SetStationLines(_lines_from_json(value["lines"]), *_parse_line_sources(value))
        case "set_station_calibration":
            return SetStationCalibrationSource(value["calibration"])
        case "set_station_camera":
            given = value["given"]
            return SetStationCamera(
                None if given is None else camera_from_json(given),
                covariance_from_json(value["covariance"]),
                value["calibration"],
            )
    raise ValueError(f"the log holds an unknown edit: {value['edit']}")


def _noise_to_json(noise: float) -> Json:
    """Only where there is something to say, as of ``_lines_to_json``."""
    return {} if noise == 1 else {"noise": float(noise)}


def _parse_line_sources(value: Mapping[str, Any]) -> tuple[tuple[str, ...], tuple[str, ...]]:
    """The markings that were proposed, and those that are not visible."""
    sources = value.get("source", {})
    proposed, not_visible = (
        tuple(name for name, source in sources.items() if source == wanted)
        for wanted in ("proposed", "not_visible")
    )
    return proposed, not_visible


def _lines_to_json(
    lines: LineChanges, proposed: tuple[str, ...], not_visible: tuple[str, ...]
) -> Json:
    """Lines, and where they come from, or why there are none, only where there is something to say:
    all other entries are as ever."""
    points_of = {
        marking: None if points is None else [[float(x), float(y)] for x, y in points]
        for marking, points in lines.items()
    }
    sources = dict.fromkeys(proposed, "proposed") | dict.fromkeys(not_visible, "not_visible")
    return {"lines": points_of, **({"source": sources} if sources else {})}


def _lines_from_json(value: Mapping[str, Any]) -> LineChanges:
    return {
        marking: None if points is None else tuple(ImagePoint(x, y) for x, y in points)
        for marking, points in value.items()
    }


MARKING_POINTS = 100
"""Of one marking in one view; the densest of the public datasets has 38."""
VIEW_POINTS = 500
"""Of all markings in one view; the public datasets have at most 85."""
REQUEST_POINTS = 2000
"""Of all lines that one request brings."""


def require_point_limits(view: str, lines: Lines, changes: LineChanges) -> None:
    """Refuse new points where a view or a marking of it would have too many.

    Args:
        view: What people call the view or camera.
        lines: As they are.
        changes: What is to become of them.

    Raises:
        TooManyPointsError: With view, marking, count and limit.
    """
    counts = {marking: len(points) for marking, points in lines.items()}
    before = sum(counts.values())
    for marking, points in changes.items():
        count = len(points or ())
        if count > max(MARKING_POINTS, counts.get(marking, 0)):
            raise _too_many_points_error(f"{view}: {marking} has {count} points", MARKING_POINTS)
        counts[marking] = count
    after = sum(counts.values())
    if after > max(VIEW_POINTS, before):
        names = ", ".join(changes)
        raise _too_many_points_error(
            f"{view}: with {names} its lines have {after} points", VIEW_POINTS
        )


def require_point_limits_of_edits(group: Group, edits: Sequence[Edit]) -> None:
    """``require_point_limits`` for every edit of one request, and for the request as a whole."""
    drawn = [edit for edit in edits if isinstance(edit, SetLines)]
    for edit in drawn:
        view = group.view(edit.view)
        if view is not None:
            require_point_limits(f"view {edit.view}", view.station.lines, edit.lines)
    counts = {
        (edit.view, marking): len(points or ())
        for edit in drawn
        for marking, points in edit.lines.items()
    }
    if sum(counts.values()) > REQUEST_POINTS:
        (view_key, marking), count = max(counts.items(), key=lambda item: item[1])
        raise _too_many_points_error(
            f"the request has {sum(counts.values())} points ({count} in {marking} of view {view_key})",
            REQUEST_POINTS,
        )


def _too_many_points_error(found: str, most: int) -> TooManyPointsError:
    return TooManyPointsError(
        f"{found}; the limit is {most}", hint="Leave points out: a few on each line suffice."
    )
