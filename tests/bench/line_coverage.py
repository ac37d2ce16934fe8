"""Do cameras mean their covariance? A left-out marking against where the others' camera puts it.

Each marking of each frame is left out in turn. What its points are off the camera of the others,
by the sigma of the camera there and of a click, should lie within 1.96 in 95 of 100 cases, and
all points of a marking together within chi-square's 95 %. ``python -m tests.bench.line_coverage 3``
takes every third real frame.
"""

from __future__ import annotations

import os
import sys
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from scipy.stats import chi2

from app.errors import DegenerateGeometryError
from app.formats.report import ReaderReport
from app.formats.sn_calibration_reader import read_line_files
from app.geometry.arrays import FloatArray
from app.geometry.resection import curve_residuals
from app.soccer.annotation import Lines, make_lines
from app.soccer.frames import ImageSize
from app.soccer.pitch import CIRCLES, Pitch
from app.soccer.policy import CalibrationPolicy
from app.soccer.solution import Calibration
from app.solving.calibrate import calibrate
from app.solving.dataset_noise import collect_view_line_evidence, estimate_view_line_noise
from app.solving.line_noise import LineEvidence, estimate_line_noise
from app.solving.observations import make_observations
from app.solving.resect import ResectionProblem
from tests.bench.cases import SIZE as MADE_SIZE
from tests.bench.cases import Case, make_case
from tests.bench.table import print_table

SIZE = ImageSize(960, 540)
PITCH = Pitch()
SIGMAS, UNLIKELY = 1.96, 3.29
"""Chance alone makes 5 % of residuals, and one of a thousand, larger."""
GROUPS, SEED = 40, 20261123
EVERY = 1
KINDS: Mapping[str, Callable[[str], bool]] = {
    "circles": lambda name: name in CIRCLES,
    "side lines": lambda name: name.startswith("Side"),
    "penalty areas": lambda name: name.startswith("Big rect"),
    "goal areas": lambda name: name.startswith("Small rect"),
    "goals": lambda name: name.startswith("Goal"),
    "middle line": lambda name: name == "Middle line",
}


@dataclass(frozen=True)
class LeftOut:
    """A marking as the camera of the others predicts it.

    Attributes:
        marking: Its name.
        residuals: Signed distances of its points, pixels, shape (N,).
        camera: Their covariance by that of the camera, square pixels, shape (N, N).
        clicks: Variance of a click, square pixels.
        share: Of it, what the points of a marking have in common.
    """

    marking: str
    residuals: FloatArray
    camera: FloatArray
    clicks: float
    share: float

    @property
    def normalised(self) -> FloatArray:
        """Each residual by its sigma, without a sign, shape (N,)."""
        found: FloatArray = np.abs(self.residuals) / np.sqrt(np.diag(self.camera) + self.clicks)
        return found

    @property
    def holds(self) -> bool:
        """Whether all residuals together lie within their 95 %."""
        count = len(self.residuals)
        clicks = self.clicks * ((1 - self.share) * np.eye(count) + self.share)
        square = self.residuals @ np.linalg.solve(self.camera + clicks, self.residuals)
        return bool(square < chi2.ppf(0.95, count))


def bench_line_coverage(data: Path, every: int = EVERY) -> None:
    """Print the tables: real frames where there are any, and generated ones."""
    path = data / "sn22-dev" / "lines.zip"
    if path.is_file():
        frames = [file.lines for file in read_line_files(path, SIZE, ReaderReport())][::every]
        _bench(f"{len(frames)} real frames", frames, SIZE)
    else:
        print(f"\nLeft-out markings of real frames: no data in {data}, left out")
    for case in (Case("errors independent"), Case("half in common", together=0.5)):
        made = make_case(case, GROUPS, SEED)
        views = [view.station.lines for one in made for view in one.group.views]
        _bench(f"{len(views)} generated frames, {case.name}", views, MADE_SIZE)


