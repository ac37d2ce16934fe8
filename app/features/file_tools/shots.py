"""Shots of a recording, and the map of times between a live shot and its replay, without a database."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from contextlib import closing
from dataclasses import asdict
from itertools import pairwise
from math import inf
from pathlib import Path
from typing import Any

import numpy as np

from app.config import Settings
from app.errors import DatasetFormatError, ImageError, InputError, TooLargeError
from app.features.file_tools.camera_export import key_by_frame_number
from app.features.file_tools.output_folder import require_writable_folder, write_out_file
from app.formats.cameras import read_cameras
from app.formats.csv_text import is_missing, read_rows
from app.formats.file_tree import DEFAULT_LIMITS
from app.formats.report import ReaderReport
from app.json_text import json_text
from app.progress import ReportProgress
from app.tracking.ball_rays import BallRays, build_ball_rays
from app.tracking.link import find_time_map
from app.tracking.time_map import TimeMap
from app.video.shots import RecordingShots, Shot, index_and_find_shots
from app.worker_process import WorkerEnded, WorkerLimits, WorkerProcess

RESULT = "shots.json"
LIMITS = WorkerLimits(memory=2 * 2**30, processor=inf, silence=600.0)
"""For one recording; it tells every few seconds how far it is, so that silence is a fault."""


BALL_FILE = "ball.csv"
_COLUMNS = ("frame", "time_s", "x", "y")
_MOST_RAYS = 20_000
"""Of a view: beyond, it is a match and no shot."""
_MOST_NUMBER = 1e15
"""In a cell; times may count from 1970."""
_HINT = re.compile(r"\s*([+-]?[\d.]+(?:[eE][+-]?\d+)?)\s*=\s*([+-]?[\d.]+(?:[eE][+-]?\d+)?)\s*")


def find_shots_in_file(
    recording: Path, out: Path, settings: Settings, progress: ReportProgress | None = None
) -> dict[str, Any]:
    """Write the shots of a recording to ``shots.json``.

    The recording is decoded in a process with limits.

    Args:
        recording: The file.
        out: Folder that gets ``shots.json``.
        settings: Limits on what is read.
        progress: Called with frames read, and then with shots looked at.

    Returns:
        What ``shots.json`` holds.

    Raises:
        ImageError: It is not a video that can be read, or damaged.
        TooLargeError: It is larger than the limits, or needs more than the process may use.
        InputError: ``out`` cannot hold the result.
    """
    require_writable_folder(out)

    def forward_progress(message: tuple[int, int | None, str]) -> None:
        if progress is not None:
            progress(*message)

    with closing(WorkerProcess(LIMITS)) as worker:
        try:
            found: RecordingShots = worker.run(
                index_and_find_shots, recording, settings, on_message=forward_progress
            )
        except WorkerEnded as error:
            kind = ImageError if error.reason == "crash" else TooLargeError
            raise kind(f"{recording.name} {error}") from error
    document = _shots_to_json(found)
    write_out_file(out / RESULT, json_text(document, indent=1) + "\n")
    return document


def _shots_to_json(found: RecordingShots) -> dict[str, Any]:
    return {
        "frames": found.frames,
        "fps": found.fps,
        "variable": found.variable,
        "shots": [_shot_to_json(shot) for shot in found.shots],
    }


def _shot_to_json(shot: Shot) -> dict[str, Any]:
    return {
        "first": shot.first,
        "last": shot.last,
        "start_s": round(shot.start_s, 6),
        "end_s": round(shot.end_s, 6),
        "kind": shot.kind,
        "entered_by": shot.entered_by,
        "logo": shot.logo,
        "repeated": shot.repeated,
        "blended": shot.blended,
        "freezes": [asdict(one) for one in shot.freezes],
    }


def link_live_and_replay(
    live: Path, replay: Path, out: Path, hints: Sequence[tuple[float, float]] = ()
) -> dict[str, Any]:
    """Find which live time each time of a replay shows, and write ``link.json``.

    Args:
        live: Folder with ``camera_<frame>.json`` of each frame and ``ball.csv`` (``frame,time_s,x,y``
            in pixels, empty where there is no ball).
        replay: The same of the replay.
        out: Folder that gets ``link.json``; it is made where it is not there.
        hints: Live and replay time of the same instants, as a person sees them.

    Returns:
        What ``link.json`` holds.

    Raises:
        InputError: A folder holds no cameras, no ball, or none of the same frames, or ``out`` cannot
            be written.
        DatasetFormatError: ``ball.csv`` is another file.
    """
    require_writable_folder(out)
    report = ReaderReport()
    made = find_time_map(_read_ball_rays(live, report), _read_ball_rays(replay, report), hints)
    result = {
        **_time_map_to_json(made),
        "reason": made.reason,
        "found_by": None if made.reason else "instants" if made.by_hand else "ball",
        "pieces": [
            {"first_s": piece.first, "last_s": piece.last, **_time_map_to_json(piece)}
            for piece in made.pieces
        ],
        "problems": [problem.message for problem in report.problems],
    }
    write_out_file(out / "link.json", json_text(result, indent=1) + "\n")
    return result


def parse_hint(text: str) -> tuple[float, float]:
    """Live and replay time of ``LIVE_TIME=REPLAY_TIME``, seconds.

    Raises:
        ValueError: It is something else.
    """
    found = _HINT.fullmatch(text)
    if found is None:
        raise ValueError(f'"{text}" is not LIVE_TIME=REPLAY_TIME in seconds, such as 12.48=3.2')
    return float(found.group(1)), float(found.group(2))


def _time_map_to_json(made: TimeMap) -> dict[str, Any]:
    linked = made.reason is None
    sigma: Sequence[float | None] = (None, None)
    if linked and made.covariance is not None:
        sigma = np.sqrt(np.maximum(made.covariance.diagonal(), 0.0)).tolist()
    return {
        "outcome": "linked" if linked else "unobservable",
        "offset_s": made.offset if linked else None,
        "speed": made.speed if linked else None,
        "offset_sigma_s": sigma[0],
        "speed_sigma": sigma[1],
        "miss_m": made.miss,
        "rays": made.pairs,
        "overlap_s": made.overlap,
    }


def _read_ball_rays(folder: Path, report: ReaderReport) -> BallRays:
    """The rays of the ball of one folder."""
    if not folder.is_dir():
        raise InputError(f"{folder} is not a folder of camera files and {BALL_FILE}")
    cameras = key_by_frame_number(read_cameras(folder, report), folder, report)
    if not cameras:
        raise report.make_refusal_error(f"{folder} contains no camera_<frame>.json")
    rows = read_ball_rows(folder / BALL_FILE, str(folder / BALL_FILE), report)
    if not rows:
        raise report.make_refusal_error(f"{folder / BALL_FILE} has no row with a ball")
    seen = [(time, pixel, cameras[frame]) for frame, time, pixel in rows if frame in cameras]
    if not seen:
        raise InputError(
            f"no frame with a ball in {folder / BALL_FILE} has its camera_<frame>.json beside it"
        )
    if len(seen) < len(rows):
        problem = f"{len(rows) - len(seen)} of {len(rows)} frames with a ball have no camera"
        report.add_problem_at(str(folder), None, None, problem)
    seen.sort(key=lambda one: one[0])
    times = [one[0] for one in seen]
    new = [True, *(b > a for a, b in pairwise(times))]
    if not all(new):
        problem = f"{new.count(False)} frames have the time of another; the first ones are used"
        report.add_problem_at(str(folder / BALL_FILE), None, "time_s", problem)
    kept = [one for one, first in zip(seen, new, strict=True) if first]
    if len(kept) > _MOST_RAYS:
        raise InputError(
            f"{folder / BALL_FILE} has {len(kept):,} frames with a ball;"
            f" the limit is {_MOST_RAYS:,}",
            hint="Give only the rows of one shot.",
        )
    return build_ball_rays(
        [one[0] for one in kept], [one[1] for one in kept], [one[2] for one in kept]
    )


def read_ball_rows(
    path: Path, name: str, report: ReaderReport
) -> list[tuple[int, float, tuple[float, float]]]:
    """Frame, time in seconds and pixel of each row with a ball of a ``ball.csv``.

    Args:
        path: The file.
        name: How complaints call it.
        report: Gets what is left out: repeated frames, cells that are no numbers.

    Raises:
        DatasetFormatError: It has other columns.
        InputError: It cannot be read.
    """
    try:
        content = path.read_bytes()
    except OSError as error:
        raise InputError(
            f"{name} cannot be read; it has the columns {','.join(_COLUMNS)}"
        ) from error
    found = []
    frames = set()
    for line, row in read_rows(content, name, _COLUMNS, DEFAULT_LIMITS):
        if is_missing(row.get("x")) and is_missing(row.get("y")):
            continue
        try:
            frame, time, x, y = (_parse_number(row, column, name, line) for column in _COLUMNS)
            if not frame.is_integer():
                raise DatasetFormatError(name, f"line {line}", "frame", "is not a whole number")
            if frame in frames:
                raise DatasetFormatError(
                    str(path), f"line {line}", "frame", f"{frame:.0f} is listed twice"
                )
        except DatasetFormatError as error:
            report.add_problem(error)
            continue
        frames.add(frame)
        found.append((int(frame), time, (x, y)))
    return found


def _parse_number(row: Mapping[str, str], column: str, name: str, line: int) -> float:
    text = row.get(column)
    try:
        value = float(text or "")
    except ValueError:
        value = float("nan")
    if not np.isfinite(value) or abs(value) > _MOST_NUMBER:
        raise DatasetFormatError(
            name, f"line {line}", column, f'is "{text}", which is not a number'
        )
    return value
