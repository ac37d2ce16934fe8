"""Calibration on real lines, against the published figures of PnLCalib (docs/calibration.md)."""

from __future__ import annotations

import random
import time
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from app.evaluation.cameras import combine_frame_scores, measure_error_without_marking, score_frame
from app.formats.report import ReaderReport
from app.formats.sn_calibration_reader import read_line_files
from app.soccer.annotation import Lines, make_lines
from app.soccer.frames import ImageSize
from app.soccer.pitch import CIRCLES, MARKINGS, Pitch
from app.soccer.policy import CalibrationPolicy
from app.soccer.solution import Calibration
from app.solving.calibrate import calibrate
from tests.bench.table import print_table

SIZE = ImageSize(960, 540)
PITCH = Pitch()
GAMMA_PX = 0.005 * SIZE.diagonal
LEFT_OUT_LIMIT_PX = 5.5
SEED = 20261121

POLICIES = {
    "as given": CalibrationPolicy(check_labels=False),
    "checked": CalibrationPolicy(),
    "checked, pinhole": CalibrationPolicy(distortion_mean=0.0, distortion_sigma=1e-6),
}
PNLCALIB = [
    ["PnLCalib from lines, 1,454 frames *", 98.9, 80.0, 72.4, 77.4, 1.7, 9.5, 227.0, None],
    ["PnLCalib from its networks *", 97.5, 81.4, 74.9, 78.7, 1.7, 6.5, None, None],
]
HEADER = (
    "calibration",
    "done %",
    "JaC 0.5 %",
    "share %",
    "FS@5",
    "px median",
    "px p95",
    "ms median",
    "ms p95",
)


@dataclass(frozen=True)
class Run:
    """Every frame calibrated under one policy, with CPU milliseconds."""

    calibrations: Mapping[str, Calibration]
    milliseconds: tuple[float, ...]


def bench_calibration(data: Path) -> None:
    """Accuracy, left-out markings, planted swaps and time on the frames of ``sn22-dev``."""
    files = read_line_files(data / "sn22-dev" / "lines.zip", SIZE, ReaderReport())
    frames = {file.stem: file.lines for file in files}
    runs = {name: _run(frames, policy) for name, policy in POLICIES.items()}
    rows = [[f"Touchline, labels {name}", *_scores(frames, run)] for name, run in runs.items()]
    title = (
        f"Calibration, {len(frames)} real frames (* published figures, other frames, other machine)"
    )
    print_table(title, HEADER, [*PNLCALIB, *rows])
    _bench_left_out(frames)
    _bench_swaps(frames, runs["as given"])


def _run(frames: Mapping[str, Lines], policy: CalibrationPolicy) -> Run:
    calibrations, times = {}, []
    calibrate(next(iter(frames.values())), PITCH, SIZE, policy)
    for stem, lines in frames.items():
        began = time.thread_time()
        calibrations[stem] = calibrate(lines, PITCH, SIZE, policy)
        times.append(1000 * (time.thread_time() - began))
    return Run(calibrations, tuple(times))


def _scores(frames: Mapping[str, Lines], run: Run) -> list[object]:
    total = combine_frame_scores(
        None if found.camera is None else score_frame(found.camera, frames[stem], PITCH, SIZE)
        for stem, found in run.calibrations.items()
    )
    return [
        100 * total.completeness,
        100 * total.jac[0],
        100 * total.share,
        100 * total.challenge,
        total.error_median_px,
        total.error_p95_px,
        float(np.median(run.milliseconds)),
        float(np.percentile(run.milliseconds, 95)),
    ]


def _bench_left_out(frames: Mapping[str, Lines]) -> None:
    """One random marking of each frame is left out and predicted from the others."""
    rows: list[list[object]] = [
        ["PnLCalib *", None, 67.0],
    ]
    for name, policy in POLICIES.items():
        chooser = random.Random(SEED)
        errors = []
        for lines in frames.values():
            marking = chooser.choice(sorted(lines))
            error = measure_error_without_marking(lines, marking, PITCH, SIZE, policy)
            errors.append(np.inf if error is None else error)
        share = 100 * float(np.mean(np.array(errors) < LEFT_OUT_LIMIT_PX))
        rows.append([f"Touchline, {name}", float(np.median(errors)), share])
    header = ("left-out marking", "px median", f"below {LEFT_OUT_LIMIT_PX} px, %")
    print_table("A marking predicted from the others", header, rows)


def _bench_swaps(frames: Mapping[str, Lines], given: Run) -> None:
    """On clean frames one label is exchanged for a free one of its shape, and has to be found."""
    chooser = random.Random(SEED)
    clean = [stem for stem, found in given.calibrations.items() if _is_clean(found, frames[stem])]
    alarms = found = named = planted = 0
    for stem in clean:
        lines = frames[stem]
        alarms += bool(calibrate(lines, PITCH, SIZE, POLICIES["checked"]).suspects)
        marking = chooser.choice(sorted(lines))
        free = [
            other
            for other in MARKINGS
            if other not in lines and (other in CIRCLES) == (marking in CIRCLES)
        ]
        if not free:
            continue
        wrong = chooser.choice(free)
        swapped = {wrong if name == marking else name: at for name, at in lines.items()}
        suspects = calibrate(make_lines(swapped), PITCH, SIZE, POLICIES["checked"]).suspects
        suggested = {suspect.marking: suspect.suggested for suspect in suspects}
        planted += 1
        found += wrong in suggested
        named += suggested.get(wrong) == marking
    rows = [
        ["planted swaps found, %", 100 * found / max(planted, 1), planted],
        ["right class proposed, %", 100 * named / max(planted, 1), planted],
        ["false alarms on clean frames, %", 100 * alarms / max(len(clean), 1), len(clean)],
    ]
    print_table("Wrong labels", ("what", "value", "frames"), rows)


def _is_clean(calibration: Calibration, lines: Lines) -> bool:
    """Whether every annotated marking is visible and lies within gamma."""
    fits = {fit.marking: fit for fit in calibration.markings}
    return all(
        name in fits and fits[name].distances_px and max(fits[name].distances_px) < GAMMA_PX
        for name in lines
    )