def left_out(
    lines: Lines, size: ImageSize, policies: Sequence[CalibrationPolicy]
) -> Iterator[list[LeftOut]]:
    """Each marking of a frame that the camera of the others predicts, once for each policy.

    Policies differ in the noise of lines alone, which moves no camera. Left aside are cameras that
    the others do not determine, and a marking whose label they doubt where all are used: the
    camera does without it then.
    """
    whole = calibrate(lines, PITCH, size, policies[0])
    for marking in _used(whole, lines):
        rest = make_lines({name: points for name, points in lines.items() if name != marking})
        found = calibrate(rest, PITCH, size, policies[0])
        if found.camera is None or found.covariance is None or found.unobservable:
            continue
        seen = make_observations(make_lines({marking: lines[marking]}), PITCH, size)
        parameters = ResectionProblem.of(size, policies[0]).parameters(found.camera)
        half = size.diagonal / 2
        offsets, slopes = curve_residuals(parameters, seen.curves, seen.curve_points(), half)
        told = []
        for policy in policies:
            noise = estimate_view_line_noise(found, _used(found, rest), PITCH, size, policy)
            carried = slopes[:, 0] @ noise.parameters @ slopes[:, 0].T
            told.append(LeftOut(marking, offsets[:, 0], carried, noise.variance, noise.share))
        yield told


def with_noise(frames: Sequence[Lines], size: ImageSize) -> CalibrationPolicy:
    """The policy with the noise of lines that all frames together show, as it is accepted."""
    policy = CalibrationPolicy()
    found = estimate_line_noise([*_evidence(frames, size, policy)])
    assert found is not None
    return replace(policy, line_sigma_px=found.sigma.value, line_share=found.share.value)


def _evidence(
    frames: Sequence[Lines], size: ImageSize, policy: CalibrationPolicy
) -> Iterator[LineEvidence]:
    for lines in frames:
        found = calibrate(lines, PITCH, size, policy)
        try:
            yield collect_view_line_evidence(found, _used(found, lines), PITCH, size, policy)
        except DegenerateGeometryError:
            continue


def _used(found: Calibration, lines: Lines) -> Lines:
    doubted = {suspect.marking for suspect in found.suspects}
    return make_lines({name: at for name, at in lines.items() if name not in doubted})


def _bench(title: str, frames: Sequence[Lines], size: ImageSize) -> None:
    noise = with_noise(frames, size)
    policies = {"each frame by itself": CalibrationPolicy(), "noise estimated": noise}
    told = [items for lines in frames for items in left_out(lines, size, [*policies.values()])]
    rows: list[list[object]] = []
    for name, found in zip(policies, zip(*told, strict=True), strict=True):
        rows.append([f"{name}: all", *_figures(found)])
        rows += [
            [f"    {kind}", *_figures(chosen)]
            for kind, belongs in KINDS.items()
            if (chosen := [item for item in found if belongs(item.marking)])
        ]
    header = (
        "left-out markings",
        "markings",
        "points",
        "points in 95 %",
        "each marking's share",
        "markings in 95 %",
        "95th percentile by normal's",
        "p < 0.001, %",
        "camera px",
        "click px",
    )
    estimated = f"{noise.line_sigma_px:.2f} px at 960 x 540, {noise.line_share:.2f} in common"
    print_table(f"Do cameras mean their covariance? {title}; noise {estimated}", header, rows)


def _figures(found: Sequence[LeftOut]) -> list[object]:
    by_marking = [item.normalised for item in found]
    every = np.concatenate(by_marking)
    cameras = np.concatenate([np.diag(item.camera) for item in found])
    return [
        len(found),
        len(every),
        100 * float((every < SIGMAS).mean()),
        100 * float(np.mean([(item < SIGMAS).mean() for item in by_marking])),
        100 * float(np.mean([item.holds for item in found])),
        float(np.percentile(every, 95)) / SIGMAS,
        100 * float((every > UNLIKELY).mean()),
        float(np.sqrt(np.median(cameras))),
        float(np.sqrt(np.median([item.clicks for item in found]))),
    ]


if __name__ == "__main__":
    bench_line_coverage(
        Path(os.environ.get("TOUCHLINE_REAL_DATA", "../shared/data")), *map(int, sys.argv[1:])
    )
