"""Camera files measured against line files, without a database."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from app.errors import DatasetFormatError, InputError
from app.formats.cameras_reader import read_cameras
from app.formats.json_text import read_json
from app.formats.report import Report
from app.formats.safe_path import read_regular_file
from app.formats.sn_calibration_reader import read_line_files
from app.geometry.camera import Camera
from app.progress import ReportProgress
from app.soccer.annotation import lines_without
from app.soccer.frames import ImageSize
from app.soccer.pitch import Pitch
from app.solving.score import score_frame, score_frames


def score_files(
    lines: Path,
    cameras: Path,
    *,
    size: ImageSize,
    without: Path | None = None,
    progress: ReportProgress | None = None,
) -> dict[str, Any]:
    """Measure camera files against line files.

    Args:
        lines: Folder or zip of line files.
        cameras: Folder or zip of ``camera_<stem>.json``.
        size: Size of the annotated images where no folder of an export says it.
        without: ``findings.json``; markings that it calls mislabelled are left out.
        progress: Called with frames done.

    Raises:
        InputError: There is no line file, or no camera at all.
    """
    report, camera_report = Report(), Report()
    found = _cameras_by_frame(read_cameras(cameras, camera_report))
    if not found:
        raise camera_report.refusal(f"{cameras} holds no camera files")
    dropped = _wrong_labels(without) if without is not None else set()
    pitch = Pitch()
    scores = []
    frames: set[str] = set()
    for file in read_line_files(lines, size, report, by_folder=True):
        kept = lines_without(
            file.lines, {marking for stem, marking in dropped if stem == file.stem}
        )
        camera = found.get(file.stem)
        frames.add(file.stem)
        scores.append(None if camera is None else score_frame(camera, kept, pitch, file.size))
        if progress is not None:
            progress(len(scores))
    if not scores:
        raise report.refusal(f"{lines} holds no line files")
    if all(score is None for score in scores):
        frame, other = sorted(frames)[0], sorted(found)[0]
        raise InputError(
            f'no camera belongs to a line file: cameras are called "{other}", frames "{frame}"',
            hint="A camera of the frame 00002 lies in camera_00002.json.",
        )
    # A line file that cannot be read is a frame without a camera.
    scores.extend([None] * (report.read - len(scores)))
    total = score_frames(scores)
    return {
        "frames": total.frames,
        "calibrated": total.calibrated,
        "completeness": total.completeness,
        "jac_0.5": total.jac[0],
        "jac_1": total.jac[1],
        "jac_2": total.jac[2],
        "share": total.share,
        "fs5": total.challenge,
        "error_median_px": total.error_median_px,
        "error_p95_px": total.error_p95_px,
        **_read_milliseconds(cameras),
        "problems": [item.message for item in (*report.problems, *camera_report.problems)],
    }


def _cameras_by_frame(cameras: Mapping[str, Camera]) -> dict[str, Camera]:
    """Cameras by key, and by the bare name of the frame where only one has it."""
    names = Counter(key.rsplit("/", 1)[-1] for key in cameras)
    bare = {key.rsplit("/", 1)[-1]: camera for key, camera in cameras.items()}
    return {**{name: bare[name] for name in bare if names[name] == 1}, **cameras}


def _wrong_labels(findings: Path) -> set[tuple[str, str]]:
    """Frame and marking of each finding ``wrong_label``."""
    value = read_json(read_regular_file(findings), str(findings))
    if not isinstance(value, list):
        raise DatasetFormatError(str(findings), None, None, "is not a list of findings")
    rows = [item for item in value if isinstance(item, dict) and item.get("kind") == "wrong_label"]
    return {(str(item.get("frame")), str(item.get("marking"))) for item in rows}


def _read_milliseconds(cameras: Path) -> dict[str, Any]:
    """Milliseconds a frame from the ``calibrate.json`` beside the cameras, or null."""
    beside = cameras / "calibrate.json"
    value = read_json(beside.read_bytes(), str(beside)) if beside.is_file() else {}
    times = {"ms_median": None, "ms_p95": None}
    if isinstance(value, dict):
        times |= {name: value.get(name) for name in times}
    return {name: time if isinstance(time, int | float) else None for name, time in times.items()}
