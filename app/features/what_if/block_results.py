"""Results of one policy for a block of groups, computed in several threads, and what is counted of them."""

from __future__ import annotations

import os
from collections import Counter
from collections.abc import Callable, Iterable
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, field
from functools import cache
from threading import Lock
from typing import TypeVar

import numpy as np

from app.features.what_if.table import JAC_STEPS, YieldTable
from app.geometry.arrays import BoolArray, FloatArray, IntArray
from app.soccer.policy import Policy
from app.soccer.solution import GAMMAS_PERCENT, GATES
from app.solving.ball_3d import find_implausible_positions
from app.solving.ball_covariance import CovarianceOfMeanBall, major_axis_sigma
from app.solving.chi_square import p_values
from app.solving.facts import GroupFacts
from app.solving.judgement import (
    Judgement,
    compute_view_jac,
    find_first_failed_gates,
    find_views_in_pairs,
    judge_groups,
    judge_with_known_view_failures,
    recompare_thresholds,
    widen_covariances,
)

_NUMBERS = ("baseline", "point", "parallax", "distance")


Given = TypeVar("Given")
Made = TypeVar("Made")
DISTANCES = (0.0, 20.0, 30.0, 40.0, 50.0, 60.0, 70.0, 80.0, 100.0)
"""Where the bins of distance begin, metres; the last one has no end."""
FINDINGS = ("implausible_ball", "low_parallax")
"""Findings about the ball that follow from thresholds, though they are no gates; the ball is the mean
of the pairs also where the policy's ``point`` is ``best``, of which the facts know nothing."""


