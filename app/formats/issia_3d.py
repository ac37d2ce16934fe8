"""ISSIA-3D as released, both ways: the ball centres of ISSIA-3D.csv, and issia_calibration.json."""

from __future__ import annotations

import json
import re
from collections.abc import Iterable, Iterator, Mapping
from pathlib import Path, PurePosixPath

from app.errors import DatasetFormatError
from app.formats import fields
from app.formats.camera_json import camera_to_json
from app.formats.csv_text import (
    CsvTableWriter,
    Value,
    format_csv_cell,
    format_number_list,
    is_missing,
    read_rows,
)
from app.formats.export_record import ExportRecord
from app.formats.file_tree import DEFAULT_LIMITS, FileTree, ImportLimits, Root
from app.formats.issia import (
    CALIBRATION,
    TABLE_3D,
    IssiaNumberRegistry,
    camera_number_of_view,
    frame_number_of_group,
)
from app.formats.issia_reader import (
    IssiaFolder,
    IssiaOptions,
    add_stations_and_media,
    report_annotation_counts,
)
from app.formats.report import ReaderReport
from app.formats.trees import open_tree_context
from app.formats.view_files import SortedSpill, open_spill
from app.formats.viper_reader import ViperVideo
from app.geometry.camera import Camera
from app.json_text import json_text
from app.soccer.frames import ImagePoint
from app.soccer.group import View
from app.soccer.solution import BallFit

_AXES = re.compile(r"x_cam(\d{1,3})", re.ASCII)
_AXIS = re.compile(r"([xy])_cam(\d{1,3})", re.ASCII)


def open_issia_3d(
    folder: Root, options: IssiaOptions, report: ReaderReport, limits: ImportLimits = DEFAULT_LIMITS
) -> IssiaFolder:
    """Read a folder (or zip, or the table alone) as if it were ISSIA's own ground truth.

    A camera annotates the ball of a frame where the table has both its coordinates. 3D points
    and errors are computed and not read; people and several balls of a view have no place in
    the table. Numbers of frames are those of the videos: ``options.frame_offset`` is not used.
    """
    found = IssiaFolder()
    with open_tree_context(folder, report, limits) as tree:
        if tree is None:
            return found
        names = tree.names()
        tables = [name for name in names if PurePosixPath(name).name == TABLE_3D]
        if not tables:
            report.add_problem_at(str(folder), None, None, f"contains no {TABLE_3D}")
        for name in tables[1:]:
            report.add_problem_at(
                tree.shown(name), None, None, f"is a second {TABLE_3D}; {tables[0]} is used"
            )
        for name in tables[:1]:
            _read_table(tree, name, found, report, limits)
        add_stations_and_media(found, tree, names, options, report, limits)
    report_annotation_counts(found, report)
    return found


def _read_table(
    tree: FileTree, name: str, found: IssiaFolder, report: ReaderReport, limits: ImportLimits
) -> None:
    shown, seen = tree.shown(name), set[int]()
    try:
        for line, cells in read_rows(tree.read_bytes(name), shown, ("frame",), limits):
            record = f"line {line}"
            try:
                frame = _parse_frame_number(cells)
            except ValueError as error:
                report.add_problem_at(shown, record, "frame", str(error))
                continue
            if frame in seen:
                report.add_problem_at(shown, record, "frame", f"is a second row of frame {frame}")
                continue
            if not seen:
                _report_unpaired_columns(cells, shown, report)
            seen.add(frame)
            _read_ball_centers(
                cells, frame, found, DatasetFormatError(shown, record, None, ""), report
            )
    except DatasetFormatError as error:
        report.add_problem(error)


def _report_unpaired_columns(columns: Mapping[str, str], shown: str, report: ReaderReport) -> None:
    """Name each column of x without one of y, or the other way round: nothing is read of it."""
    there = {(found[1], found[2]) for name in columns if (found := _AXIS.fullmatch(name))}
    for axis, camera in sorted(there):
        other = "y" if axis == "x" else "x"
        if (other, camera) not in there:
            problem = f"has no column {other}_cam{camera} beside it; left out"
            report.add_problem_at(shown, None, f"{axis}_cam{camera}", problem)


def _parse_frame_number(cells: Mapping[str, str]) -> int:
    frame = fields.parse_whole_number(cells.get("frame", ""))
    if abs(frame) >= 10**9:
        raise ValueError("is too large for a frame number")
    return frame


def _read_ball_centers(
    cells: Mapping[str, str],
    frame: int,
    found: IssiaFolder,
    place: DatasetFormatError,
    report: ReaderReport,
) -> None:
    """The ball centres of one row; ``place`` is where it stands."""
    for name in cells:
        axis = _AXES.fullmatch(name)
        if axis is None:
            continue
        try:
            point = _parse_ball_center(cells, axis[1])
        except ValueError as error:
            report.add_problem_at(place.path, place.record, f"cam{axis[1]}", f"{error}; left out")
            continue
        if point is not None:
            track = found.tracks.setdefault(int(axis[1]), ViperVideo())
            track.balls.setdefault(frame, []).append(point)


