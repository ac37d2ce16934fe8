"""How often does one picture alone tell that it was stretched or cropped, and how often could it?

What a deformation changes beyond all cameras is the noncentrality of every test of it: the squared
distances, in units of the noise, that the best camera leaves of clicks without noise. The best test
that knows the noise, and which of the three numbers changed, is that of Neyman and Pearson; one
that knows the noise but not which number is chi-square with three degrees of freedom.

Source: Kay, "Detection theory" (1998), secs. 3.3 and 6.5.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from scipy.stats import chi2, ncx2, norm

from app.geometry.resection import KAPPA
from app.soccer.annotation import Lines
from app.soccer.pitch import Pitch
from app.soccer.policy import PAPER, CalibrationPolicy
from app.solving.calibrate import calibrate
from app.solving.observations import make_observations
from app.solving.resect import ResectionProblem
from tests.bench.cases import SIZE, Case, Made, make_case
from tests.bench.table import print_table

FRAMES, SEED = 150, 20261122
ALARMS = 0.005
"""Share of pictures as they were taken that a test may call deformed."""
QUIET_PX = 1e-6
WIDE_PX = 1e4
"""Scale of the robust loss at which it counts squares."""
MEASURED = replace(PAPER.calibration, line_sigma_px=0.6, line_share=0.0)
"""What ``touchline noise`` says of these clicks, pixels at 960 x 540."""
CASES = (
    Case("as it was taken"),
    Case("as it was taken, line errors half in common", together=0.5),
    Case("pixels 5 % wide", aspect=1.05),
    Case("4:3 stretched to 16:9", aspect=4 / 3),
    Case("16:9 squeezed to 4:3", aspect=3 / 4),
    Case("axis 10 % of the width aside", shift=0.10),
    Case("axis 25 % of the width aside", shift=0.25),
)


def bench_picture_power() -> None:
    """Print a row for each case."""
    rows = []
    for case in CASES:
        noisy = make_case(replace(case, views=(2, 2)), FRAMES, SEED)
        clean = make_case(replace(case, views=(2, 2), line_px=QUIET_PX), FRAMES, SEED)
        found, measured = (
            [_is_found(one.group.views[-1].station.lines, policy) for one in noisy]
            for policy in (PAPER.calibration, MEASURED)
        )
        moved = np.array([_noncentrality(one, case.line_px) for one in clean])
        knows = norm.sf(norm.isf(ALARMS / 2) - np.sqrt(moved))
        three = ncx2.sf(chi2.isf(ALARMS, 3), 3, np.maximum(moved, 1e-9))
        shares = [
            float(np.mean(found)),
            float(np.mean(measured)),
            float(np.mean(three)),
            float(np.mean(knows)),
        ]
        rows.append([case.name, *(100 * share for share in shares)])
    header = (
        f"{FRAMES} pictures, {100 * ALARMS:g} % alarms",
        "found %",
        "noise of the lines measured %",
        "best test of three numbers %",
        "best test of the right one %",
    )
    print_table("One picture alone: stretched or cropped?", header, rows)


def _is_found(lines: Lines, policy: CalibrationPolicy) -> bool:
    return calibrate(lines, Pitch(), SIZE, policy).picture is not None


def _noncentrality(made: Made, sigma_px: float) -> float:
    """What no camera explains of the last view's clicks, in squared sigmas."""
    policy = replace(PAPER.calibration, robust_scale_px=WIDE_PX)
    problem = ResectionProblem.of(SIZE, policy)
    observations = make_observations(made.group.views[-1].station.lines, Pitch(), SIZE)
    parameters = problem.resect(observations).parameters
    bend = (parameters[KAPPA] - policy.distortion_mean) / policy.distortion_sigma
    apart = problem.distances(parameters, observations) / sigma_px
    return float(apart @ apart + bend**2)


if __name__ == "__main__":
    bench_picture_power()
