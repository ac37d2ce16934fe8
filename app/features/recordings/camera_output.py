"""Cameras of a stretch as files of other tools, those that ``track`` and ``cameras`` write."""

from __future__ import annotations

import zipfile
from io import BytesIO
from pathlib import Path
from tempfile import TemporaryDirectory

from app.db.store import Store
from app.errors import ConflictError
from app.features.file_tools.camera_export import export_cameras
from app.features.file_tools.track import frame_row, write_cameras
from app.features.recordings.cameras import ShotCameras, read_cameras
from app.features.recordings.service import get_recording

MEDIA_TYPES = {
    "soccernet": "application/zip",
    "npz": "application/octet-stream",
    "opentrackio": "application/zip",
}
"""By format."""


def camera_output(store: Store, found: ShotCameras, form: str) -> tuple[str, bytes]:
    """Name and content of a file of cameras.

    Args:
        store: The database.
        found: The cameras.
        form: ``soccernet``, ``npz`` or ``opentrackio``.

    Raises:
        ConflictError: The cameras are gone, or no frame has one.
    """
    frames = read_cameras(store.settings, found.digest)
    if all(frame.camera is None for frame in frames):
        raise ConflictError("no frame of this shot has a camera")
    title = f"{get_recording(store, found.recording).name}_{found.first}-{found.last}"
    with TemporaryDirectory() as place:
        # Samples carry the name of their folder.
        folder, out = Path(place) / title, Path(place) / "out"
        write_cameras(
            folder,
            frames,
            {"frames": [frame_row(frame) for frame in frames], "pitch": found.summary.pitch},
        )
        if form == "npz":
            export_cameras(folder, out, form)
            return f"{title}.npz", out.read_bytes()
        if form == "opentrackio":
            export_cameras(folder, out, form, frames[0].size)
            folder = out
        return f"{title}-{form}.zip", _zipped(folder)


def _zipped(folder: Path) -> bytes:
    content = BytesIO()
    with zipfile.ZipFile(content, "w", zipfile.ZIP_DEFLATED) as archive:
        for file in sorted(folder.iterdir()):
            archive.writestr(zipfile.ZipInfo(file.name), file.read_bytes(), zipfile.ZIP_DEFLATED)
    return content.getvalue()
