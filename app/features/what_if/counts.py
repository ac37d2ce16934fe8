"""What is counted of a block of groups under a policy.

Matches whose groups lie in several splits are counted apart.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable
from dataclasses import dataclass, field

import numpy as np

from app.features.what_if.table import JAC_STEPS, YieldTable
from app.geometry.arrays import BoolArray, IntArray
from app.soccer.policy import Policy
from app.soccer.solution import GAMMAS_PERCENT, GATES
from app.solving.judgement import Judgement

DISTANCES = (0.0, 20.0, 30.0, 40.0, 50.0, 60.0, 70.0, 80.0, 100.0)
"""Where the bins of distance begin, metres; the last one has no end."""
FINDINGS = ("implausible_ball", "low_parallax")
"""Findings about the ball that follow from thresholds, though they are no gates."""


def _zeros(*shape: int) -> IntArray:
    return np.zeros(shape, np.int64)


@dataclass(frozen=True)
class GroupCounts:
    """Counts of groups.

    Attributes:
        gained: Groups that pass and do not under the present policy; ``lost`` the reverse.
        unmeasured: Groups whose cameras are given and have no lines to measure JaC.
        dropped: Groups by the first gate that they fail, the passing ones last, shape (11,).
        curves: Groups that qualify at each of ``JAC_STEPS``, for each gamma, shape (3, 101).
        distances: Groups by distance of their ball, and those that pass, those without a ball
            last, shape (2, 10).
        findings: Groups with each of ``FINDINGS``, and those of them that pass, shape (2, 2).
        splits: Groups of each split that pass.
    """

    passing: int = 0
    gained: int = 0
    lost: int = 0
    unmeasured: int = 0
    dropped: IntArray = field(default_factory=lambda: _zeros(len(GATES) + 1))
    curves: IntArray = field(default_factory=lambda: _zeros(len(GAMMAS_PERCENT), len(JAC_STEPS)))
    distances: IntArray = field(default_factory=lambda: _zeros(2, len(DISTANCES) + 1))
    findings: IntArray = field(default_factory=lambda: _zeros(len(FINDINGS), 2))
    splits: Counter[str] = field(default_factory=Counter)


def sum_counts(tallies: Iterable[GroupCounts]) -> GroupCounts:
    """All groups of several blocks."""
    total = GroupCounts()
    for counts in tallies:
        total = GroupCounts(
            total.passing + counts.passing,
            total.gained + counts.gained,
            total.lost + counts.lost,
            total.unmeasured + counts.unmeasured,
            total.dropped + counts.dropped,
            total.curves + counts.curves,
            total.distances + counts.distances,
            total.findings + counts.findings,
            total.splits + counts.splits,
        )
    return total


def count_table_groups(
    table: YieldTable,
    live: BoolArray | slice,
    policy: Policy,
    present: Judgement,
    judgement: Judgement,
    counted: GroupCounts | None = None,
) -> GroupCounts:
    """Count the groups of a block.

    Args:
        table: The block.
        live: Chooses the groups that count.
        policy: Whose thresholds the findings follow.
        present: What the present policy makes of the block.
        judgement: What this one makes of it.
        counted: What was counted under another policy: some of it is the same under each.
    """
    if counted is None:
        curves = np.stack([_curve_of_steps(steps[live]) for steps in table.steps])
        counted = GroupCounts(unmeasured=int(table.unmeasured[live].sum()), curves=curves)
    passes, before = judgement.passes[live], present.passes[live]
    split = np.bincount(table.split[live][passes], minlength=len(table.splits))
    return GroupCounts(
        passing=int(passes.sum()),
        gained=int((passes & ~before).sum()),
        lost=int((before & ~passes).sum()),
        unmeasured=counted.unmeasured,
        dropped=np.bincount(judgement.first[live], minlength=len(GATES) + 1),
        curves=counted.curves,
        distances=_count_by_distance(judgement, live),
        findings=_count_findings(table, live, policy, judgement),
        splits=Counter(dict(zip(table.splits, split.tolist(), strict=True))),
    )


def _curve_of_steps(steps: IntArray) -> IntArray:
    """A group counts at as many of the steps, from the first on, as are below its JaC."""
    counts = np.bincount(steps, minlength=len(JAC_STEPS) + 1)
    curve: IntArray = counts[::-1].cumsum()[::-1][1:]
    return curve


def _count_by_distance(judgement: Judgement, live: BoolArray | slice) -> IntArray:
    distance, passes = judgement.distance[live], judgement.passes[live]
    place = np.searchsorted(DISTANCES, distance, "right") - 1
    place[np.isnan(distance)] = len(DISTANCES)
    bins = len(DISTANCES) + 1
    return np.stack(
        [np.bincount(place, minlength=bins), np.bincount(place[passes], minlength=bins)]
    )


def _count_findings(
    table: YieldTable, live: BoolArray | slice, policy: Policy, judgement: Judgement
) -> IntArray:
    x, y, z = judgement.point.T
    half = table.pitch.T / 2
    outside = np.maximum(np.abs(x) - half[0], np.abs(y) - half[1])
    implausible = (
        (z > policy.below_grass_m) | (-z > policy.max_height_m) | (outside > policy.outside_pitch_m)
    )
    low = judgement.parallax < policy.low_parallax_degrees
    return np.array(
        [
            (found[live].sum(), (found & judgement.passes)[live].sum())
            for found in (implausible, low)
        ],
        np.int64,
    )


@dataclass(frozen=True)
class Leak:
    """A match that lies in several splits, with the number of groups in each."""

    match: str
    splits: tuple[tuple[str, int], ...]


def find_split_leaks(places: Counter[tuple[str, str]]) -> tuple[Leak, ...]:
    """Matches in several splits, by name.

    Args:
        places: How many groups each match has in each split; the empty split does not count.
    """
    found: dict[str, list[tuple[str, int]]] = {}
    for (match, split), groups in places.items():
        if split:
            found.setdefault(match, []).append((split, groups))
    several = (match for match, splits in found.items() if len(splits) > 1)
    return tuple(Leak(match, tuple(sorted(found[match]))) for match in sorted(several))
