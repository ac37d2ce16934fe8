"""Does sigma mean it where two people work unlike each other? Balls of 0.7 and of 2.5 px."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from app.soccer.policy import Policy
from app.solving.dataset_noise import BallSource, SourceNoiseFactors, estimate_source_noise
from tests.bench.cases import Case, Made, make_case
from tests.bench.table import print_table
from tests.bench.truth import GROUPS, SEED, judge, misses_in, with_noise

CASE = Case("two people")
PEOPLE: Mapping[str, float] = {"careful": 0.7, "hasty": 2.5}
"""Noise of a ball that each of them places, pixels at 1920 x 1080."""
Placed = list[tuple[Made, tuple[str, ...]]]
"""Groups, and who placed the ball of each view."""


def bench_annotators() -> None:
    """Print a row for each of the two, and for groups of both, twice each."""
    parts = {name: [(one, (name,) * 4) for one in made] for name, made in _alone().items()}
    parts["both"] = _mixed()
    placed = [item for part in parts.values() for item in part]
    policy = with_noise([made for made, _ in placed])
    factors = _factors(placed, policy)
    rows = []
    for name, part in parts.items():
        own = [_with_own(made, people, factors) for made, people in part]
        for how, made in (("dataset's", [made for made, _ in part]), ("their own", own)):
            row = judge(made, policy)
            rows.append([name, how, row.alarms, row.mean_inside, row.best_inside])
    for item in factors.noise_of_kind("person"):
        rows.append([f"{item.source}: {item.low:.2f} to {item.high:.2f} px", *[None] * 4])
    title = f"Two people, balls of 0.7 and 2.5 px; the dataset's {policy.click_sigma_px:.2f} px"
    print_table(
        title, (f"{GROUPS} groups each", "sigma", "alarms %", "mean in 95 %", "best in 95 %"), rows
    )


def _alone() -> dict[str, list[Made]]:
    return {
        name: make_case(replace(CASE, ball_px=px), GROUPS, SEED + at)
        for at, (name, px) in enumerate(PEOPLE.items())
    }


def _mixed() -> Placed:
    """Groups whose views are placed by either, at random."""
    rng = np.random.default_rng(SEED)
    by = {
        name: make_case(replace(CASE, ball_px=px), GROUPS, SEED + 2) for name, px in PEOPLE.items()
    }
    mixed: Placed = []
    for at, made in enumerate(by["careful"]):
        people = tuple(rng.choice([*PEOPLE], len(made.group.views)).tolist())
        views = tuple(by[name][at].group.views[place] for place, name in enumerate(people))
        mixed.append((replace(made, group=replace(made.group, views=views)), people))
    return mixed


def _factors(placed: Placed, policy: Policy) -> SourceNoiseFactors:
    seen = [
        (
            miss,
            {
                v.key: [BallSource("person", of)]
                for v, of in zip(made.group.views, people, strict=False)
            },
        )
        for made, people in placed
        for miss in misses_in(made, policy)
    ]
    return estimate_source_noise(seen, policy.click_sigma_px, policy.box_sigma_share, 0.0)


def _with_own(made: Made, people: tuple[str, ...], factors: SourceNoiseFactors) -> Made:
    views = tuple(
        replace(view, noise=factors.noise_factor([BallSource("person", of)]))
        for view, of in zip(made.group.views, people, strict=False)
    )
    return replace(made, group=replace(made.group, views=views))


if __name__ == "__main__":
    bench_annotators()
