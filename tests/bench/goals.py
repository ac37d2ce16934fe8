"""What the middle of a goal's frame, and of lines, is worth: grass markings that were left out of real frames with goals.

``python -m tests.bench.goals`` takes the dev half of sn22-dev, every other frame; ``4`` every fourth
of these.
"""

from __future__ import annotations

import os
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np

from app.evaluation.cameras import measure_error_without_marking
from app.formats.report import ReaderReport
from app.formats.sn_calibration_reader import read_line_files
from app.soccer.annotation import Lines
from app.soccer.frames import ImageSize
from app.soccer.pitch import GOAL_PARTS, Pitch
from app.soccer.policy import CLICKED, CalibrationPolicy
from app.solving.calibrate import calibrate
from tests.bench.table import print_table

SIZE, PITCH = ImageSize(960, 540), Pitch()
LIMIT_PX = 5.5
DEV_HALF = slice(None, None, 2)
POLICIES = {
    "inner edges (paper)": CalibrationPolicy(),
    "middle, markings weighed alike (all others)": CLICKED,
    "middle, points weighed alike": replace(CLICKED, weighed="points"),
    "middle, lines by the Laws (calibrate --goal laws)": replace(CLICKED, goal="laws"),
}


def bench_goals(data: Path, every: int = 1) -> None:
    """Print the table."""
    files = read_line_files(data / "sn22-dev" / "lines.zip", SIZE, ReaderReport())
    frames = [file.lines for file in [*files][DEV_HALF]]
    frames = [lines for lines in frames if not lines.keys().isdisjoint(GOAL_PARTS)][::every]
    rows: list[list[object]] = []
    for name, policy in POLICIES.items():
        errors = [error for lines in frames for error in left_out_grass(lines, policy)]
        clicks = [distance for lines in frames for distance in goal_distances(lines, policy)]
        below = 100 * float(np.mean(np.array(errors) < LIMIT_PX))
        rows.append([name, len(errors), below, len(clicks), float(np.median(clicks))])
    header = ("goals", "markings", f"below {LIMIT_PX} px, %", "goal clicks", "px median")
    print_table(f"Left-out grass markings in {len(frames)} real frames with goals", header, rows)


def left_out_grass(lines: Lines, policy: CalibrationPolicy) -> list[float]:
    """Largest distance of each grass marking from where the others put it, pixels."""
    grass = [marking for marking in lines if marking not in GOAL_PARTS]
    errors = [
        measure_error_without_marking(lines, marking, PITCH, SIZE, policy) for marking in grass
    ]
    return [np.inf if error is None else error for error in errors]


def goal_distances(lines: Lines, policy: CalibrationPolicy) -> list[float]:
    """Distances of the clicks on goals from the goals that were fitted, pixels."""
    fits = calibrate(lines, PITCH, SIZE, policy).markings
    return [one for fit in fits if fit.marking in GOAL_PARTS for one in fit.distances_px]


if __name__ == "__main__":
    bench_goals(
        Path(os.environ.get("TOUCHLINE_REAL_DATA", "../shared/data")), *map(int, sys.argv[1:])
    )
