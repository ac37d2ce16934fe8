"""Propose: frames alone to camera files, without a database."""

from __future__ import annotations

import time
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from app.config import Settings
from app.errors import GeometryError, InputError
from app.features.file_tools.matches import SnappedFrame, refine_shared_tripod_cameras
from app.features.file_tools.output_folder import require_writable_folder, write_out_file
from app.features.file_tools.paint import PictureFile, UniqueNameGenerator, read_pictures
from app.formats.cameras import camera_file_name, format_camera_file, read_cameras
from app.formats.report import ReaderReport
from app.formats.safe_path import resolve_inside
from app.geometry.arrays import flatten_covariance
from app.geometry.camera import Camera
from app.json_text import json_text
from app.paint.frame_pitch import (
    collect_pitch_size_evidence,
    find_differing_agreed_pitch,
    group_by_position,
)
from app.paint.propose import FrameProposal, propose_camera
from app.progress import ReportProgress
from app.soccer.frames import ImageSize
from app.soccer.paint_evidence import PROPOSAL_OUTCOMES
from app.soccer.pitch import Pitch
from app.solving.pitch_size import PitchSizeFrameLines

RESULT = "propose.json"
LIKELY = 0.6
"""Share of the markings that have paint, of an unsure camera that is asked for the size of its pitch."""


def propose_cameras_of_files(
    sources: Sequence[Path],
    out: Path,
    settings: Settings,
    *,
    size: ImageSize | None = None,
    known: Sequence[Path] = (),
    tripod: str | None = None,
    report: ReaderReport | None = None,
    progress: ReportProgress | None = None,
) -> list[dict[str, Any]]:
    """Write a camera file for each picture whose camera is certain, and what became of each.

    Args:
        sources: Folders, zips and files with pictures.
        out: Folder that gets ``camera_<frame>.json`` and ``propose.json``. Camera files that an
            earlier run left there for the same frames are replaced or taken away.
        settings: Limits on what is read.
        size: Size for which the cameras are written; None: each picture's own.
        known: Camera files of other frames of the match.
        tripod: ``one`` where all pictures are of one camera that stands still, or a file that
            names the camera of each frame.
        report: Gets what could not be read.
        progress: Called with frames done.

    Returns:
        What ``propose.json`` holds.

    Raises:
        InputError: There is no picture, no known camera, or ``out`` cannot hold the result.
    """
    require_writable_folder(out)
    report = ReaderReport() if report is None else report
    of_known = ReaderReport()
    cameras = _read_known_cameras(known, of_known)
    rows: list[dict[str, Any]] = []
    names = UniqueNameGenerator()
    seen: list[_ProposedCamera | None] = []
    for picture in read_pictures(sources, settings, report):
        frame = names.name(picture.stem)
        row, proposed = _propose_and_write_camera(picture, frame, out, cameras, size, Pitch())
        rows.append(row)
        seen.append(proposed)
        if progress is not None:
            progress(len(rows))
    if not rows:
        why = f": {report.problems[0].message}" if report.problems else ""
        raise InputError(f"no picture (jpg, png or webp) can be read{why}")
    report.add_problems_of(of_known)
    pitches = _estimate_pitch_of_each_frame(seen)
    if pitches:
        for at, picture in enumerate(read_pictures(sources, settings, ReaderReport())):
            if at in pitches:
                again = _propose_on_other_pitch(picture, rows, at, out, pitches[at], seen[at], size)
                seen[at] = again or seen[at]
    drawn = [one.drawn for one in seen if one is not None and one.drawn is not None]
    refine_shared_tripod_cameras(drawn, tripod, rows, out, report)
    write_out_file(out / RESULT, json_text(rows, indent=1) + "\n")
    return rows


@dataclass(frozen=True)
class _ProposedCamera:
    """A camera, proposed or nearly so, and the paint beside it; an unsure one agrees by nothing."""

    camera: Camera
    agreement: float
    frame: PitchSizeFrameLines
    drawn: SnappedFrame | None = None


def _estimate_pitch_of_each_frame(seen: Sequence[_ProposedCamera | None]) -> dict[int, Pitch]:
    """The pitch of each frame whose film certainly shows another size, by its index."""
    cameras = [None if one is None else one.camera for one in seen]
    sizes = [None if one is None else one.frame.size for one in seen]
    found = {}
    for film in group_by_position(cameras, sizes):
        frames = [one.frame for index in film if (one := seen[index]) is not None]
        pitch = find_differing_agreed_pitch(frames, Pitch())
        if pitch is not None:
            found.update(dict.fromkeys(film, pitch))
    return found


