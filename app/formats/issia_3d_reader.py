"""ISSIA-3D as released, read: the ball centres of ISSIA-3D.csv, and issia_calibration.json."""

from __future__ import annotations

import re
from collections.abc import Mapping
from pathlib import PurePosixPath

from app.errors import DatasetFormatError
from app.formats import fields
from app.formats.csv_text import is_missing, read_rows
from app.formats.file_tree import DEFAULT_LIMITS, FileTree, Limits, Root
from app.formats.issia import TABLE_3D
from app.formats.issia_reader import (
    IssiaFolder,
    IssiaOptions,
    add_stations_and_media,
    count_annotations,
)
from app.formats.report import Report
from app.formats.trees import opened_tree
from app.formats.viper_reader import ViperTrack
from app.soccer.frames import ImagePoint

_AXES = re.compile(r"x_cam(\d{1,3})", re.ASCII)
_AXIS = re.compile(r"([xy])_cam(\d{1,3})", re.ASCII)


def open_issia_3d(
    folder: Root, options: IssiaOptions, report: Report, limits: Limits = DEFAULT_LIMITS
) -> IssiaFolder:
    """Read a folder (or zip, or the table alone) as if it were ISSIA's own ground truth.

    A camera annotates the ball of a frame where the table has both its coordinates. 3D points
    and errors are computed and not read; people and several balls of a view have no place in
    the table. Numbers of frames are those of the videos: ``options.frame_offset`` is not used.
    """
    found = IssiaFolder()
    with opened_tree(folder, report, limits) as tree:
        if tree is None:
            return found
        names = tree.names()
        tables = [name for name in names if PurePosixPath(name).name == TABLE_3D]
        if not tables:
            report.note(str(folder), None, None, f"holds no {TABLE_3D}")
        for name in tables[1:]:
            report.note(
                tree.shown(name), None, None, f"is a second {TABLE_3D}; {tables[0]} is used"
            )
        for name in tables[:1]:
            _read_table(tree, name, found, report, limits)
        add_stations_and_media(found, tree, names, options, report, limits)
    count_annotations(found, report)
    return found


def _read_table(
    tree: FileTree, name: str, found: IssiaFolder, report: Report, limits: Limits
) -> None:
    shown, seen = tree.shown(name), set[int]()
    try:
        for line, cells in read_rows(tree.read_bytes(name), shown, ("frame",), limits):
            record = f"line {line}"
            try:
                frame = _parse_frame_number(cells)
            except ValueError as error:
                report.note(shown, record, "frame", str(error))
                continue
            if frame in seen:
                report.note(shown, record, "frame", f"is a second row of frame {frame}")
                continue
            if not seen:
                _report_unpaired_columns(cells, shown, report)
            seen.add(frame)
            _read_ball_centers(
                cells, frame, found, DatasetFormatError(shown, record, None, ""), report
            )
    except DatasetFormatError as error:
        report.skip(error)


def _report_unpaired_columns(columns: Mapping[str, str], shown: str, report: Report) -> None:
    """Name each column of x without one of y, or the other way round: nothing is read of it."""
    there = {(found[1], found[2]) for name in columns if (found := _AXIS.fullmatch(name))}
    for axis, camera in sorted(there):
        other = "y" if axis == "x" else "x"
        if (other, camera) not in there:
            problem = f"has no column {other}_cam{camera} beside it; left out"
            report.note(shown, None, f"{axis}_cam{camera}", problem)


def _parse_frame_number(cells: Mapping[str, str]) -> int:
    frame = fields.whole_number(cells.get("frame", ""))
    if abs(frame) >= 10**9:
        raise ValueError("is too large for a frame number")
    return frame


def _read_ball_centers(
    cells: Mapping[str, str],
    frame: int,
    found: IssiaFolder,
    place: DatasetFormatError,
    report: Report,
) -> None:
    """The ball centres of one row; ``place`` is where it stands."""
    for name in cells:
        axis = _AXES.fullmatch(name)
        if axis is None:
            continue
        try:
            point = _parse_ball_center(cells, axis[1])
        except ValueError as error:
            report.note(place.path, place.record, f"cam{axis[1]}", f"{error}; left out")
            continue
        if point is not None:
            track = found.tracks.setdefault(int(axis[1]), ViperTrack())
            track.balls.setdefault(frame, []).append(point)


def _parse_ball_center(cells: Mapping[str, str], camera: str) -> ImagePoint | None:
    x, y = cells.get(f"x_cam{camera}"), cells.get(f"y_cam{camera}")
    if x is None or y is None or (is_missing(x) and is_missing(y)):
        return None
    return ImagePoint(fields.pixel_coordinate(x), fields.pixel_coordinate(y))
