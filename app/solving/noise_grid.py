"""Noise grid: the lowest of costs that stand on a grid, how well it is known, and what was known before.

An estimate of noise is a posterior: of few numbers it is what noise is expected to be, and with
each further one more what they say.
"""

from __future__ import annotations

import math

import numpy as np
from scipy.special import chdtr, chdtri

from app.geometry.arrays import FloatArray

BLOCKS = 10
"""Tenths of a dataset, in the order in which it was taken: neighbours in time err alike, so one
after the other is left out (jackknife)."""
STUDENT = 2.26
"""95 % of Student's distribution with one degree of freedom less than blocks: half of an interval in
standard deviations."""

NORMAL_95 = 1.96
SPREAD = 1.0
"""Standard deviation of the logarithm of a dataset's sigma, before its residuals are seen: that of one
in twenty is less than a seventh of what is expected, or more than seven times as much."""
AXES = 3
"""Of the ellipsoid that has to hold the truth."""


def sigma_prior_cost(log_sigmas: FloatArray, expected: float, spread: float = SPREAD) -> FloatArray:
    """Negative logarithm of the prior of a sigma, at each of some logarithms, shape (N,)."""
    cost: FloatArray = 0.5 * ((log_sigmas - math.log(expected)) / spread) ** 2
    return cost


def posterior_variance(scatter: float, numbers: float, spread: float = SPREAD) -> float:
    """Variance of the logarithm of an estimated sigma.

    No sample of independent numbers says more about its sigma than half of one for each.

    Args:
        scatter: Of the estimate, as leaving out parts of a dataset shows it.
        numbers: Independent numbers that it rests on.
        spread: Of the prior.
    """
    return max(scatter, 1 / (2 * numbers + spread**-2))


def calibrated_log_sigma(log_sigmas: FloatArray, cost: FloatArray) -> float:
    """Logarithm of the sigma whose 95 % ellipsoids hold the truth, though nobody knows sigma exactly.

    As Student's quantiles, of few numbers it is larger than the most likely sigma.

    Args:
        log_sigmas: The logarithms that are tried, shape (N,).
        cost: Negative logarithm of the posterior there, shape (N,).
    """
    weight = np.exp(cost.min() - cost)
    scales = np.exp(log_sigmas[:, None] - log_sigmas)
    inside = chdtr(AXES, chdtri(AXES, 0.05) * scales**2) @ (weight / weight.sum())
    return float(np.interp(0.95, inside, log_sigmas))


def interpolate_cost(cost: FloatArray, places: FloatArray) -> FloatArray:
    """Costs between the points of a grid, by the parabola through the three nearest ones, shape (M,).

    Args:
        cost: At each point of the grid, shape (N,).
        places: In steps from the first, shape (M,).
    """
    at = np.clip(places.round(), 1, len(cost) - 2).astype(int)
    off, before, least, after = places - at, cost[at - 1], cost[at], cost[at + 1]
    found: FloatArray = (
        least + off * (after - before) / 2 + off**2 * (before - 2 * least + after) / 2
    )
    return found


def lowest_cost_vertex(cost: FloatArray, at: int) -> tuple[float, float]:
    """How far the lowest point lies from the lowest one of the grid, in steps, and its cost.

    By the parabola through three costs; at an end of the grid, that end.

    Args:
        cost: At each point of the grid, shape (N,).
        at: Index of the lowest.
    """
    if not 0 < at < len(cost) - 1:
        return 0.0, float(cost[at])
    before, least, after = cost[at - 1 : at + 2].tolist()
    bend = before - 2 * least + after
    if bend <= 0:
        return 0.0, least
    off = (before - after) / (2 * bend)
    return off, least - bend * off**2 / 2


def jackknife_variance(parts: FloatArray) -> FloatArray:
    """Variance of numbers from what they are without each block, shape (B, K), as shape (K,)."""
    squares: FloatArray = ((parts - parts.mean(axis=0)) ** 2).sum(axis=0)
    return (len(parts) - 1) / len(parts) * squares
