"""Noise grid: the lowest of costs that stand on a grid, and how well it is known."""

from __future__ import annotations

from app.geometry.arrays import FloatArray

BLOCKS = 10
"""Tenths of a dataset, in the order in which it was taken: neighbours in time err alike, so one
after the other is left out (jackknife)."""
STUDENT = 2.26
"""95 % of Student's distribution with one degree of freedom less than blocks: half of an interval in
standard deviations."""


def vertex(cost: FloatArray, at: int) -> tuple[float, float]:
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
