"""Edits to JSON and back, for the log: explicit, because what is logged must stay readable."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from app.review.editing.edit import (
    Edit,
    IncludeView,
    LineChanges,
    SetBall,
    SetBalls,
    SetCalibrationSource,
    SetLines,
    SetNoise,
    SetPaint,
    SetPicture,
    SetPitch,
    SetPositions,
    SetStationCalibration,
    SetStationCamera,
    SetStationLines,
    Several,
    StationEdit,
)
from app.soccer.frames import ImagePoint
from app.store.codecs import (
    ball_from_json,
    ball_to_json,
    camera_from_json,
    camera_to_json,
    covariance_from_json,
    covariance_to_json,
    paint_to_json,
    picture_from_json,
    picture_to_json,
    positions_from_json,
    positions_to_json,
)
from app.store.stored_json import Json


def step_to_json(edit: Edit | StationEdit, inverse: Edit | StationEdit) -> Json:
    """An edit with the one that takes it back, as entries of the log have them."""
    return {"edit": edit_to_json(edit), "inverse": edit_to_json(inverse)}


def edit_to_json(edit: Edit | StationEdit) -> Json:
    """An edit with its name under ``edit``."""
    match edit:
        case SetLines(view, lines, proposed, not_visible):
            said = {"lines": _lines_to_json(lines), **_source(proposed, not_visible)}
            return {"edit": "set_lines", "view": view, **said}
        case SetBalls(view, balls, noise):
            said = {"balls": [*map(ball_to_json, balls)], **_noise(noise)}
            return {"edit": "set_balls", "view": view, **said}
        case SetBall(view, ball, noise):
            said = {"balls": [] if ball is None else [ball_to_json(ball)], **_noise(noise)}
            return {"edit": "set_balls", "view": view, **said}
        case IncludeView(view, included, reason, note):
            why = {} if reason is None else {"reason": reason, "note": note}
            return {"edit": "include_view", "view": view, "included": included, **why}
        case SetCalibrationSource(view, calibration):
            return {"edit": "set_calibration", "view": view, "calibration": calibration}
        case SetPicture(view, picture):
            return {"edit": "set_picture", "view": view, "picture": picture_to_json(picture)}
        case SetPitch(length, width):
            return {"edit": "set_pitch", "length": float(length), "width": float(width)}
        case SetPositions(positions):
            return {"edit": "set_positions", "positions": positions_to_json(positions)}
        case SetNoise(noise):
            return {"edit": "set_noise", "noise": {view: float(of) for view, of in noise.items()}}
        case Several(edits):
            return {"edit": "several", "edits": [*map(edit_to_json, edits)]}
        case SetPaint(paint):
            return {"edit": "set_paint", "paint": paint_to_json(paint)}
        case SetStationLines(lines, proposed, not_visible):
            said = {"lines": _lines_to_json(lines), **_source(proposed, not_visible)}
            return {"edit": "set_station_lines", **said}
        case SetStationCalibration(calibration):
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
            return SetLines(value["view"], _lines_from_json(value["lines"]), *_sources(value))
        case "set_balls":
            balls = tuple(map(ball_from_json, value["balls"]))
            return SetBalls(value["view"], balls, float(value.get("noise", 1.0)))
        case "include_view":
            why = value.get("reason"), value.get("note")
            return IncludeView(value["view"], value["included"], *why)
        case "set_calibration":
            return SetCalibrationSource(value["view"], value["calibration"])
        case "set_picture":
            return SetPicture(value["view"], picture_from_json(value["picture"]))
        case "set_pitch":
            return SetPitch(value["length"], value["width"])
        case "set_positions":
            return SetPositions(positions_from_json(value["positions"]))
        case "set_noise":
            return SetNoise(value["noise"])
        case "several":
            return Several(tuple(map(edit_from_json, value["edits"])))
    raise ValueError(f"the log holds an unknown edit: {value['edit']}")


def station_edit_from_json(value: Mapping[str, Any]) -> StationEdit:
    """Back from ``edit_to_json``, for edits of a station."""
    match value["edit"]:
        case "set_station_lines":
            return SetStationLines(_lines_from_json(value["lines"]), *_sources(value))
        case "set_station_calibration":
            return SetStationCalibration(value["calibration"])
        case "set_station_camera":
            given = value["given"]
            return SetStationCamera(
                None if given is None else camera_from_json(given),
                covariance_from_json(value["covariance"]),
                value["calibration"],
            )
    raise ValueError(f"the log holds an unknown edit: {value['edit']}")


def _noise(noise: float) -> Json:
    """Only where there is something to say, as of ``_source``."""
    return {} if noise == 1 else {"noise": float(noise)}


def _source(proposed: tuple[str, ...], not_visible: tuple[str, ...]) -> Json:
    """Where lines come from, or why there are none, only where there is something to say: all other
    entries are as ever."""
    said = dict.fromkeys(proposed, "proposed") | dict.fromkeys(not_visible, "not_visible")
    return {"source": said} if said else {}


def _sources(value: Mapping[str, Any]) -> tuple[tuple[str, ...], tuple[str, ...]]:
    """The markings that were proposed, and those that are not visible."""
    said = value.get("source", {})
    proposed, not_visible = (
        tuple(name for name, source in said.items() if source == wanted)
        for wanted in ("proposed", "not_visible")
    )
    return proposed, not_visible


def _lines_to_json(lines: LineChanges) -> Json:
    return {
        marking: None if points is None else [[float(x), float(y)] for x, y in points]
        for marking, points in lines.items()
    }


def _lines_from_json(value: Mapping[str, Any]) -> LineChanges:
    return {
        marking: None if points is None else tuple(ImagePoint(x, y) for x, y in points)
        for marking, points in value.items()
    }
