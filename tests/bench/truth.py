"""Does sigma mean it? Coverage of ellipsoids, silent errors and false alarms, with known truth."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.stats import chi2

from app.features.groups.solution_schemas import camera_sigma
from app.geometry.arrays import FloatArray
from app.soccer.picture import OPEN
from app.soccer.pitch import Pitch
from app.soccer.policy import PAPER, Policy
from app.soccer.solution import Ball3D, BestBall, Calibration, Solution
from app.solving.ball_noise import RayResidual
from app.solving.dataset_noise import DatasetNoise, GroupNoiseInputs, estimate_noise
from app.solving.solve import solve_group
from tests.bench.cases import SIZE, Case, Made, make_case
from tests.bench.pitches import estimate_match
from tests.bench.table import print_table

GROUPS = 150
SEED = 20261122
MATCHES = 10
WRONG_M = 0.5
INSIDE_95 = float(chi2.ppf(0.95, 3))
FOCAL_SIGMAS = 1.96

ORDINARY = Case("as assumed")
STRATA = (
    ORDINARY,
    *(Case(f"ball noise {px:g} px", ball_px=px) for px in (0.5, 2.0, 3.0)),
    Case("line errors half in common, balls 0.5 px", together=0.5, ball_px=0.5),
    Case("tele", field_m=(14.0, 22.0)),
    Case("wide, from afar", field_m=(60.0, 90.0)),
    Case("two or three clicks a line", clicks=(2, 3)),
    Case("lenses", kappa=(-0.1, 0.1)),
    Case("box noise that grows, 0.08", ball_share=0.08),
    *(Case(f"{count} views", views=(count, count)) for count in (2, 3, 4)),
    *(
        Case(f"two views, parallax {low:g}-{high:g} degrees", views=(2, 2), parallax=(low, high))
        for low, high in ((5.0, 10.0), (10.0, 30.0), (30.0, 90.0), (90.0, 180.0))
    ),
)
"""Cases in which sigma can mean it once the noise is known."""
CASES = (
    *STRATA,
    Case("line errors half in common", together=0.5),
    *(Case(f"a view {ms:g} ms later", delay_s=ms / 1000) for ms in (40.0, 80.0, 200.0)),
    Case("pitch 103 x 66", pitch=Pitch(103.0, 66.0)),
    Case("a view with swapped sides", swapped=True),
    Case("pixels 5 % wide", aspect=1.05),
    Case("principal point 10 % off", shift=0.10),
    Case("principal point 25 % off", shift=0.25),
    Case("4:3 stretched to 16:9", aspect=4 / 3),
)
ALARMS = (
    "views_contradict",
    "view_disagrees",
    "not_synchronous",
    "sides_swapped",
    "implausible_ball",
    "high_uncertainty",
    "low_parallax",
    "picture_geometry",
    "pitch_size",
)
"""Findings that tell a person not to trust the ball."""


@dataclass(frozen=True)
class Row:
    """What became of the groups of one case; shares are in per cent.

    Attributes:
        passes: Groups that pass every gate.
        wrong: Of those, how many balls are off by more than ``WRONG_M``.
        exposed: Share of wrong balls, passing or not, with a finding or a closed gate.
        alarms: Share of groups with one of ``ALARMS``.
        mean_inside: Share of the mean's 95 % ellipsoids that hold the truth.
        best_inside: The same of the most likely point.
        position: Share of cameras whose 95 % ellipsoid holds the true position.
        focal: Share of cameras whose 95 % interval holds the true focal length.
    """

    passes: int
    wrong: int
    exposed: float | None
    alarms: float
    mean_inside: float
    best_inside: float
    position: float
    focal: float


def bench_truth() -> None:
    """Print a row for each case."""
    rows: list[list[object]] = []
    strata: list[Row] = []
    for case in CASES:
        made = make_case(case, GROUPS, SEED)
        rows.append([case.name, *vars(judge(made, PAPER)).values()])
        if case.aspect != ORDINARY.aspect or case.shift != ORDINARY.shift:
            solved_so = vars(judge([with_picture(one) for one in made], PAPER))
            rows.append([f"{case.name}, solved so", *solved_so.values()])
        if case.pitch != ORDINARY.pitch:
            accepted = vars(judge(with_found_pitch(made, case), PAPER))
            rows.append([f"{case.name}, accepted as found", *accepted.values()])
        if case in STRATA or case.together:
            told = judge(made, with_noise(made))
            rows.append([f"{case.name}, noise estimated", *vars(told).values()])
            strata += [told] if case in STRATA else []
    whole = np.mean([[row.mean_inside, row.best_inside] for row in strata], axis=0).tolist()
    rest = [None] * 4
    rows.append(["all strata, noise estimated", *rest, *whole, None, None])
    header = (
        f"{GROUPS} groups each",
        "pass",
        f"of those > {WRONG_M} m",
        "wrong ones exposed %",
        "alarms %",
        "mean in 95 %",
        "best in 95 %",
        "camera in 95 %",
        "focal in 95 %",
    )
    print_table("Does sigma mean it? Generated cases with known truth", header, rows)


def judge(made: list[Made], policy: Policy) -> Row:
    """Solve groups and compare them with their truth."""
    return compare(made, [solve_group(one.group, policy) for one in made])


def compare(made: Sequence[Made], solutions: Sequence[Solution]) -> Row:
    """Solutions of groups beside their truth."""
    off = np.array([_error(s.ball, one) for s, one in zip(solutions, made, strict=True)])
    alarmed = np.array([any(f.kind in ALARMS for f in s.findings) for s in solutions])
    passes = np.array([s.passes for s in solutions])
    wrong = off > WRONG_M
    cameras = [
        (solved.calibration, camera)
        for solution, one in zip(solutions, made, strict=True)
        for solved, camera in zip(solution.views, one.cameras, strict=True)
    ]
    return Row(
        passes=int(passes.sum()),
        wrong=int((wrong & passes).sum()),
        exposed=_percent(alarmed[wrong] | ~passes[wrong]) if wrong.any() else None,
        alarms=_percent(alarmed),
        mean_inside=_percent([_holds(s.ball, one) for s, one in zip(solutions, made, strict=True)]),
        best_inside=_percent(
            [_holds(s.best_ball, one) for s, one in zip(solutions, made, strict=True)]
        ),
        position=_percent([_position_holds(found, camera.position) for found, camera in cameras]),
        focal=_percent([_focal_holds(found, camera.focal_length[1]) for found, camera in cameras]),
    )


def with_picture(made: Made) -> Made:
    """The group once somebody has said that its last view was stretched or cropped."""
    view = made.group.views[-1]
    said = replace(view, station=replace(view.station, picture=OPEN))
    return replace(made, group=made.group.with_view(said))


def with_found_pitch(made: list[Made], case: Case) -> list[Made]:
    """The groups once the sizes that matches of ten frames show were accepted, match by match."""
    estimates = (estimate_match(case, SEED + match) for match in range(MATCHES))
    proposed = (found.proposal(Pitch()) for found in estimates if found is not None)
    pitches = [pitch for pitch in proposed if pitch is not None]
    return [
        replace(one, group=replace(one.group, pitch=pitches[at % len(pitches)]))
        for at, one in enumerate(made)
    ]


def with_noise(made: list[Made]) -> Policy:
    """The policy ``paper`` with the noise that the groups themselves show."""
    seen = [GroupNoiseInputs.of(one.group, solve_group(one.group, PAPER), PAPER) for one in made]
    return noise_used(estimate_noise(seen, PAPER), replace(PAPER, name="estimated"))


def noise_used(noise: DatasetNoise, policy: Policy) -> Policy:
    """A policy with estimates, as far as there are any."""
    ball, lines = noise.ball, noise.lines
    policy = replace(
        policy,
        click_sigma_px=policy.click_sigma_px if ball.click is None else ball.click.value,
        box_sigma_share=policy.box_sigma_share if ball.share is None else ball.share,
        given_sigma_px=policy.given_sigma_px if ball.given is None else ball.given.value,
    )
    if lines is None:
        return policy
    sigma, share = lines.sigma.value, lines.share.value
    known = replace(policy.calibration, line_sigma_px=sigma, line_share=share)
    return replace(policy, calibration=known)


def misses_in(made: Made, policy: Policy) -> tuple[RayResidual, ...]:
    """What the rays to the ball of a group leave unexplained."""
    return GroupNoiseInputs.of(made.group, solve_group(made.group, policy), policy).ray_residuals(
        policy
    )


def _error(ball: Ball3D | None, made: Made) -> float:
    return np.nan if ball is None else float(np.linalg.norm(np.array(ball.point) - made.ball))


def _holds(ball: Ball3D | BestBall | None, made: Made) -> bool | None:
    if ball is None:
        return None
    return _inside(np.array(ball.point) - made.ball, np.reshape(ball.covariance, (3, 3)))


def _position_holds(found: Calibration, position: FloatArray) -> bool | None:
    if found.camera is None or found.covariance is None:
        return None
    covariance = np.reshape(found.covariance, (8, 8))[3:6, 3:6]
    return _inside(found.camera.position - position, covariance)


def _focal_holds(found: Calibration, focal: float) -> bool | None:
    sigma = camera_sigma(found, SIZE)
    if sigma is None or found.camera is None:
        return None
    return bool(abs(found.camera.focal_length[1] - focal) < FOCAL_SIGMAS * sigma.focal_px)


def _inside(off: FloatArray, covariance: FloatArray) -> bool:
    return bool(off @ np.linalg.solve(covariance, off) < INSIDE_95)


def _percent(answers: object) -> float:
    known = [bool(answer) for answer in answers if answer is not None]  # type: ignore[attr-defined]
    return 100 * float(np.mean(known)) if known else float("nan")


if __name__ == "__main__":
    bench_truth()
