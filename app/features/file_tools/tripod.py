"""Tripod: frames of one camera that stands still, which say together which pitch they show.

The files of their cameras get covariances that know it.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from app.durable import replace_file
from app.errors import InputError
from app.features.file_tools.matches import read_matches
from app.features.file_tools.track import pitch_row
from app.formats.cameras_writer import camera_file_name, camera_file_text
from app.formats.safe_path import resolve_inside
from app.geometry.arrays import row_by_row
from app.geometry.camera import Camera
from app.paint.frame_pitch import find_shared_pitch
from app.paint.snap import SnappedCamera
from app.soccer.frames import ImageSize
from app.soccer.pitch import Pitch
from app.soccer.policy import CalibrationPolicy

ONE = "one"
"""Of ``--tripod``: all pictures are of one camera."""


@dataclass(frozen=True)
class DrawnFrame:
    """A camera on its paint, and its file.

    Attributes:
        frame: Name of the frame.
        snapped: Pixels of the picture.
        camera: As its file has it.
        size: Of the picture, as the file has it.
        pitch: On which it lies.
    """

    frame: str
    snapped: SnappedCamera
    camera: Camera
    size: ImageSize
    pitch: Pitch


def share_tripods(
    drawn: Sequence[DrawnFrame], tripod: str | None, rows: Sequence[dict[str, Any]], out: Path
) -> None:
    """Write cameras of frames of one tripod again, with what they know together.

    Args:
        drawn: All cameras that lie on paint.
        tripod: ``one``, or a file that names the camera of each frame; None: nothing is known.
        rows: Of all frames; those of a tripod get ``shown``, the pitch that they show.
        out: Folder of the camera files.

    Raises:
        InputError: The file cannot be read, or names no frame, or ``out`` cannot be written.
    """
    if tripod is None:
        return
    by_camera: dict[str, list[DrawnFrame]] = {}
    named = None if tripod == ONE else _named(Path(tripod), rows)
    for each in drawn:
        name = ONE if named is None else named.get(each.frame, "")
        if name:
            by_camera.setdefault(name, []).append(each)
    by_frame = {row["frame"]: row for row in rows}
    for frames in by_camera.values():
        if len({each.pitch for each in frames}) > 1:
            continue
        shared = find_shared_pitch(
            [each.snapped for each in frames], frames[0].pitch, CalibrationPolicy()
        )
        if shared is None:
            continue
        shown, covariances = shared
        for each, covariance in zip(frames, covariances, strict=True):
            by_frame[each.frame]["shown"] = pitch_row(shown, on_shown=False)
            text = camera_file_text(each.camera, row_by_row(covariance), each.size)
            _write(resolve_inside(out, camera_file_name(each.frame)), text)


def _named(file: Path, rows: Sequence[Mapping[str, Any]]) -> dict[str, str]:
    """The camera of each frame, as ``calibrate --matches`` reads matches."""
    if not file.is_file():
        raise InputError(
            f'"{file}" is not {ONE}, and there is no such file',
            hint="Give a CSV file with the columns frame and match, or a JSON object of frame names and matches.",
        )
    named = read_matches(file)
    if not any(row["frame"] in named for row in rows):
        raise InputError(f"{file} names none of the {len(rows)} frames, such as {rows[0]['frame']}")
    return named


def _write(file: Path, text: str) -> None:
    try:
        replace_file(file, text.encode(), durable=False, private=False)
    except OSError as error:
        raise InputError(f"{file.parent} cannot be written ({error.strerror})") from error
