"""Cameras, written: one file a view (``camera_7_1.json``)."""

from __future__ import annotations

from collections.abc import Hashable, Iterable, Mapping, Sequence
from pathlib import Path, PurePosixPath

from app.errors import InputError
from app.finite import json_text
from app.formats.camera_json import camera_to_json
from app.formats.export_record import ExportRecord
from app.formats.frame_names import fold_file_name, frame_name_claims, view_file_path
from app.formats.view_files import PutText, write_to_disk
from app.geometry.camera import Camera
from app.soccer.frames import ImageSize
from app.soccer.group import Group, View


def camera_file_text(
    camera: Camera, covariance: Sequence[float] | None = None, size: ImageSize | None = None
) -> str:
    """The text of one camera file (``camera_to_json``)."""
    return json_text(camera_to_json(camera, covariance, size), indent=1, ascii_=True) + "\n"


def camera_file_name(key: str) -> str:
    """Relative path of a camera's file: frames of the same name stay in their folders."""
    place = PurePosixPath(key)
    return str(place.with_name(f"camera_{place.name}.json"))


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
        InputError: The files of two frames would have one name.
        UnsafePathError: A key would leave ``root``.
    """
    counts = {"groups": 0, "cameras": 0}
    written: dict[str, tuple[str, ...]] = {}
    put = put or write_to_disk(root)
    for record in records:
        counts["groups"] += 1
        for view in record.group.views:
            name, camera = (
                _camera_file_of_view(record.group, record.named(view)),
                record.camera(view),
            )
            if camera is None:
                continue
            owner = camera_owner(record.group, view)
            first = written.setdefault(fold_file_name(name), owner)
            if first != owner:
                raise InputError(
                    f"the cameras of two frames ({', '.join(first)} and {', '.join(owner)})"
                    f" would both be called {name}",
                    hint="Rename one of them in the source, and import it again.",
                )
            if len(written) > counts["cameras"]:
                put(name, camera_file_text(camera, record.covariance(view), view.size))
                counts["cameras"] = len(written)
    return counts


def camera_owner(group: Group, view: View) -> tuple[str, ...]:
    """Whose camera a view has: the static camera's, or that of the view alone."""
    return (view.station.key,) if view.station.shared else (group.key, view.key)


def camera_name_claims(group: Group, view: View, split: str) -> Mapping[str, Hashable]:
    """The names of a view in an export, and whose each would be (``export_names.Claims``)."""
    camera = {_camera_file_of_view(group, view): camera_owner(group, view)}
    return {**camera, **frame_name_claims(group, view, split)}


def _camera_file_of_view(group: Group, view: View) -> str:
    return camera_file_name(view_file_path(group, view))