def _propose_on_other_pitch(
    picture: PictureFile,
    rows: list[dict[str, Any]],
    at: int,
    out: Path,
    pitch: Pitch,
    before: _ProposedCamera | None,
    size: ImageSize | None,
) -> _ProposedCamera | None:
    """A frame once more on the pitch that its film shows; kept where the paint agrees no less."""
    frame = rows[at]["frame"]
    if picture.image is None or before is None:
        return None
    row, again = _propose_and_write_camera(
        picture, frame, out, [before.camera], size, pitch, before.agreement
    )
    if again is not None:
        rows[at] = row | {"ms": row["ms"] + rows[at]["ms"]}
    return again


def count_proposal_outcomes(rows: Sequence[dict[str, Any]]) -> dict[str, int]:
    """How many frames had which outcome."""
    counts = Counter(row["outcome"] for row in rows)
    return {name: counts[name] for name in PROPOSAL_OUTCOMES}


def _propose_and_write_camera(
    picture: PictureFile,
    frame: str,
    out: Path,
    known: Sequence[Camera],
    size: ImageSize | None,
    pitch: Pitch,
    least: float | None = None,
) -> tuple[dict[str, Any], _ProposedCamera | None]:
    """Propose and write the camera of one frame; below a least agreement nothing is changed."""
    began = time.perf_counter()
    if picture.image is None:
        found = FrameProposal("nothing", picture.problem)
    else:
        try:
            found = propose_camera(picture.image, pitch, known)
        except (GeometryError, np.linalg.LinAlgError) as error:
            found = FrameProposal("nothing", f"the picture cannot be solved ({error})")
    milliseconds = 1000 * (time.perf_counter() - began)
    file, row = (
        resolve_inside(out, camera_file_name(frame)),
        _build_result_row(frame, found, milliseconds),
    )
    if pitch != Pitch():
        row["pitch"] = {"length": pitch.length, "width": pitch.width}
    agrees = 0.0 if found.agreement is None else found.agreement.combined_score
    if least is not None and (found.outcome != "proposed" or agrees < least):
        return row, None
    if found.outcome == "proposed" and found.camera is not None and picture.image is not None:
        camera = found.camera
        height, width = picture.image.shape[:2]
        if size is not None:
            camera = camera.scaled(size.width / width, size.height / height)
        spread = None if found.snapped is None else found.snapped.covariance
        covariance = None if spread is None else flatten_covariance(spread)
        shape = size or ImageSize(width, height)
        write_out_file(file, format_camera_file(camera, covariance, shape))
        known_to = collect_pitch_size_evidence(picture.image, found.camera, pitch)
        drawn = (
            SnappedFrame(frame, found.snapped, camera, shape, pitch)
            if found.snapped is not None and found.snapped.reason is None
            else None
        )
        return row, _ProposedCamera(found.camera, agrees, known_to, drawn)
    file.unlink(missing_ok=True)
    if found.camera is None or picture.image is None or not _may_fit_another_pitch(found):
        return row, None
    return row, _ProposedCamera(
        found.camera, 0.0, collect_pitch_size_evidence(picture.image, found.camera, pitch)
    )


def _may_fit_another_pitch(found: FrameProposal) -> bool:
    """Whether an unsure camera may lie on its paint but for markings of another pitch."""
    return found.agreement is not None and found.agreement.supported >= LIKELY


def _build_result_row(frame: str, found: FrameProposal, milliseconds: float) -> dict[str, Any]:
    agreement, snapped = found.agreement, found.snapped
    return {
        "frame": frame,
        "outcome": found.outcome,
        "supported": None if agreement is None else agreement.supported,
        "explained": None if agreement is None else agreement.explained,
        "points": 0 if snapped is None else snapped.point_count,
        "error_px": None if snapped is None else snapped.error_px,
        "runner_up": found.runner_up,
        "ms": milliseconds,
        "reason": found.reason,
    }


def _read_known_cameras(paths: Sequence[Path], report: ReaderReport) -> list[Camera]:
    cameras = [camera for path in paths for camera in read_cameras(path, report).values()]
    if paths and not cameras:
        why = f": {report.problems[0].message}" if report.problems else ""
        raise InputError(f"no camera can be read from the files of known cameras{why}")
    return cameras
