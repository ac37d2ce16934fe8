"""Propose: frames alone to camera files, without a database."""

from __future__ import annotations

import time
from collections import Counter
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from app.config import Settings
from app.datasets.cameras_reader import read_cameras
from app.datasets.cameras_writer import camera_name, camera_text
from app.datasets.report import Report
from app.datasets.safe_path import resolve_inside
from app.durable import replace_file
from app.errors import GeometryError, InputError
from app.finite import json_text
from app.geometry.arrays import row_by_row
from app.geometry.camera import Camera
from app.paint.propose import FrameProposal, propose
from app.progress import TellProgress
from app.review.datasets.picture_files import PictureFile, UniqueNames, read_pictures
from app.soccer.frames import ImageSize
from app.soccer.paint_evidence import PROPOSAL_OUTCOMES

RESULT = "propose.json"


def propose_files(
    sources: Sequence[Path],
    out: Path,
    settings: Settings,
    *,
    size: ImageSize | None = None,
    known: Sequence[Path] = (),
    progress: TellProgress | None = None,
) -> list[dict[str, Any]]:
    """Write a camera file for each picture whose camera is certain, and what became of each.

    Args:
        sources: Folders, zips and files with pictures.
        out: Folder that gets ``camera_<frame>.json`` and ``propose.json``. Camera files that an
            earlier run left there for the same frames are replaced or taken away.
        settings: Limits on what is read.
        size: Size for which the cameras are written; None: each picture's own.
        known: Camera files of other frames of the match.
        progress: Called with frames done.

    Returns:
        What ``propose.json`` holds.

    Raises:
        InputError: There is no picture, no known camera, or ``out`` cannot hold the result.
    """
    report = Report()
    cameras = _known(known)
    rows: list[dict[str, Any]] = []
    names = UniqueNames()
    for picture in read_pictures(sources, settings, report):
        frame = names.name(picture.stem)
        rows.append(_propose_one(picture, frame, out, cameras, size))
        if progress is not None:
            progress(len(rows))
    if not rows:
        why = f": {report.problems[0].message}" if report.problems else ""
        raise InputError(f"there are no pictures (jpg, png or webp) to read{why}")
    _write(out / RESULT, json_text(rows, indent=1) + "\n")
    return rows


def counts_of(rows: Sequence[dict[str, Any]]) -> dict[str, int]:
    """How many frames had which outcome."""
    counts = Counter(row["outcome"] for row in rows)
    return {name: counts[name] for name in PROPOSAL_OUTCOMES}


def _propose_one(
    picture: PictureFile,
    frame: str,
    out: Path,
    known: Sequence[Camera],
    size: ImageSize | None,
) -> dict[str, Any]:
    began = time.perf_counter()
    if picture.image is None:
        found = FrameProposal("nothing", picture.problem)
    else:
        try:
            found = propose(picture.image, known=known)
        except (GeometryError, np.linalg.LinAlgError) as error:
            found = FrameProposal("nothing", f"the picture cannot be solved ({error})")
    milliseconds = 1000 * (time.perf_counter() - began)
    file = resolve_inside(out, camera_name(frame))
    if found.outcome == "proposed" and found.camera is not None and picture.image is not None:
        camera = found.camera
        height, width = picture.image.shape[:2]
        if size is not None:
            camera = camera.scaled(size.width / width, size.height / height)
        spread = None if found.snapped is None else found.snapped.covariance
        covariance = None if spread is None else row_by_row(spread)
        _write(file, camera_text(camera, covariance, size or ImageSize(width, height)))
    else:
        file.unlink(missing_ok=True)
    return _row(frame, found, milliseconds)


def _row(frame: str, found: FrameProposal, milliseconds: float) -> dict[str, Any]:
    agreement, snapped = found.agreement, found.snapped
    return {
        "frame": frame,
        "outcome": found.outcome,
        "supported": None if agreement is None else agreement.supported,
        "explained": None if agreement is None else agreement.explained,
        "points": 0 if snapped is None else snapped.points,
        "error_px": None if snapped is None else snapped.error_px,
        "runner_up": found.runner_up,
        "ms": milliseconds,
        "reason": found.reason,
    }


def _known(paths: Sequence[Path]) -> list[Camera]:
    report = Report()
    cameras = [camera for path in paths for camera in read_cameras(path, report).values()]
    if paths and not cameras:
        why = f": {report.problems[0].message}" if report.problems else ""
        raise InputError(f"there is no known camera to read{why}")
    return cameras


def _write(file: Path, text: str) -> None:
    try:
        file.parent.mkdir(parents=True, exist_ok=True)
        replace_file(file, text.encode(), durable=False, private=False)
    except OSError as error:
        raise InputError(f"{file.parent} cannot be written ({error.strerror})") from error