def _parse_ball_center(cells: Mapping[str, str], camera: str) -> ImagePoint | None:
    x, y = cells.get(f"x_cam{camera}"), cells.get(f"y_cam{camera}")
    if x is None or y is None or (is_missing(x) and is_missing(y)):
        return None
    return ImagePoint(fields.parse_pixel_coordinate(x), fields.parse_pixel_coordinate(y))


CAMERAS = (1, 2, 3, 4, 5, 6)
COLUMNS = (
    "frame",
    *(f"{axis}_cam{camera}" for camera in CAMERAS for axis in "xy"),
    "num_cameras",
    "ball_3D",
    *(f"err_cam{camera}" for camera in CAMERAS),
    "cam_list",
    *(f"opt_d_cam{camera}" for camera in CAMERAS),
    *(f"opt_e_cam{camera}" for camera in CAMERAS),
)


def write_issia_3d(
    root: Path, records: Iterable[ExportRecord], *, everything: bool = False
) -> dict[str, int]:
    """Write both files below an existing folder.

    One row per frame in which a camera annotates the ball, by frame number. ``num_cameras`` and
    ``cam_list`` are the cameras that annotate it; ``err_*`` and ``opt_*`` stand for each of them
    once there is a 3D point. ``everything`` adds the column ``verdict``.

    Returns:
        Counts: ``groups`` (rows), ``points`` (rows with a 3D ball) and ``balls`` (views in which
        it holds, as in every format).

    Raises:
        InputError: A group is not from ISSIA, or two have one frame or differ in a camera.
    """
    counts = {"groups": 0, "points": 0, "balls": 0}
    cameras, known = dict[int, Camera](), IssiaNumberRegistry()
    with open_spill() as spill:
        for record in records:
            annotating = _find_views_with_ball(record)
            frame = known.claim_frame_number(record.group)
            _collect_cameras(record, cameras, known)
            if annotating:
                verdict = (record.verdict_text,) if everything else ()
                cells = [
                    format_csv_cell(value)
                    for value in (*_make_table_row(record, annotating), *verdict)
                ]
                spill.add((frame, 0, "", 0), json_text(cells))
                counts["groups"] += 1
                counts["points"] += record.ball_point is not None
                counts["balls"] += sum(map(record.has_ball_3d, annotating.values()))
        _write_table(root / TABLE_3D, spill, everything)
    _write_calibration(root, cameras)
    return counts


def _write_table(path: Path, spill: SortedSpill, everything: bool) -> None:
    with path.open("w", encoding="utf-8", newline="") as file:
        table = CsvTableWriter(file, (*COLUMNS, *(("verdict",) if everything else ())))
        for _, cells in spill.items():
            table.add_cells(json.loads(cells))


def _find_views_with_ball(record: ExportRecord) -> dict[int, View]:
    """Views that annotate the ball, by camera number."""
    numbered = {camera_number_of_view(record.group, view): view for view in record.group.views}
    return {
        camera: view
        for camera, view in sorted(numbered.items())
        if view.ball is not None and view.ball.center is not None
    }


def _collect_cameras(
    record: ExportRecord, cameras: dict[int, Camera], known: IssiaNumberRegistry
) -> None:
    for view in record.group.views:
        camera = record.camera(view)
        if camera is not None:
            cameras.setdefault(known.claim_camera_number(record.group, view, camera), camera)


def _make_table_row(record: ExportRecord, annotating: dict[int, View]) -> Iterator[Value]:
    # The published layout: a number for every camera that annotates, in a valid pair or not.
    solved = {camera: record.view_solution(view) for camera, view in annotating.items()}
    fits = {
        camera: item.ball if item is not None and record.ball_point is not None else None
        for camera, item in solved.items()
    }
    yield frame_number_of_group(record.group)
    for camera in CAMERAS:
        yield from _get_ball_center(annotating.get(camera))
    yield len(annotating)
    yield format_number_list(record.ball_point) if record.ball_point else None
    yield from (_get_fit_value(fits.get(camera), "error_px") for camera in CAMERAS)
    yield format_number_list(list(annotating))
    yield from (_get_fit_value(fits.get(camera), "optimized_diameter_px") for camera in CAMERAS)
    yield from (_get_fit_value(fits.get(camera), "optimized_error_m") for camera in CAMERAS)


def _get_ball_center(view: View | None) -> tuple[float | None, float | None]:
    if view is None or view.ball is None or view.ball.center is None:
        return None, None
    return view.ball.center.x, view.ball.center.y


def _get_fit_value(fit: BallFit | None, name: str) -> float | None:
    value: float | None = getattr(fit, name) if fit is not None else None
    return value


def _write_calibration(root: Path, cameras: dict[int, Camera]) -> None:
    value = {f"cam{number}": camera_to_json(cameras[number]) for number in sorted(cameras)}
    text = json_text(value, indent=1, ascii_=True) + "\n"
    (root / CALIBRATION).write_text(text, encoding="utf-8")