@dataclass
class BlockResults:
    """Groups under a policy; what is not asked for yet is computed when it first is.

    Attributes:
        facts: The groups.
        jac: ``compute_view_jac`` at each of ``GAMMAS_PERCENT``, shape (3, V).
        policy: By which they are judged.
        judgement: What it makes of them.
        sigma: Standard deviation along the longest axis, metres, NaN without a ball, shape (G,).
        p_value: Of the residuals, infinite where it cannot be tested, shape (G,).
        uncertainty: Kept from the first time that another noise is tried.
    """

    facts: GroupFacts
    jac: FloatArray
    policy: Policy
    judgement: Judgement
    sigma: FloatArray | None = None
    p_value: FloatArray | None = None
    uncertainty: CovarianceOfMeanBall | None = None
    lock: Lock = field(default_factory=Lock, repr=False)

    @staticmethod
    def judge_facts(facts: GroupFacts, jac: FloatArray, policy: Policy) -> BlockResults:
        """Judge groups."""
        uncertainty = CovarianceOfMeanBall(facts)
        judgement = judge_groups(
            facts, policy, uncertainty, _jac_at_policy_gamma(facts, jac, policy)
        )
        found = BlockResults(facts, jac, policy, judgement)
        if policy.max_sigma_m is not None:
            found.sigma = _mean_sigmas(facts, policy, judgement, uncertainty)
        return found

    def compute_missing(self) -> None:
        """Compute what somebody may ask for, so that nobody waits for it."""
        with self.lock:
            if self.sigma is None:
                self.sigma = _mean_sigmas(
                    self.facts, self.policy, self.judgement, CovarianceOfMeanBall(self.facts)
                )
            if self.p_value is None:
                self.p_value = _p_values(self.facts, self.policy, self.judgement)

    @property
    def nbytes(self) -> int:
        """Memory of what is kept, roughly."""
        judgement = self.judgement
        arrays = (judgement.failed, *(getattr(judgement, name) for name in _NUMBERS))
        rows = judgement.view_failed.nbytes + judgement.pair_failed.nbytes + self.jac.nbytes
        uncertainty = 0 if self.uncertainty is None else self.uncertainty.nbytes
        return int(rows + uncertainty + sum(array.nbytes for array in arrays))

    def judge_with_policy(self, policy: Policy) -> Judgement:
        """The judgement of the groups under another policy."""
        if _uses_click_noise(policy) and get_click_noise(policy) != get_click_noise(self.policy):
            jac = _jac_at_policy_gamma(self.facts, self.jac, policy)
            return judge_groups(self.facts, policy, self._get_uncertainty(), jac)
        return self._rejudge_changed_groups(policy)[0]

    def rejudge(self, policy: Policy) -> BlockResults:
        """The groups judged by another policy from now on."""
        if get_click_noise(policy) != get_click_noise(self.policy):
            return BlockResults.judge_facts(self.facts, self.jac, policy)
        judgement, new, part = self._rejudge_changed_groups(policy)
        found = BlockResults(self.facts, self.jac, policy, judgement)
        if self.sigma is not None and self.p_value is not None:
            found.sigma, found.p_value = self.sigma.copy(), self.p_value.copy()
            if part is not None:
                part.compute_missing()
                found.sigma[new], found.p_value[new] = part.sigma, part.p_value
        return found

    def _rejudge_changed_groups(
        self, policy: Policy
    ) -> tuple[Judgement, BoolArray, BlockResults | None]:
        """The judgement, which groups had to be judged anew, and those by themselves."""
        facts, known = self.facts, self.judgement
        jac = _jac_at_policy_gamma(facts, self.jac, policy)
        view_failed, pair_failed = find_first_failed_gates(facts, jac, policy)
        new = np.zeros(facts.groups, bool)
        new[facts.view_group[np.flatnonzero(view_failed != known.view_failed)]] = True
        new[facts.pair_group[np.flatnonzero(pair_failed != known.pair_failed)]] = True
        failed = recompare_thresholds(known, policy, *self._sigmas_and_p_values(policy))
        numbers = [getattr(known, name) for name in _NUMBERS]
        part = None
        if new.any():
            some = facts.part(new)
            views, pairs = new[facts.view_group], new[facts.pair_group]
            standing = view_failed[views], pair_failed[pairs]
            uncertainty = CovarianceOfMeanBall(some)
            found = judge_with_known_view_failures(
                some, policy, uncertainty, jac[views], standing, first_alone=True
            )
            failed[:, new] = found.failed
            numbers = [array.copy() for array in numbers]
            for array, name in zip(numbers, _NUMBERS, strict=True):
                array[new] = getattr(found, name)
            part = BlockResults(some, self.jac, policy, found)
        return Judgement(jac, view_failed, pair_failed, failed, *numbers), new, part

    def _sigmas_and_p_values(self, policy: Policy) -> tuple[FloatArray | None, FloatArray | None]:
        """Sigmas and p-values, where the policy asks for them."""
        with self.lock:
            if policy.max_sigma_m is not None and self.sigma is None:
                uncertainty = self.uncertainty or CovarianceOfMeanBall(self.facts)
                self.sigma = _mean_sigmas(self.facts, self.policy, self.judgement, uncertainty)
            if policy.min_p_value is not None and self.p_value is None:
                self.p_value = _p_values(self.facts, self.policy, self.judgement)
        return (
            None if policy.max_sigma_m is None else self.sigma,
            None if policy.min_p_value is None else self.p_value,
        )

    def _get_uncertainty(self) -> CovarianceOfMeanBall:
        with self.lock:
            if self.uncertainty is None:
                self.uncertainty = CovarianceOfMeanBall(self.facts)
        return self.uncertainty


def get_click_noise(policy: Policy) -> tuple[float, float, float]:
    """How exact clicks are taken to be."""
    return policy.click_sigma_px, policy.box_sigma_share, policy.given_sigma_px


def _uses_click_noise(policy: Policy) -> bool:
    """Whether it asks for what depends on the noise of clicks."""
    return policy.max_sigma_m is not None or policy.min_p_value is not None


def _jac_at_policy_gamma(facts: GroupFacts, jac: FloatArray, policy: Policy) -> FloatArray:
    gamma = policy.jac_gamma_percent
    if gamma in GAMMAS_PERCENT:
        known: FloatArray = jac[GAMMAS_PERCENT.index(gamma)]
        return known
    return compute_view_jac(facts, gamma)


