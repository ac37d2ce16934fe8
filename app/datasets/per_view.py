"""Exports with one file a view: cameras (``camera_7_1.json``) and field lines (``7_1.json``)."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from pathlib import Path, PurePosixPath

from app.datasets.camera_json import write_cameras
from app.datasets.export_record import ExportRecord
from app.datasets.match_info import MatchInfoWriter, record_of
from app.datasets.sn_calibration import IMAGE_SUFFIXES, LineFile, write_line_files
from app.soccer.group import View


def write_camera_files(root: Path, records: Iterable[ExportRecord]) -> dict[str, int]:
    """Write ``<match>/camera_<stem>.json`` for every view with a camera.

    A static camera that many groups share is written once.

    Returns:
        Counts: ``groups`` and ``cameras``.

    Raises:
        UnsafePathError: A key would leave ``root``.
    """
    counts = {"groups": 0, "cameras": 0}
    written: set[str] = set()
    for record in records:
        counts["groups"] += 1
        counts["cameras"] += _write_cameras(root, record, written)
    return counts


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
            for view, place in _places(record):
                if place not in lines_written:
                    lines, others = view.station.lines, view.extras.lines
                    write_line_files(root, [LineFile(place, view.size, lines, others)])
                    info.add(f"{place}.jpg", record_of(record.group, view))
                    lines_written.add(place)
                    counts["frames"] += 1
            counts["cameras"] += _write_cameras(root, record, cameras_written)
    return counts


def _write_cameras(root: Path, record: ExportRecord, written: set[str]) -> int:
    before = len(written)
    for view, place in _places(record):
        camera = record.camera(view)
        if camera is not None and place not in written:
            write_cameras(root, {place: camera})
            written.add(place)
    return len(written) - before


def _places(record: ExportRecord) -> Iterator[tuple[View, str]]:
    """Where the files of each view go, without prefix and ending."""
    for view in record.group.views:
        # The key of a frame that is a group alone is the place of its file.
        match = record.group.match if view.key != record.group.key else ""
        yield view, str(PurePosixPath(match) / view_stem(view.key))


def view_stem(key: str) -> str:
    """Key of a view without the ending of an image's name."""
    place = PurePosixPath(key)
    return str(place.with_suffix("")) if place.suffix.lower() in IMAGE_SUFFIXES else key
