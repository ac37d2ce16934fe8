"""sn-calibration, written: lines (``7_1.json``) and cameras (``camera_7_1.json``)."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any

from app.datasets import fields
from app.datasets.archive import resolve_inside
from app.datasets.cameras_writer import placed_views, write_view_cameras
from app.datasets.exact import exact_inverse
from app.datasets.export_record import ExportRecord
from app.datasets.match_info import MatchInfoWriter, record_of
from app.datasets.sn_calibration import LARGEST_UNIT, LineFile, spelling
from app.finite import json_text
from app.soccer.annotation import Lines
from app.soccer.frames import ImagePoint, ImageSize


def lines_to_json(
    lines: Lines,
    size: ImageSize,
    others: Sequence[Mapping[str, Any]] = (),
    *,
    pixels: bool = False,
) -> dict[str, list[dict[str, float]]]:
    """One line file's object under SoccerNet's own spelling of the names.

    Normalised, or in pixels where that is asked for, or where a point lies so far outside that
    it would be taken for one. Not every pixel has a normalised number that gives it back to the
    last bit; numbers that came normalised have one.
    """
    flat = [_flat(line) for line in others]
    points = {spelling(marking): list(line) for marking, line in lines.items()}
    for line, numbers in zip(others, flat, strict=True):
        extra = [ImagePoint(x, y) for x, y in zip(numbers[::2], numbers[1::2], strict=False)]
        points.setdefault(str(line.get("class")), []).extend(extra)
    everything = [point for line in points.values() for point in line]
    # Far outside, a normalised coordinate would be read back as a pixel.
    units = not pixels and all(
        max(map(abs, size.pixel_to_unit(point))) <= LARGEST_UNIT for point in everything
    )
    return {name: [_written(p, size, units) for p in line] for name, line in points.items()}


def _written(point: ImagePoint, size: ImageSize, units: bool) -> dict[str, float]:
    if not units:
        return {"x": point.x, "y": point.y}
    x, y = size.pixel_to_unit(point)
    return {
        "x": exact_inverse(x, point.x, lambda unit: unit * (size.width - 1)),
        "y": exact_inverse(y, point.y, lambda unit: unit * (size.height - 1)),
    }


def line_file_text(
    lines: Lines,
    size: ImageSize,
    others: Sequence[Mapping[str, Any]] = (),
    *,
    pixels: bool = False,
) -> str:
    """The text of one line file."""
    return json_text(lines_to_json(lines, size, others, pixels=pixels), ascii_=True) + "\n"


def _flat(line: Mapping[str, Any]) -> list[float]:
    """Coordinates of a line that is no marking; none where they are not all numbers."""
    points = line.get("points")
    try:
        return [fields.number(item) for item in points] if isinstance(points, (list, tuple)) else []
    except ValueError:
        return []


def write_line_files(root: Path, files: Iterable[LineFile]) -> list[Path]:
    """Write ``<stem>.json`` per frame below an existing folder; the paths written.

    Raises:
        UnsafePathError: A stem that would leave the folder.
    """
    written = []
    for file in files:
        path = resolve_inside(root, f"{file.stem}.json")
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(line_file_text(file.lines, file.size, file.others), encoding="utf-8")
        written.append(path)
    return written


def write_sn_calibration(root: Path, records: Iterable[ExportRecord]) -> dict[str, int]:
    """Write ``<match>/<stem>.json`` with the lines of every view, and its camera beside it.

    ``match_info.json`` names the match of every image. Frames that came from sn-calibration go
    to the place that they came from.

    Returns:
        Counts: ``groups``, ``frames`` and ``cameras``.

    Raises:
        UnsafePathError: A key would leave ``root``.
    """
    counts = {"groups": 0, "frames": 0, "cameras": 0}
    lines_written: set[str] = set()
    cameras_written: set[str] = set()
    with MatchInfoWriter(root) as info:
        for record in records:
            counts["groups"] += 1
            for view, place in placed_views(record):
                if place not in lines_written:
                    lines, others = view.station.lines, view.extras.lines
                    write_line_files(root, [LineFile(place, view.size, lines, others)])
                    info.add(f"{place}.jpg", record_of(record.group, view))
                    lines_written.add(place)
                    counts["frames"] += 1
            counts["cameras"] += write_view_cameras(root, record, cameras_written)
    return counts
