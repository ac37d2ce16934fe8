"""ISSIA-3D as released: ISSIA-3D.csv and issia_calibration.json."""

from __future__ import annotations

import json
from collections.abc import Iterable, Iterator
from pathlib import Path

from app.finite import json_text
from app.formats.camera_json import camera_to_json
from app.formats.csv_text import CsvTable, Value, csv_cell, list_text
from app.formats.export_record import ExportRecord
from app.formats.issia import (
    CALIBRATION,
    TABLE_3D,
    IssiaNumberOwners,
    camera_number_of_view,
    frame_number_of_group,
)
from app.formats.view_files import SortedSpill, open_spill
from app.geometry.camera import Camera
from app.soccer.group import View
from app.soccer.solution import BallFit

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
    cameras, known = dict[int, Camera](), IssiaNumberOwners()
    with open_spill() as spill:
        for record in records:
            annotating = _views_with_ball(record)
            frame = known.claim_frame_number(record.group)
            _collect_cameras(record, cameras, known)
            if annotating:
                verdict = (record.verdict_text,) if everything else ()
                cells = [csv_cell(value) for value in (*_table_row(record, annotating), *verdict)]
                spill.add((frame, 0, "", 0), json_text(cells))
                counts["groups"] += 1
                counts["points"] += record.point is not None
                counts["balls"] += sum(map(record.has_ball_3d, annotating.values()))
        _write_table(root / TABLE_3D, spill, everything)
    _write_calibration(root, cameras)
    return counts


def _write_table(path: Path, spill: SortedSpill, everything: bool) -> None:
    with path.open("w", encoding="utf-8", newline="") as file:
        table = CsvTable(file, (*COLUMNS, *(("verdict",) if everything else ())))
        for _, cells in spill.items():
            table.add_cells(json.loads(cells))


def _views_with_ball(record: ExportRecord) -> dict[int, View]:
    """Views that annotate the ball, by camera number."""
    numbered = {camera_number_of_view(record.group, view): view for view in record.group.views}
    return {
        camera: view
        for camera, view in sorted(numbered.items())
        if view.ball is not None and view.ball.center is not None
    }


def _collect_cameras(
    record: ExportRecord, cameras: dict[int, Camera], known: IssiaNumberOwners
) -> None:
    for view in record.group.views:
        camera = record.camera(view)
        if camera is not None:
            cameras.setdefault(known.claim_camera_number(record.group, view, camera), camera)


def _table_row(record: ExportRecord, annotating: dict[int, View]) -> Iterator[Value]:
    # The published layout: a number for every camera that annotates, in a valid pair or not.
    solved = {camera: record.view_solution(view) for camera, view in annotating.items()}
    fits = {
        camera: item.ball if item is not None and record.point is not None else None
        for camera, item in solved.items()
    }
    yield frame_number_of_group(record.group)
    for camera in CAMERAS:
        yield from _ball_center(annotating.get(camera))
    yield len(annotating)
    yield list_text(record.point) if record.point else None
    yield from (_fit_value(fits.get(camera), "error_px") for camera in CAMERAS)
    yield list_text(list(annotating))
    yield from (_fit_value(fits.get(camera), "optimized_diameter_px") for camera in CAMERAS)
    yield from (_fit_value(fits.get(camera), "optimized_error_m") for camera in CAMERAS)


def _ball_center(view: View | None) -> tuple[float | None, float | None]:
    if view is None or view.ball is None or view.ball.center is None:
        return None, None
    return view.ball.center.x, view.ball.center.y


def _fit_value(fit: BallFit | None, name: str) -> float | None:
    value: float | None = getattr(fit, name) if fit is not None else None
    return value


def _write_calibration(root: Path, cameras: dict[int, Camera]) -> None:
    value = {f"cam{number}": camera_to_json(cameras[number]) for number in sorted(cameras)}
    text = json_text(value, indent=1, ascii_=True) + "\n"
    (root / CALIBRATION).write_text(text, encoding="utf-8")