def _mean_sigmas(
    facts: GroupFacts, policy: Policy, judgement: Judgement, uncertainty: CovarianceOfMeanBall
) -> FloatArray:
    there = np.flatnonzero(~np.isnan(judgement.point[:, 0]))
    point = judgement.point
    covariances = uncertainty.covariances(judgement.valid, there, point[there], policy)
    covariances = widen_covariances(facts, judgement.valid, there, covariances, point, policy)
    sigma = np.full(facts.groups, np.nan)
    sigma[there] = major_axis_sigma(covariances)
    return sigma


def _p_values(facts: GroupFacts, policy: Policy, judgement: Judgement) -> FloatArray:
    return p_values(facts, find_views_in_pairs(facts, judgement.valid), judgement.point, policy)


def map_in_threads(work: Callable[[Given], Made], items: Iterable[Given]) -> list[Made]:
    """What a function makes of each item, in their order; arrays of some size let others run."""
    given = list(items)
    if len(given) < 2:
        return [work(item) for item in given]
    return list(_thread_pool().map(work, given))


@cache
def _thread_pool() -> ThreadPoolExecutor:
    return ThreadPoolExecutor(os.cpu_count() or 1, thread_name_prefix="yield")


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


def sum_group_counts(tallies: Iterable[GroupCounts]) -> GroupCounts:
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
        curves = np.stack([_make_threshold_curve(steps[live]) for steps in table.steps])
        counted = GroupCounts(unmeasured=int(table.unmeasured[live].sum()), curves=curves)
    passes, before = judgement.passing_groups[live], present.passing_groups[live]
    split = np.bincount(table.split[live][passes], minlength=len(table.splits))
    return GroupCounts(
        passing=int(passes.sum()),
        gained=int((passes & ~before).sum()),
        lost=int((before & ~passes).sum()),
        unmeasured=counted.unmeasured,
        dropped=np.bincount(judgement.first_failed_gates[live], minlength=len(GATES) + 1),
        curves=counted.curves,
        distances=_count_by_distance(judgement, live),
        findings=_count_findings(table, live, policy, judgement),
        splits=Counter(dict(zip(table.splits, split.tolist(), strict=True))),
    )


def _make_threshold_curve(steps: IntArray) -> IntArray:
    """A group counts at as many of the steps, from the first on, as are below its JaC."""
    counts = np.bincount(steps, minlength=len(JAC_STEPS) + 1)
    curve: IntArray = counts[::-1].cumsum()[::-1][1:]
    return curve


def _count_by_distance(judgement: Judgement, live: BoolArray | slice) -> IntArray:
    distance, passes = judgement.distance[live], judgement.passing_groups[live]
    place = np.searchsorted(DISTANCES, distance, "right") - 1
    place[np.isnan(distance)] = len(DISTANCES)
    bins = len(DISTANCES) + 1
    return np.stack(
        [np.bincount(place, minlength=bins), np.bincount(place[passes], minlength=bins)]
    )


def _count_findings(
    table: YieldTable, live: BoolArray | slice, policy: Policy, judgement: Judgement
) -> IntArray:
    implausible = find_implausible_positions(judgement.point, table.pitch, policy)
    low = judgement.parallax < policy.low_parallax_degrees
    return np.array(
        [
            (found[live].sum(), (found & judgement.passing_groups)[live].sum())
            for found in (implausible, low)
        ],
        np.int64,
    )


@dataclass(frozen=True)
class SplitLeak:
    """A match that lies in several splits, with the number of groups in each."""

    match: str
    splits: tuple[tuple[str, int], ...]


def find_split_leaks(places: Counter[tuple[str, str]]) -> tuple[SplitLeak, ...]:
    """Matches in several splits, by name.

    Args:
        places: How many groups each match has in each split; the empty split does not count.
    """
    found: dict[str, list[tuple[str, int]]] = {}
    for (match, split), groups in places.items():
        if split:
            found.setdefault(match, []).append((split, groups))
    several = (match for match, splits in found.items() if len(splits) > 1)
    return tuple(SplitLeak(match, tuple(sorted(found[match]))) for match in sorted(several))
