"""Shots: a recording to shots.json, without a database."""

from __future__ import annotations

from contextlib import closing
from dataclasses import asdict
from math import inf
from pathlib import Path
from typing import Any

from app.config import Settings
from app.durable import replace_file
from app.errors import ImageError, InputError, TooLargeError
from app.finite import json_text
from app.progress import ReportProgress
from app.video.shots import RecordingShots, Shot, shots_of_recording
from app.worker_process import WorkerEnded, WorkerLimits, WorkerProcess

RESULT = "shots.json"
LIMITS = WorkerLimits(memory=2 * 2**30, processor=inf, silence=600.0)
"""For one recording; it tells every few seconds how far it is, so that silence is a fault."""


def shots_file(
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

    def hear(message: tuple[int, int | None, str]) -> None:
        if progress is not None:
            progress(*message)

    with closing(WorkerProcess(LIMITS)) as worker:
        try:
            found: RecordingShots = worker.run(
                shots_of_recording, recording, settings, on_message=hear
            )
        except WorkerEnded as error:
            kind = ImageError if error.reason == "crash" else TooLargeError
            raise kind(f"{recording.name} {error}") from error
    document = _shots_document(found)
    try:
        out.mkdir(parents=True, exist_ok=True)
        content = (json_text(document, indent=1) + "\n").encode()
        replace_file(out / RESULT, content, durable=False, private=False)
    except OSError as error:
        raise InputError(f"{out} cannot be written ({error.strerror})") from error
    return document


def _shots_document(found: RecordingShots) -> dict[str, Any]:
    return {
        "frames": found.frames,
        "fps": found.fps,
        "variable": found.variable,
        "shots": [_shot_row(shot) for shot in found.shots],
    }


def _shot_row(shot: Shot) -> dict[str, Any]:
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
