"""The pitch that line files show, without a database."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from app.datasets.report import Report
from app.datasets.sn_calibration_reader import read_line_files
from app.soccer.frames import ImageSize
from app.soccer.policy import CLICKED
from app.solving.pitch_size import PitchFrame, estimate_pitch


def estimate_pitch_of_files(source: Path, *, size: ImageSize) -> dict[str, Any]:
    """Length and width of the pitch that the line files of one match show; null: not shown.

    Raises:
        InputError: There is no line file.
        DegenerateGeometryError: Too few show enough markings.
    """
    report = Report()
    frames = [PitchFrame(file.lines, size) for file in read_line_files(source, size, report)]
    if not frames:
        raise report.refusal(f"{source} holds no line files")
    found = estimate_pitch(frames, CLICKED)
    return {
        "length_m": found.length,
        "width_m": found.width,
        "length_sigma_m": found.length_sigma_m,
        "width_sigma_m": found.width_sigma_m,
        "frames": found.frames,
        "problems": [problem.message for problem in report.problems],
    }
