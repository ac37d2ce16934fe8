"""Yields: what a policy lets through, gate by gate, and what another one would."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any, ClassVar

from app.features.what_if.block_results import (
    DISTANCES,
    FINDINGS,
    GroupCounts,
    SplitLeak,
    find_split_leaks,
    get_click_noise,
    map_in_threads,
    sum_group_counts,
)
from app.features.what_if.service import TableBlock, TableSnapshot, WhatIfStore
from app.features.what_if.table import JAC_STEPS
from app.geometry.arrays import IntArray
from app.soccer.policy import BOXES, CALIBRATION, PITCH, Policy
from app.soccer.solution import GAMMAS_PERCENT, GATES
from app.soccer.thresholds import THRESHOLDS

UNSOLVED = "unsolved"
"""Step of the funnel before the gates: groups that nobody has solved yet."""
WITHOUT_EFFECT = frozenset({BOXES, PITCH})
"""Subjects of thresholds that decide about boxes and new imports, and about no gate."""
ANSWERED = tuple(
    threshold for threshold in THRESHOLDS if threshold.subject not in WITHOUT_EFFECT | {CALIBRATION}
)
"""Thresholds that the table answers for: gates and the findings about the ball."""


@dataclass(frozen=True)
class FunnelStep:
    """One step of the funnel: how many groups are left after it, and how many it dropped."""

    gate: str
    left: int
    dropped: int


@dataclass(frozen=True)
class ThresholdCurve:
    """Groups with the ball in two views or more that qualify, against the JaC threshold."""

    gamma_percent: float
    groups: tuple[int, ...]
    thresholds: ClassVar = JAC_STEPS


@dataclass(frozen=True)
class YieldBreakdownRow:
    """Groups of one split, one bin of distance or with one finding, and how many pass."""

    name: str
    groups: int
    passing: int
    low: float | None = None
    high: float | None = None


@dataclass(frozen=True)
class Yield:
    """What a policy lets through.

    Attributes:
        funnel: Every group by its first failing gate; the steps lead from all to passing.
        given_not_measured: Groups whose cameras are given and have no lines to measure JaC.
        gained: Groups that pass and do not under the present policy; ``lost`` the reverse.
        needs_solving: Fields whose effect only solving again can tell; they are as before here.
    """

    policy: Policy
    groups: int
    passing: int
    unsolved: int
    funnel: tuple[FunnelStep, ...]
    given_not_measured: int
    curves: tuple[ThresholdCurve, ...]
    splits: tuple[YieldBreakdownRow, ...]
    distances: tuple[YieldBreakdownRow, ...]
    findings: tuple[YieldBreakdownRow, ...]
    leakage: tuple[SplitLeak, ...]
    gained: int
    lost: int
    needs_solving: tuple[str, ...]


def count_yield(
    yields: WhatIfStore, dataset_id: int, values: Mapping[str, Any] | None = None
) -> Yield:
    """What a dataset's policy lets through, or what it would with other values.

    Args:
        yields: The tables.
        dataset_id: The dataset.
        values: Fields of ``Policy`` that shall differ; ``calibration`` is a mapping of its own.

    Raises:
        NotFoundError: There is no such dataset.
    """
    snapshot = yields.get_snapshot(dataset_id)
    policy = _apply_threshold_values(snapshot.policy, values or {})
    unanswered = list_thresholds_that_need_solving(snapshot.policy, policy)
    same = all(item.value(policy) == item.value(snapshot.policy) for item in ANSWERED)

    def count_block(block: TableBlock) -> GroupCounts:
        return block.present_counts if same else block.count_under_policy(policy)

    # Who tries another noise judges every group anew; else threads would wait for each other.
    side_by_side = get_click_noise(policy) != get_click_noise(snapshot.policy)
    total = sum_group_counts(
        (map_in_threads if side_by_side else map)(count_block, snapshot.blocks)
    )
    return _make_yield(snapshot, policy, total, unanswered)


def list_thresholds_that_need_solving(present: Policy, tried: Policy) -> tuple[str, ...]:
    """Names of thresholds that differ and that the table cannot answer for."""
    return tuple(
        item.name
        for item in THRESHOLDS
        if item.subject == CALIBRATION and item.value(present) != item.value(tried)
    )


def _apply_threshold_values(policy: Policy, values: Mapping[str, Any]) -> Policy:
    values = dict(values)
    calibration = replace(policy.calibration, **values.pop("calibration", {}))
    return replace(policy, **{**values, "calibration": calibration})


def _make_yield(
    snapshot: TableSnapshot, policy: Policy, total: GroupCounts, unanswered: tuple[str, ...]
) -> Yield:
    return Yield(
        policy=policy,
        groups=snapshot.solved_count + snapshot.unsolved_count,
        passing=total.passing,
        unsolved=snapshot.unsolved_count,
        funnel=_funnel_steps(snapshot, total.dropped, policy),
        given_not_measured=total.unmeasured,
        curves=tuple(
            ThresholdCurve(gamma, tuple(counts.tolist()))
            for gamma, counts in zip(GAMMAS_PERCENT, total.curves, strict=True)
        ),
        splits=_yield_by_split(snapshot, total),
        distances=_yield_by_distance(snapshot, total),
        findings=tuple(
            YieldBreakdownRow(kind, groups, passing)
            for kind, (groups, passing) in zip(FINDINGS, total.findings.tolist(), strict=True)
        ),
        leakage=find_split_leaks(snapshot.counts_by_match_and_split),
        gained=total.gained,
        lost=total.lost,
        needs_solving=unanswered,
    )


def _funnel_steps(
    snapshot: TableSnapshot, dropped: IntArray, policy: Policy
) -> tuple[FunnelStep, ...]:
    """Gates that the policy asks for, in order, after the groups that are not solved."""
    inactive = {
        "agreement": policy.min_agreement is None,
        "parallax": policy.min_parallax_degrees is None,
        "sigma": policy.max_sigma_m is None,
        "chi_square": policy.min_p_value is None,
    }
    left, steps = snapshot.solved_count, []
    if snapshot.unsolved_count:
        steps.append(FunnelStep(UNSOLVED, left, snapshot.unsolved_count))
    for place, gate in enumerate(GATES):
        if not inactive.get(gate, False):
            left -= int(dropped[place])
            steps.append(FunnelStep(gate, left, int(dropped[place])))
    return tuple(steps)


def _yield_by_split(snapshot: TableSnapshot, total: GroupCounts) -> tuple[YieldBreakdownRow, ...]:
    everyone: Counter[str] = Counter()
    for (_, split), groups in snapshot.counts_by_match_and_split.items():
        everyone[split] += groups
    return tuple(
        YieldBreakdownRow(split, groups, total.splits[split])
        for split, groups in sorted(everyone.items())
    )


def _yield_by_distance(
    snapshot: TableSnapshot, total: GroupCounts
) -> tuple[YieldBreakdownRow, ...]:
    """By distance of the ball; groups that have none under the policy stand apart, last."""
    groups, passing = total.distances.tolist()
    groups[-1] += snapshot.unsolved_count
    ends: list[float | None] = [*DISTANCES[1:], None, None]
    return tuple(
        YieldBreakdownRow("", groups[bin_], passing[bin_], low, ends[bin_])
        for bin_, low in enumerate([*DISTANCES, None])
    )
