"""Exports with one file a view: cameras (``camera_7_1.json``) and field lines (``7_1.json``)."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from pathlib import Path, PurePosixPath

from app.datasets.archive import resolve_inside
from app.datasets.camera_json import camera_text
from app.datasets.export_record import ExportRecord
from app.datasets.sn_calibration import IMAGE_SUFFIXES, line_file_text
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
        for view, name in _new_views(record, "camera_", written):
            camera = record.camera(view)
            if camera is not None:
                _write(root, name, camera_text(camera))
                counts["cameras"] += 1
                written.add(name)
    return counts


def write_sn_calibration(root: Path, records: Iterable[ExportRecord]) -> dict[str, int]:
    """Write ``<match>/<stem>.json`` with the lines of every view, and its camera beside it.

    Returns:
        Counts: ``groups``, ``frames`` and ``cameras``.

    Raises:
        UnsafePathError: A key would leave ``root``.
    """
    counts = {"groups": 0, "frames": 0, "cameras": 0}
    lines_written: set[str] = set()
    cameras_written: set[str] = set()
    for record in records:
        counts["groups"] += 1
        for view, name in _new_views(record, "", lines_written):
            _write(root, name, line_file_text(view.station.lines, view.size, view.extras.lines))
            lines_written.add(name)
            counts["frames"] += 1
        for view, name in _new_views(record, "camera_", cameras_written):
            camera = record.camera(view)
            if camera is not None:
                _write(root, name, camera_text(camera))
                cameras_written.add(name)
                counts["cameras"] += 1
    return counts


def _new_views(record: ExportRecord, prefix: str, written: set[str]) -> Iterator[tuple[View, str]]:
    for view in record.group.views:
        name = f"{prefix}{view_stem(view.key)}.json"
        path = f"{record.group.match}/{name}" if record.group.match else name
        if path not in written:
            yield view, path


def view_stem(key: str) -> str:
    """Key of a view without the ending of an image's name."""
    place = PurePosixPath(key)
    return str(place.with_suffix("")) if place.suffix.lower() in IMAGE_SUFFIXES else key


def _write(root: Path, name: str, text: str) -> None:
    path = resolve_inside(root, name)
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(text, encoding="utf-8")
