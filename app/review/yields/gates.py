"""Yield gates: which groups of a table pass a policy, judged all at once.

The same judgement as ``solving.gates`` makes of one solution; the tests hold both together.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from app.geometry.arrays import BoolArray, FloatArray, IntArray
from app.review.yields.spread import SpreadMemo, sigma_of
from app.review.yields.table import YieldTable
from app.soccer.policy import Policy
from app.soccer.solution import GATES
from app.solving.gates import MIN_VIEWS

PASSES = len(GATES)
"""Stands for the first failing gate of a group that fails none."""


@dataclass(frozen=True)
class Judged:
    """What a policy makes of each group of a table.

    Attributes:
        first: Index in ``GATES`` of the first failing gate, or ``PASSES``, shape (G,).
        unmeasured: Gate ``jac`` passes because the cameras are given and have no lines.
        point: The ball, pitch frame, metres, NaN without one, shape (G, 3).
        parallax: Degrees, NaN without a ball.
        distance: Of the ball from the camera of the first view that it comes from, metres.
    """

    first: IntArray
    unmeasured: BoolArray
    point: FloatArray
    parallax: FloatArray
    distance: FloatArray

    @property
    def passes(self) -> BoolArray:
        """Which groups pass every active gate."""
        passing: BoolArray = self.first == PASSES
        return passing


def judge_table(table: YieldTable, policy: Policy, memo: SpreadMemo | None = None) -> Judged:
    """Judge every group of a table by the thresholds of a policy.

    Args:
        table: The dataset.
        policy: The thresholds.
        memo: Of the same table, where several policies are tried one after the other.
    """
    jac = view_jac(table, policy.jac_gamma_percent)
    camera = table.view_included & table.view_camera
    # NaN where there is nothing to measure, and then nothing falls.
    fallen = camera & (jac <= policy.min_jac)
    left = camera & ~fallen
    pairs = left[table.pair_view].all(axis=1)
    apart = pairs & (table.pair_baseline >= policy.min_baseline_m)
    tau_px = policy.tau_percent / 100 * table.view_diagonal
    close = (table.pair_errors < tau_px[table.pair_view]).all(axis=1)
    valid = apart & close & table.pair_front
    ball = _Ball(table, valid)
    failed = _view_gates(table, camera, fallen, left)
    failed["baseline"] = ~_any(table.pair_group, apart, table.groups)
    failed["reprojection"] = ~ball.there
    if policy.min_parallax_degrees is not None:
        failed["parallax"] = ~(ball.parallax >= policy.min_parallax_degrees)
    if policy.max_sigma_m is not None:
        failed["sigma"] = ~(policy.max_sigma_m - ball.sigma(policy, memo or SpreadMemo(table)) >= 0)
    return Judged(
        first=_first(failed, table.groups),
        unmeasured=_unmeasured(table, camera),
        point=ball.point,
        parallax=ball.parallax,
        distance=ball.distance,
    )


def view_jac(table: YieldTable, gamma_percent: float) -> FloatArray:
    """JaC of each view, NaN where it cannot be measured, shape (V,)."""
    gamma_px = gamma_percent / 100 * table.view_diagonal
    close = table.mark_px < gamma_px[table.mark_view]
    views = len(table.view_group)
    hits = np.bincount(table.mark_view[close], minlength=views)
    marks = np.bincount(table.mark_view, minlength=views)
    jac = hits / np.maximum(marks, 1)
    return np.where(table.view_measured, jac, np.nan)


def qualifying_jac(table: YieldTable, gamma_percent: float) -> FloatArray:
    """The JaC that a threshold must lie below so that two views with a ball qualify, (G,).

    A camera that was given and cannot be measured qualifies whatever the threshold; -1 where
    no threshold leaves two views.
    """
    jac = view_jac(table, gamma_percent)
    shown = np.flatnonzero(table.view_included & table.view_camera & table.view_ball)
    value = np.where(np.isnan(jac), np.inf, jac)[shown]
    order = shown[np.lexsort((-value, table.view_group[shown]))]
    groups, starts, counts = np.unique(
        table.view_group[order], return_index=True, return_counts=True
    )
    second = np.full(table.groups, -1.0)
    enough = counts >= MIN_VIEWS
    chosen = order[starts[enough] + MIN_VIEWS - 1]
    second[groups[enough]] = np.where(np.isnan(jac[chosen]), np.inf, jac[chosen])
    return second


def _view_gates(
    table: YieldTable, camera: BoolArray, fallen: BoolArray, left: BoolArray
) -> dict[str, BoolArray]:
    """The gates that are judged from views: which groups fail them."""
    included, cameras, remaining, shown, short = (
        _count(table, chosen)
        for chosen in (table.view_included, camera, left, left & table.view_ball, fallen)
    )
    too_few = remaining < MIN_VIEWS
    return {
        "calibratable": too_few & (included > cameras) & (cameras < MIN_VIEWS),
        "jac": too_few & (short > 0) & (cameras >= MIN_VIEWS),
        "two_views": too_few,
        "ball": shown < MIN_VIEWS,
    }


def _unmeasured(table: YieldTable, camera: BoolArray) -> BoolArray:
    measured = _count(table, table.view_included & table.view_measured)
    unmeasured: BoolArray = (measured == 0) & (_count(table, camera & table.view_given) > 0)
    return unmeasured


def _count(table: YieldTable, chosen: BoolArray) -> IntArray:
    return np.bincount(table.view_group[chosen], minlength=table.groups)


def _any(owner: IntArray, chosen: BoolArray, count: int) -> BoolArray:
    found = np.zeros(count, bool)
    found[owner[chosen]] = True
    return found


def _first(failed: dict[str, BoolArray], groups: int) -> IntArray:
    first = np.full(groups, PASSES)
    for index, name in reversed(list(enumerate(GATES))):
        if name in failed:
            first[failed[name]] = index
    return first


class _Ball:
    """The mean of the valid pairs of each group."""

    def __init__(self, table: YieldTable, valid: BoolArray):
        self._table, self._valid = table, valid
        self._pairs = np.flatnonzero(valid)
        self._owner = table.pair_group[self._pairs]
        self._number = np.bincount(self._owner, minlength=table.groups)
        self.there = self._number > 0
        sums = [
            np.bincount(self._owner, column, minlength=table.groups)
            for column in table.pair_point[self._pairs].T
        ]
        with np.errstate(invalid="ignore"):
            self.point = np.column_stack(sums) / np.where(self.there, self._number, np.nan)[:, None]
        self.parallax = self._parallax()
        self.distance = self._distance()

    def sigma(self, policy: Policy, memo: SpreadMemo) -> FloatArray:
        """Standard deviation along the longest axis, metres, NaN without a ball."""
        table, sigma = self._table, np.full(self._table.groups, np.nan)
        alone = self._number[self._owner] == 1
        if alone.any():
            spread = table.pair_spread[self._pairs[alone]]
            sigma[self._owner[alone]] = sigma_of(spread, policy)
        several = np.flatnonzero(self._number > 1)
        if len(several):
            spread = memo.mean_spread(self._valid, several, self.point[several])
            sigma[several] = sigma_of(spread, policy)
        return sigma

    def _parallax(self) -> FloatArray:
        """The largest over the valid pairs, at the mean point, degrees."""
        table, pairs, owner = self._table, self._pairs, self._owner
        angle = table.pair_parallax[pairs].copy()
        several = np.flatnonzero(self._number[owner] > 1)
        rays = [
            table.view_position[table.pair_view[pairs[several], side]] - self.point[owner[several]]
            for side in (0, 1)
        ]
        sine = np.linalg.norm(np.cross(*rays), axis=1)
        angle[several] = np.degrees(np.arctan2(sine, (rays[0] * rays[1]).sum(axis=1)))
        largest = np.full(table.groups, -np.inf)
        np.maximum.at(largest, owner, angle)
        return np.where(self.there, largest, np.nan)

    def _distance(self) -> FloatArray:
        """From the first view: pairs come in the order of their views."""
        table, distance = self._table, np.full(self._table.groups, np.nan)
        groups, first = np.unique(self._owner, return_index=True)
        camera = table.view_position[table.pair_view[self._pairs[first], 0]]
        distance[groups] = np.linalg.norm(camera - self.point[groups], axis=1)
        return distance
