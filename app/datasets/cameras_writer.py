"""Cameras, written: one file a view (``camera_7_1.json``)."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from pathlib import Path, PurePosixPath

from app.datasets.camera_json import camera_to_json
from app.datasets.export_record import ExportRecord
from app.datasets.frame_names import view_place
from app.datasets.view_files import PutText, put_on_disk, write_below
from app.errors import InputError
from app.finite import json_text
from app.geometry.camera import Camera


def camera_text(camera: Camera) -> str:
    """The text of one camera file."""
    return json_text(camera_to_json(camera), indent=1, ascii_=True) + "\n"


def camera_name(key: str) -> str:
    """Relative path of a camera's file: frames of the same name stay in their folders."""
    place = PurePosixPath(key)
    return str(place.with_name(f"camera_{place.name}.json"))


def write_cameras(root: Path, cameras: Mapping[str, Camera]) -> list[Path]:
    """Write ``camera_<stem>.json`` per camera below an existing folder; the paths written.

    A key with folders (``<league>/<season>/<match>/7_1``) becomes a file in those folders.

    Raises:
        UnsafePathError: A key that would leave the folder.
    """
    return [
        write_below(root, camera_name(key), camera_text(camera)) for key, camera in cameras.items()
    ]


def write_camera_files(
    root: Path, records: Iterable[ExportRecord], put: PutText | None = None
) -> dict[str, int]:
    """Write ``<match>/camera_<stem>.json`` for every view with a camera.

    A static camera that many groups share is written once.

    Args:
        root: Existing folder.
        records: Groups; one is in memory at a time.
        put: Takes the files; below ``root`` by default.

    Returns:
        Counts: ``groups`` and ``cameras``.

    Raises:
        UnsafePathError: A key would leave ``root``.
    """
    counts = {"groups": 0, "cameras": 0}
    written: dict[str, int] = {}
    put = put or put_on_disk(root)
    for record in records:
        counts["groups"] += 1
        counts["cameras"] += put_view_cameras(put, record, written)
    return counts


def put_once(put: PutText, name: str, text: str, written: dict[str, int]) -> None:
    """Write a file unless it is written, which ``written`` keeps by name.

    Raises:
        InputError: What has that name says something else.
    """
    if name not in written:
        put(name, text)
    if written.setdefault(name, hash(text)) != hash(text):
        raise InputError(f"the files of two frames would both be called {name}")


def put_view_cameras(put: PutText, record: ExportRecord, written: dict[str, int]) -> int:
    """Write the cameras of a group that are not written yet; how many that were.

    Raises:
        InputError: Those of two frames would have one name.
    """
    before = len(written)
    for view in record.group.views:
        place, camera = view_place(record.group, view), record.camera(view)
        if camera is None or (view.station.shared and camera_name(place) in written):
            continue
        put_once(put, camera_name(place), camera_text(camera), written)
    return len(written) - before
