"""Track: a clip to a camera file for each of its frames, without a database."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from contextlib import closing
from pathlib import Path
from typing import Any

import numpy as np

from app.durable import replace_file
from app.errors import InputError, UnsafePathError
from app.features.file_tools.output_folder import require_writable_folder
from app.formats.cameras import camera_file_name, format_camera_file
from app.formats.report import ReaderReport
from app.formats.sn_calibration import read_line_documents
from app.formats.sn_calibration_reader import lines_from_json
from app.geometry.resection import LOG_FOCAL, PAN, PARAMETERS, ROLL, TILT, X, Z
from app.json_text import json_text
from app.progress import ReportProgress
from app.soccer.annotation import Lines
from app.soccer.frames import ImageSize
from app.solving.tripod_pitch import TripodPitch
from app.tracking.clip import Clip
from app.tracking.follow import OUTCOMES
from app.tracking.sides import move_camera_to_opposite_side
from app.tracking.track import CameraTrack, FrameCamera, track_clip
from app.worker_process import WorkerEnded, WorkerLimits, WorkerProcess

RESULT = "track.json"
LIMITS = WorkerLimits(memory=3 * 2**30, processor=math.inf, silence=600.0)
LARGEST_LINES = 16 * 2**20
"""Bytes of a file of lines of one frame."""


def track_cameras_of_clip(
    clip: Path,
    out: Path,
    lines: Sequence[str] = (),
    *,
    on_shown: bool = False,
    turn: bool = False,
    progress: ReportProgress | None = None,
) -> dict[str, Any]:
    """Write a camera file for each frame of a clip that has a camera, and what became of each.

    The clip is decoded and followed in a worker process with limits.

    Args:
        clip: A video of one camera.
        out: Folder that gets ``camera_<frame>.json`` and ``track.json``. Camera files that an
            earlier run left there for the same frames are replaced or removed.
        lines: ``FILE@FRAME``: a line file of SoccerNet's form, and the number of its frame.
        on_shown: Whether cameras are those of the pitch that the clip shows, instead of the plan.
        turn: Whether the cameras are turned by half a turn of the pitch, where no lines say which half is left.
        progress: Called with frames done.

    Returns:
        What ``track.json`` holds.

    Raises:
        InputError: A line file cannot be read or determines no camera, ``out`` cannot hold the
            result, or cameras of lines shall be turned.
        ImageError: The clip cannot be read.
    """
    if turn and lines:
        raise InputError(
            "the cameras cannot be turned: the given lines already say which half of the pitch is left",
            hint="Name the lines for the other half, or leave out one of the two options.",
        )
    require_writable_folder(out)
    named = _parse_line_file_options(lines)
    contents = {number: _read_file(path) for number, path in named.items()}
    shown = {number: str(path) for number, path in named.items()}

    def forward_progress(done: Any) -> None:
        if progress is not None:
            progress(done)

    with closing(WorkerProcess(LIMITS)) as worker:
        try:
            found: CameraTrack = worker.run(
                track_video, clip, contents, shown, on_message=forward_progress
            )
        except WorkerEnded as error:
            raise InputError(f"{clip.name} {error}") from error
    frames = found.shown_frames if on_shown else found.frames
    pitch = pitch_to_row(found.shown, on_shown=on_shown)
    if turn:
        frames = [move_camera_to_opposite_side(frame) for frame in frames]
        if pitch is not None:
            x, y, z = pitch["tripod"]
            pitch["tripod"] = [-x, -y, z]
    result = {"frames": [frame_to_row(frame) for frame in frames], "pitch": pitch}
    write_cameras(out, frames, result)
    return result


def track_video(
    clip: Path,
    contents: Mapping[int, bytes],
    shown: Mapping[int, str],
    send: Callable[[int], Any],
) -> CameraTrack:
    """The work of the process: decode, calibrate and follow.

    Args:
        clip: A video of one camera.
        contents: Line files by number of their frame.
        shown: Their names.
        send: Called with frames done.
    """
    opened, report = Clip.open(clip), ReaderReport()
    lines = {
        number: _parse_lines(content, shown[number], opened.size, report)
        for number, content in contents.items()
    }
    return track_clip(opened, lines, tell=send)


def _parse_lines(content: bytes, shown: str, size: ImageSize, report: ReaderReport) -> Lines:
    documents = read_line_documents(content, shown, report)
    if len(documents) != 1:
        raise InputError(
            f"{shown} has the lines of {len(documents)} frames; give a file with the lines of"
            " one frame"
        )
    lines, _ = lines_from_json(documents[0].lines, size, shown, report)
    if not lines:
        raise report.make_refusal_error(f"{shown} has no line of a known marking")
    return lines


def _parse_line_file_options(lines: Sequence[str]) -> dict[int, Path]:
    named: dict[int, Path] = {}
    for text in lines:
        path, separator, number = text.rpartition("@")
        if not separator or not path or not number.isascii() or not number.isdigit():
            raise InputError(
                f'"{text}" does not name a line file and its frame',
                hint="Write FILE@FRAME, such as lines.json@0; frames count from 0.",
            )
        if int(number) in named:
            raise InputError(f"frame {int(number)} has two line files")
        named[int(number)] = Path(path)
    return named


def _read_file(path: Path) -> bytes:
    try:
        with path.open("rb") as file:
            content = file.read(LARGEST_LINES + 1)
    except OSError as error:
        raise InputError(f"{path} cannot be read ({error.strerror})") from error
    if len(content) > LARGEST_LINES:
        raise InputError(
            f"{path} is larger than {LARGEST_LINES} bytes, which is the limit for a line file"
        )
    return content


def frame_to_row(frame: FrameCamera) -> dict[str, Any]:
    """The row of a frame in ``track.json``: pixels of the video, degrees, metres, seconds."""
    row: dict[str, Any] = {
        "frame": frame.number,
        "time": frame.time,
        "outcome": frame.outcome,
        "supported": frame.supported,
        "explained": frame.explained,
        "error_px": frame.error_px,
        "keyframe": frame.is_keyframe,
        "reason": frame.reason,
        **dict.fromkeys(("pan", "tilt", "roll", "focal_px", "position", "sigma")),
    }
    camera = frame.camera
    if camera is not None:
        row["pan"], row["tilt"], row["roll"] = camera.pan_tilt_roll_degrees
        row["focal_px"] = camera.focal_length[0]
        row["position"] = [float(item) for item in camera.position]
        if frame.covariance is not None:
            row["sigma"] = _standard_deviations(frame.covariance, camera.focal_length[0])
    return row


def _standard_deviations(covariance: Sequence[float], focal: float) -> dict[str, float]:
    """Standard deviations: angles in degrees, focal length in pixels, position in metres."""
    matrix = np.reshape(covariance, (PARAMETERS, PARAMETERS))
    each = np.sqrt(np.diag(matrix))
    pan, tilt, roll = np.degrees(each[[PAN, TILT, ROLL]]).tolist()
    largest = float(np.sqrt(np.linalg.eigvalsh(matrix[X : Z + 1, X : Z + 1])[-1]))
    return {
        "pan": pan,
        "tilt": tilt,
        "roll": roll,
        "focal_px": float(each[LOG_FOCAL] * focal),
        "position": largest,
    }


def pitch_to_row(shown: TripodPitch | None, *, on_shown: bool) -> dict[str, Any] | None:
    """The pitch that a clip shows, for ``track.json``: metres; None where it shows none.

    ``cameras`` says whether the cameras are those of the ``plan`` or of the pitch that is ``shown``;
    ``other`` is the size where it certainly is not the plan's.
    """
    if shown is None:
        return None
    (crown, crown_sigma), (inward, inward_sigma) = shown.crown, shown.inward_paint_shift
    (knows_length, knows_width), (length, width) = shown.are_sizes_known, shown.size_sigmas.tolist()
    spread = np.linalg.eigvalsh(shown.tripod_position_covariance)[-1]
    other = shown.clearly_different_pitch()
    return {
        "cameras": "shown" if on_shown else "plan",
        "length": shown.pitch.length if knows_length else None,
        "width": shown.pitch.width if knows_width else None,
        "crown": crown,
        "inward": inward,
        "tripod": shown.tripod_position.tolist(),
        "sigma": {
            "length": length if knows_length else None,
            "width": width if knows_width else None,
            "crown": crown_sigma,
            "inward": inward_sigma,
            "tripod": float(np.sqrt(spread)),
        },
        "frames": shown.frames,
        "other": None if other is None else {"length": other.length, "width": other.width},
    }


def count_outcomes(rows: Sequence[Mapping[str, Any]]) -> dict[str, int]:
    """How many frames had which outcome."""
    counts = Counter(row["outcome"] for row in rows)
    return {"frames": len(rows), **{name: counts[name] for name in OUTCOMES}}


def write_cameras(out: Path, found: Sequence[FrameCamera], result: Mapping[str, Any]) -> None:
    """Write ``camera_<frame>.json`` of each frame that has a camera, and ``track.json``.

    Args:
        result: What ``track.json`` holds: ``frame_to_row`` of each frame, and ``pitch_to_row``.

    Raises:
        InputError: ``out`` cannot hold them.
    """
    try:
        out.mkdir(parents=True, exist_ok=True)
        for frame in found:
            file = out / camera_file_name(str(frame.number))
            if frame.camera is None:
                file.unlink(missing_ok=True)
                continue
            text = format_camera_file(frame.camera, frame.covariance, frame.size)
            replace_file(file, text.encode(), durable=False, private=False)
        text = json_text(result, indent=1) + "\n"
        replace_file(out / RESULT, text.encode(), durable=False, private=False)
    except (OSError, UnsafePathError) as error:
        why = error.strerror if isinstance(error, OSError) else str(error)
        raise InputError(f"the cameras cannot be written to {out} ({why})") from error
