"""What one policy makes of a block of groups, computed in as many threads as there are processors."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterable
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, field
from functools import cache
from threading import Lock
from typing import TypeVar

import numpy as np

from app.geometry.arrays import BoolArray, FloatArray
from app.soccer.policy import Policy
from app.soccer.solution import GAMMAS_PERCENT
from app.solving.ball_covariance import MeanCovariance, major_axis_sigma
from app.solving.chi_square import p_values
from app.solving.facts import Facts
from app.solving.judgement import (
    Judgement,
    first_failed_gates,
    judge_groups,
    judge_known_failures,
    recompare_thresholds,
    view_jac,
    views_in_pairs,
    widened_covariances,
)

_NUMBERS = ("baseline", "point", "parallax", "distance")


@dataclass
class BlockResults:
    """Groups under a policy; what is not asked for yet is computed when it first is.

    Attributes:
        facts: The groups.
        jac: ``view_jac`` at each of ``GAMMAS_PERCENT``, shape (3, V).
        policy: By which they are judged.
        judgement: What it makes of them.
        sigma: Standard deviation along the longest axis, metres, NaN without a ball, shape (G,).
        p_value: Of the residuals, infinite where it cannot be tested, shape (G,).
        uncertainty: Kept from the first time that another noise is tried.
    """

    facts: Facts
    jac: FloatArray
    policy: Policy
    judgement: Judgement
    sigma: FloatArray | None = None
    p_value: FloatArray | None = None
    uncertainty: MeanCovariance | None = None
    lock: Lock = field(default_factory=Lock, repr=False)

    @staticmethod
    def by(facts: Facts, jac: FloatArray, policy: Policy) -> BlockResults:
        """Judge groups."""
        uncertainty = MeanCovariance(facts)
        judgement = judge_groups(facts, policy, uncertainty, _jac_at_threshold(facts, jac, policy))
        found = BlockResults(facts, jac, policy, judgement)
        if policy.max_sigma_m is not None:
            found.sigma = _mean_sigmas(facts, policy, judgement, uncertainty)
        return found

    def complete(self) -> None:
        """Compute what somebody may ask for, so that nobody waits for it."""
        with self.lock:
            if self.sigma is None:
                self.sigma = _mean_sigmas(
                    self.facts, self.policy, self.judgement, MeanCovariance(self.facts)
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

    def judge_under(self, policy: Policy) -> Judgement:
        """What another policy makes of the groups."""
        if _uses_click_noise(policy) and noise_of(policy) != noise_of(self.policy):
            jac = _jac_at_threshold(self.facts, self.jac, policy)
            return judge_groups(self.facts, policy, self._uncertainty(), jac)
        return self._judge_under(policy)[0]

    def judged_by(self, policy: Policy) -> BlockResults:
        """The groups judged by another policy from now on."""
        if noise_of(policy) != noise_of(self.policy):
            return BlockResults.by(self.facts, self.jac, policy)
        judgement, new, part = self._judge_under(policy)
        found = BlockResults(self.facts, self.jac, policy, judgement)
        if self.sigma is not None and self.p_value is not None:
            found.sigma, found.p_value = self.sigma.copy(), self.p_value.copy()
            if part is not None:
                part.complete()
                found.sigma[new], found.p_value[new] = part.sigma, part.p_value
        return found

    def _judge_under(self, policy: Policy) -> tuple[Judgement, BoolArray, BlockResults | None]:
        """The judgement, which groups had to be judged anew, and those by themselves."""
        facts, known = self.facts, self.judgement
        jac = _jac_at_threshold(facts, self.jac, policy)
        view_failed, pair_failed = first_failed_gates(facts, jac, policy)
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
            uncertainty = MeanCovariance(some)
            found = judge_known_failures(
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
                uncertainty = self.uncertainty or MeanCovariance(self.facts)
                self.sigma = _mean_sigmas(self.facts, self.policy, self.judgement, uncertainty)
            if policy.min_p_value is not None and self.p_value is None:
                self.p_value = _p_values(self.facts, self.policy, self.judgement)
        return (
            None if policy.max_sigma_m is None else self.sigma,
            None if policy.min_p_value is None else self.p_value,
        )

    def _uncertainty(self) -> MeanCovariance:
        with self.lock:
            if self.uncertainty is None:
                self.uncertainty = MeanCovariance(self.facts)
        return self.uncertainty


def noise_of(policy: Policy) -> tuple[float, float, float]:
    """How exact clicks are taken to be."""
    return policy.click_sigma_px, policy.box_sigma_share, policy.given_sigma_px


def _uses_click_noise(policy: Policy) -> bool:
    """Whether it asks for what depends on the noise of clicks."""
    return policy.max_sigma_m is not None or policy.min_p_value is not None


def _jac_at_threshold(facts: Facts, jac: FloatArray, policy: Policy) -> FloatArray:
    gamma = policy.jac_gamma_percent
    if gamma in GAMMAS_PERCENT:
        known: FloatArray = jac[GAMMAS_PERCENT.index(gamma)]
        return known
    return view_jac(facts, gamma)


def _mean_sigmas(
    facts: Facts, policy: Policy, judgement: Judgement, uncertainty: MeanCovariance
) -> FloatArray:
    there = np.flatnonzero(~np.isnan(judgement.point[:, 0]))
    point = judgement.point
    covariances = uncertainty.covariances(judgement.valid, there, point[there], policy)
    covariances = widened_covariances(facts, judgement.valid, there, covariances, point, policy)
    sigma = np.full(facts.groups, np.nan)
    sigma[there] = major_axis_sigma(covariances)
    return sigma


def _p_values(facts: Facts, policy: Policy, judgement: Judgement) -> FloatArray:
    return p_values(facts, views_in_pairs(facts, judgement.valid), judgement.point, policy)


Given = TypeVar("Given")
Made = TypeVar("Made")


def map_in_threads(work: Callable[[Given], Made], items: Iterable[Given]) -> list[Made]:
    """What a function makes of each item, in their order; arrays of some size let others run."""
    given = list(items)
    if len(given) < 2:
        return [work(item) for item in given]
    return list(_thread_pool().map(work, given))


@cache
def _thread_pool() -> ThreadPoolExecutor:
    return ThreadPoolExecutor(os.cpu_count() or 1, thread_name_prefix="yield")
