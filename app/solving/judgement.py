"""Judgement: what a policy makes of facts, all groups at once."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from app.geometry.arrays import BoolArray, FloatArray, IntArray
from app.geometry.triangulation import parallax_angle
from app.soccer.policy import Policy
from app.soccer.solution import GATES
from app.solving.ball_covariance import CovarianceOfMeanBall, is_covariance_within, is_sigma_within
from app.solving.chi_square import fit_balls_and_test_residuals, p_values
from app.solving.facts import GroupFacts

MIN_VIEWS = 2
PASSES = len(GATES)
"""Stands for the first failing gate of what fails none."""
(
    _CALIBRATABLE,
    _JAC,
    _AGREEMENT,
    _TWO_VIEWS,
    _BALL,
    _BASELINE,
    _REPROJECTION,
    _PARALLAX,
    _SIGMA,
    _CHI_SQUARE,
) = range(PASSES)


@dataclass(frozen=True)
class Judgement:
    """What a policy makes of groups (G), their views (V) and pairs (P); gates are indices.

    Attributes:
        jac: Of each view at the policy's gamma, NaN where it cannot be measured, shape (V,).
        view_failed: First gate that drops an included view, or ``PASSES``, bytes, shape (V,).
        pair_failed: First gate that makes a pair invalid, or ``PASSES``, bytes, shape (P,).
        failed: Whether a group fails a gate that the policy asks for, shape (10, G).
        baseline: Widest of the views that are left, metres, 0 where one camera sees the ball
            twice, NaN where no two see it, shape (G,).
        point: Mean of the valid pairs, pitch frame, metres, NaN without one, shape (G, 3).
        parallax: The largest over the valid pairs, at the mean, degrees, NaN without one, (G,).
        distance: Of the mean from the camera of the first view that it comes from, metres, (G,).
    """

    jac: FloatArray
    view_failed: IntArray
    pair_failed: IntArray
    failed: BoolArray
    baseline: FloatArray
    point: FloatArray
    parallax: FloatArray
    distance: FloatArray

    @property
    def valid(self) -> BoolArray:
        """Which pairs count, shape (P,)."""
        valid: BoolArray = self.pair_failed == PASSES
        return valid

    @cached_property
    def first_failed_gates(self) -> IntArray:
        """First gate that each group fails, or ``PASSES``, shape (G,)."""
        first = np.full(self.failed.shape[1], PASSES)
        for gate in reversed(range(PASSES)):
            first[self.failed[gate]] = gate
        return first

    @cached_property
    def passing_groups(self) -> BoolArray:
        """Which groups pass every gate that the policy asks for, shape (G,)."""
        passing: BoolArray = self.first_failed_gates == PASSES
        return passing


def judge_groups(
    facts: GroupFacts,
    policy: Policy,
    uncertainty: CovarianceOfMeanBall,
    jac: FloatArray | None = None,
) -> Judgement:
    """Judge every group by the thresholds of a policy.

    Args:
        facts: The groups.
        policy: The thresholds.
        uncertainty: Of the same facts, kept where several policies are tried one after the other.
        jac: ``compute_view_jac`` at the policy's gamma, where it is known, shape (V,).
    """
    if jac is None:
        jac = compute_view_jac(facts, policy.jac_gamma_percent)
    return judge_with_known_view_failures(
        facts, policy, uncertainty, jac, find_first_failed_gates(facts, jac, policy)
    )


def judge_with_known_view_failures(
    facts: GroupFacts,
    policy: Policy,
    uncertainty: CovarianceOfMeanBall,
    jac: FloatArray,
    standing: tuple[IntArray, IntArray],
    *,
    first_alone: bool = False,
) -> Judgement:
    """``judge_groups`` where it is known which views and pairs stand.

    Args:
        facts: The groups.
        policy: The thresholds.
        uncertainty: Of the same facts.
        jac: ``compute_view_jac`` at the policy's gamma, shape (V,).
        standing: ``find_first_failed_gates`` of them.
        first_alone: Only the first gate that a group fails matters: what is dear is not judged
            where one before it fails.
    """
    view_failed, pair_failed = standing
    left = facts.view_included & (view_failed == PASSES)
    valid = pair_failed == PASSES
    point, parallax, distance = _mean_pair_points(facts, valid)
    baseline = _widest_baselines(facts, left)
    failed = np.zeros((PASSES, facts.groups), bool)
    failed[_CALIBRATABLE : _BALL + 1] = _find_groups_failing_view_gates(facts, view_failed, left)
    failed[_REPROJECTION] = np.isnan(point[:, 0])

    def fails_earlier_gate() -> BoolArray:
        """Groups whose sigma and p-value are not asked for."""
        fallen: BoolArray = failed[_REPROJECTION]
        return np.any(failed[:_SIGMA], axis=0) if first_alone else fallen

    def is_sigma_small_enough(limit_m: float) -> BoolArray:
        candidates = np.flatnonzero(~fails_earlier_gate())
        covariances = uncertainty.covariances(valid, candidates, point[candidates], policy)
        # Contradictions only widen: whoever is uncertain without them is so with them.
        within = is_covariance_within(covariances, limit_m)
        candidates, covariances = candidates[within], covariances[within]
        found = np.zeros(facts.groups, bool)
        widened = widen_covariances(facts, valid, candidates, covariances, point, policy)
        found[candidates] = is_covariance_within(widened, limit_m)
        return found

    def p_value() -> FloatArray:
        used = find_views_in_pairs(facts, valid)
        if first_alone:
            used &= ~fails_earlier_gate()[facts.view_group]
        return p_values(facts, used, point, policy)

    _apply_group_gates(failed, policy, baseline, parallax, is_sigma_small_enough, p_value)
    return Judgement(jac, view_failed, pair_failed, failed, baseline, point, parallax, distance)


def recompare_thresholds(
    known: Judgement, policy: Policy, sigma: FloatArray | None, p_value: FloatArray | None
) -> BoolArray:
    """``Judgement.failed`` under other thresholds, of groups whose views and pairs stand as before.

    Args:
        known: What another policy makes of them.
        policy: The thresholds.
        sigma: ``major_axis_sigma`` of each group, NaN without a ball, shape (G,); None where the
            policy does not ask.
        p_value: Of each group, infinite where it cannot be tested, shape (G,); None likewise.
    """
    failed = known.failed.copy()

    def is_sigma_small_enough(limit_m: float) -> BoolArray:
        assert sigma is not None
        return is_sigma_within(sigma, limit_m)

    def known_p_value() -> FloatArray:
        assert p_value is not None
        return p_value

    _apply_group_gates(
        failed, policy, known.baseline, known.parallax, is_sigma_small_enough, known_p_value
    )
    return failed


def _apply_group_gates(
    failed: BoolArray,
    policy: Policy,
    baseline: FloatArray,
    parallax: FloatArray,
    certain: Callable[[float], BoolArray],
    p_value: Callable[[], FloatArray],
) -> None:
    """Judge by the gates that compare a number of the whole group with a threshold.

    Args:
        failed: Takes what they say, shape (10, G); in their order, the dear ones last.
        policy: The thresholds.
        baseline: As in ``Judgement``, like ``parallax``; NaN falls.
        parallax: As there.
        certain: Asked only where the policy asks: groups whose sigma is within a limit, metres, (G,).
        p_value: Likewise: of each group, infinite where it cannot be tested, (G,).
    """
    failed[_BASELINE] = ~(baseline >= policy.min_baseline_m)
    failed[_PARALLAX:] = False
    if policy.min_parallax_degrees is not None:
        failed[_PARALLAX] = ~(parallax >= policy.min_parallax_degrees)
    if policy.max_sigma_m is not None:
        failed[_SIGMA] = ~certain(policy.max_sigma_m)
    if policy.min_p_value is not None:
        failed[_CHI_SQUARE] = ~(p_value() >= policy.min_p_value)


def widen_covariances(
    facts: GroupFacts,
    valid: BoolArray,
    groups: IntArray,
    covariances: FloatArray,
    point: FloatArray,
    policy: Policy,
) -> FloatArray:
    """Covariances of balls, wider where the views of a ball contradict each other, (N, 3, 3).

    Args:
        facts: The groups.
        valid: Pairs that count, shape (P,).
        groups: Rows of the groups, shape (N,).
        covariances: Of their balls by the noise alone, square metres, shape (N, 3, 3).
        point: Of every group, pitch frame, metres, shape (G, 3).
        policy: How noisy a click is.
    """
    wanted = np.zeros(facts.groups, bool)
    wanted[groups] = True
    used = find_views_in_pairs(facts, valid) & wanted[facts.view_group]
    widening = fit_balls_and_test_residuals(facts, used, point, policy).widening[groups]
    widened: FloatArray = covariances * (widening**2)[:, None, None]
    return widened


def find_first_failed_gates(
    facts: GroupFacts, jac: FloatArray, policy: Policy
) -> tuple[IntArray, IntArray]:
    """First gate that drops each view, shape (V,), and each pair, (P,), or ``PASSES``."""
    view_failed = _find_first_failed_view_gates(facts, jac, policy)
    return view_failed, _find_first_failed_pair_gates(facts, view_failed, policy)


def find_views_in_pairs(facts: GroupFacts, pairs: BoolArray) -> BoolArray:
    """Views in any of the pairs, shape (V,)."""
    found = np.zeros(len(facts.view_group), bool)
    found[facts.pair_view[pairs]] = True
    return found


def compute_view_jac(facts: GroupFacts, gamma_percent: float) -> FloatArray:
    """JaC of each view, NaN where it cannot be measured, shape (V,)."""
    gamma_px = gamma_percent / 100 * facts.view_diagonal
    close = facts.mark_px < gamma_px[facts.mark_view]
    views = len(facts.view_group)
    hits = np.bincount(facts.mark_view[close], minlength=views)
    marks = np.bincount(facts.mark_view, minlength=views)
    return np.where(facts.view_measured, hits / np.maximum(marks, 1), np.nan)


def _find_first_failed_view_gates(facts: GroupFacts, jac: FloatArray, policy: Policy) -> IntArray:
    failed: IntArray = np.full(len(facts.view_group), PASSES).astype(np.int8)
    # NaN where there is nothing to measure, and then nothing falls.
    if policy.min_agreement is not None:
        failed[facts.view_agreement < policy.min_agreement] = _AGREEMENT
    failed[jac <= policy.min_jac] = _JAC
    failed[~facts.view_camera] = _CALIBRATABLE
    failed[~facts.view_included] = PASSES
    return failed


def _find_first_failed_pair_gates(
    facts: GroupFacts, view_failed: IntArray, policy: Policy
) -> IntArray:
    tau_px = policy.tau_px(facts.view_diagonal)
    a, b = (facts.pair_errors <= tau_px[facts.pair_view]).T
    failed = np.where(a & b & facts.pair_front, np.int8(PASSES), np.int8(_REPROJECTION))
    failed[facts.pair_baseline < policy.min_baseline_m] = _BASELINE
    a, b = view_failed[facts.pair_view].T
    first: IntArray = np.minimum(failed, np.minimum(a, b))
    return first


def _find_groups_failing_view_gates(
    facts: GroupFacts, view_failed: IntArray, left: BoolArray
) -> BoolArray:
    """The gates that are judged from views: which groups fail them, shape (5, G)."""
    included, bare, fallen, apart, remaining, shown = (
        np.bincount(facts.view_group[chosen], minlength=facts.groups)
        for chosen in (
            facts.view_included,
            view_failed == _CALIBRATABLE,
            view_failed == _JAC,
            view_failed == _AGREEMENT,
            left,
            left & facts.view_ball,
        )
    )
    too_few, cameras = remaining < MIN_VIEWS, included - bare
    fitting = cameras - fallen
    return np.stack(
        [
            too_few & (bare > 0) & (cameras < MIN_VIEWS),
            too_few & (fallen > 0) & (cameras >= MIN_VIEWS) & (fitting < MIN_VIEWS),
            too_few & (apart > 0) & (fitting >= MIN_VIEWS),
            too_few,
            shown < MIN_VIEWS,
        ]
    )


def _widest_baselines(facts: GroupFacts, left: BoolArray) -> FloatArray:
    shown = np.bincount(facts.view_group[left & facts.view_ball], minlength=facts.groups)
    widest = np.where(shown >= MIN_VIEWS, 0.0, np.nan)
    a, b = left[facts.pair_view].T
    pairs = a & b
    # Views of a pair show the ball, so none of these is NaN.
    np.maximum.at(widest, facts.pair_group[pairs], facts.pair_baseline[pairs])
    return widest


def _mean_pair_points(
    facts: GroupFacts, valid: BoolArray
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Mean point of the valid pairs, its largest parallax in degrees, and its distance."""
    pairs = np.flatnonzero(valid)
    owner = facts.pair_group[pairs]
    number = np.bincount(owner, minlength=facts.groups)
    there = number > 0
    sums = [np.bincount(owner, part, facts.groups) for part in facts.pair_point[pairs].T]
    point = np.column_stack(sums) / np.where(there, number, np.nan)[:, None]
    angle = facts.pair_parallax[pairs]
    several = np.flatnonzero(number[owner] > 1)
    a, b = facts.view_position[facts.pair_view[pairs[several]]].transpose(1, 0, 2)
    angle[several] = np.degrees(parallax_angle(a, b, point[owner[several]]))
    largest = np.where(there, -np.inf, np.nan)
    np.maximum.at(largest, owner, angle)
    distance = np.full(facts.groups, np.nan)
    # Pairs come in the order of their groups and views.
    first = pairs[np.searchsorted(owner, np.flatnonzero(there))]
    camera = facts.view_position[facts.pair_view[first, 0]]
    distance[there] = np.linalg.norm(camera - point[there], axis=1)
    return point, largest, distance
