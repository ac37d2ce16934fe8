"""Are ISSIA's rays as far apart as sigma says? Each gap in units of its sigma, against chi-square.

Two views leave one number: the gap of their rays by its sigma. Its mean square should be one and
its 95th percentile 1.96, whatever is known of the cameras' errors.
"""

from __future__ import annotations

import os
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from app.formats.issia_reader import IssiaOptions, open_issia
from app.formats.report import ReaderReport
from app.geometry.camera import Camera
from app.soccer.annotation import make_lines
from app.soccer.group import Group, Station
from app.soccer.pitch import Pitch
from app.soccer.policy import PAPER, Policy
from app.solving.ball_noise import RayResidual, compute_ray_residuals, estimate_ball_noise
from app.solving.dataset_noise import BallSource, SourceNoiseFactors, estimate_source_noise
from app.solving.rig import RigCamera, RigFrame
from app.solving.rig_proposal import propose_rig
from app.solving.solve import solve_group
from app.solving.triangulate import collect_ball_observations
from tests.bench.table import print_table

PERCENTILE, EXPECTED = 95, 1.96
"""Of the absolute value of a standard normal number."""
UNLIKELY = 3.29
"""Chance alone makes a gap as large in one of a thousand."""
BLOCK = 50
"""Instants of one block; a noise is estimated on every other block and judged on those between."""


def bench_rigs(data: Path) -> None:
    """Print the table."""
    options = IssiaOptions(lines=data / "issia-lines")
    every = list(open_issia(data / "issia", options, ReaderReport()).groups())
    pairs = [group for group in every if sum(view.ball is not None for view in group.views) == 2]
    groups = [without_lines(group) for group in pairs]
    learnt, judged = ([one for one in groups if _odd(one) == odd] for odd in (False, True))
    noise, factors = learn_noise(learnt)
    proposal = propose_rig(*rig_of([one for one in every if not _odd(one)]), Pitch(), PAPER)
    spreads = {change.key: change.covariance_before for change in proposal.cameras}
    adjusted = {change.key: (change.after, change.covariance) for change in proposal.cameras}
    rigged = [with_cameras(one, adjusted) for one in judged]
    rows = [
        _row("cameras exact, policy paper", judged, PAPER),
        _row("noise of given cameras, estimated", judged, noise),
        _row("the same, camera by camera", [with_factors(one, factors) for one in judged], noise),
        _row(
            "covariance of the rig accepted", [with_spread(one, spreads) for one in judged], PAPER
        ),
        _row("cameras of the rig accepted", rigged, PAPER),
    ]
    header = (
        "ISSIA, gaps by their sigma",
        "balls",
        "sigma m, median",
        "root mean square",
        "95th percentile",
        "by chi-square's",
        "p < 0.001, %",
    )
    print_table("Do ISSIA's rays miss each other as sigma says? (odd blocks of 50)", header, rows)


def _odd(group: Group) -> bool:
    return int(group.key) // BLOCK % 2 == 1


def without_lines(group: Group) -> Group:
    """The group with its cameras as they were given."""
    return _with_stations(group, lambda station: replace(station, lines=make_lines({})))


def with_spread(group: Group, spreads: Mapping[str, tuple[float, ...] | None]) -> Group:
    """The group with what is known of its cameras' errors."""
    return _with_stations(
        group, lambda station: replace(station, given_covariance=spreads.get(station.key))
    )


def with_cameras(group: Group, cameras: Mapping[str, tuple[Camera, tuple[float, ...]]]) -> Group:
    """The group with other cameras and what is known of their errors."""

    def change(station: Station) -> Station:
        if station.key not in cameras:
            return station
        camera, covariance = cameras[station.key]
        return replace(station, given=camera, given_covariance=covariance)

    return _with_stations(group, change)


def with_factors(group: Group, factors: SourceNoiseFactors) -> Group:
    """The group with each camera's own noise."""
    views = tuple(
        replace(view, noise=factors.noise_factor([BallSource("camera", view.station.key)]))
        for view in group.views
    )
    return replace(group, views=views)


def learn_noise(groups: Sequence[Group]) -> tuple[Policy, SourceNoiseFactors]:
    """The policy ``paper`` with the noise of given cameras that groups show, and each camera's."""
    seen = [(miss, _cameras(group)) for group in groups for miss in _misses(group)]
    found = estimate_ball_noise([miss for miss, _ in seen], PAPER)
    assert found.given is not None
    given = found.given.value
    factors = estimate_source_noise(seen, PAPER.click_sigma_px, PAPER.box_sigma_share, given)
    return replace(PAPER, given_sigma_px=given), factors


def rig_of(groups: Sequence[Group]) -> tuple[list[RigCamera], list[RigFrame]]:
    """Static cameras and instants as they are adjusted together."""
    stations = {view.station.key: view.station for group in groups for view in group.views}
    cameras = [
        RigCamera(key, station.size, station.lines, station.given)
        for key, station in sorted(stations.items())
    ]
    frames = [
        RigFrame(
            int(group.key),
            {view.station.key: view.ball.center for view in group.views if view.ball is not None},
        )
        for group in groups
    ]
    return cameras, frames


def _row(name: str, groups: Sequence[Group], policy: Policy) -> list[object]:
    solutions = [solve_group(group, policy) for group in groups]
    seen = [one for one in solutions if one.passes and one.chi_square is not None]
    gaps = np.sqrt([one.chi_square.value for one in seen if one.chi_square is not None])
    sigma = float(np.median([one.ball.sigma_m for one in seen if one.ball is not None]))
    percentile = float(np.percentile(gaps, PERCENTILE))
    contradict = 100 * float((gaps > UNLIKELY).mean())
    mean_square = float(np.sqrt(np.mean(gaps**2)))
    return [name, len(seen), sigma, mean_square, percentile, percentile / EXPECTED, contradict]


def _cameras(group: Group) -> dict[str, list[BallSource]]:
    return {view.key: [BallSource("camera", view.station.key)] for view in group.views}


def _misses(group: Group) -> tuple[RayResidual, ...]:
    solution = solve_group(group, PAPER)
    if solution.ball is None:
        return ()
    calibrations = [view.calibration for view in solution.views]
    return compute_ray_residuals(
        solution.ball, collect_ball_observations(group.views, calibrations)
    )


def _with_stations(group: Group, change: Callable[[Station], Station]) -> Group:
    views = tuple(replace(view, station=change(view.station)) for view in group.views)
    return replace(group, views=views)


if __name__ == "__main__":
    bench_rigs(Path(os.environ.get("TOUCHLINE_REAL_DATA", "../shared/data")))
