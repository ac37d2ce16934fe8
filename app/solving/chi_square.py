"""Chi-square: whether the residuals of the most likely ball are as small as sigma promises."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.special import chdtrc

from app.geometry.arrays import BoolArray, FloatArray, IntArray, cross
from app.soccer.policy import Policy
from app.solving.facts import Facts
from app.solving.spread import pixel_spreads

_STEPS = 6


@dataclass(frozen=True)
class Residuals:
    """What is left of the clicks once the most likely ball is found, group by group (G).

    Attributes:
        point: The most likely ball, pitch frame, metres, NaN where the views have none in front
            of all of them, shape (G, 3), like the others.
        chi_square: Sum of the squared residuals, each in units of its sigma, shape (G,).
        freedom: Degrees of freedom: two for each view, less three of the point, shape (G,).
        p_value: How often chance alone makes residuals as large as these, shape (G,).
    """

    point: FloatArray
    chi_square: FloatArray
    freedom: IntArray
    p_value: FloatArray


def residuals_of(facts: Facts, used: BoolArray, start: FloatArray, policy: Policy) -> Residuals:
    """Fit one ball to all clicks of each group, and test what is left.

    A click's uncertainty is that of the hand and of its camera, as for every sigma. Lenses
    are linear around the click, which is exact to a thousandth of the residual.

    Args:
        facts: The groups.
        used: Views that count, shape (V,); a group needs two.
        start: A point of each group near the ball, metres, NaN where there is none, shape (G, 3).
        policy: How noisy a click is.

    Source: Hartley & Zisserman, sec. 12.5 and 5.3 (minimum of the residuals, and its expectation).
    """
    views = np.flatnonzero(used & np.isfinite(facts.view_axis[:, 0]))
    owner = facts.view_group[views]
    views = views[np.isfinite(start[owner, 0])]
    owner = facts.view_group[views]
    freedom = 2 * np.bincount(owner, minlength=facts.groups) - 3
    with np.errstate(all="ignore"):
        point, squares = _fitted(facts, views, start, policy)
    total = np.bincount(owner, squares, facts.groups).astype(float)
    total[(freedom < 1) | ~np.isfinite(point[:, 0])] = np.nan
    p_value = np.full(facts.groups, np.nan)
    there = np.isfinite(total)
    p_value[there] = chdtrc(freedom[there], total[there])
    point[~there] = np.nan
    return Residuals(point, total, np.maximum(freedom, 0), p_value)


def untestable(facts: Facts, used: BoolArray, policy: Policy) -> BoolArray:
    """Groups whose residuals say nothing: nobody says how exact one of their cameras is, (G,).

    Args:
        facts: The groups.
        used: Views that count, shape (V,).
        policy: Its ``given_sigma_px`` says it of given cameras without covariance.
    """
    unknown = used & ~facts.view_known
    if policy.given_sigma_px:
        unknown &= ~facts.view_bare
    found = np.zeros(facts.groups, bool)
    found[facts.view_group[unknown]] = True
    return found


def _fitted(
    facts: Facts, views: IntArray, start: FloatArray, policy: Policy
) -> tuple[FloatArray, FloatArray]:
    """The most likely points, (G, 3), and each view's squared residual in units of sigma, (N,)."""
    owner = facts.view_group[views]
    slope, axis, position = (
        facts.view_slope[views],
        facts.view_axis[views],
        facts.view_position[views],
    )
    point = start.copy()
    weight = _weights(facts, views, point, policy)
    for step in range(_STEPS + 1):
        reach = point[owner] - position
        depth = _dot(axis, reach)
        offset = -_times(slope, reach) / depth[:, None]
        if step == _STEPS:
            break
        # The first step holds the depths, so that a start far off does no harm.
        lean = offset[:, :, None] * axis[:, None] if step else 0.0
        jacobian = (slope + lean) / depth[:, None, None]
        pulled = jacobian.transpose(0, 2, 1) @ weight
        matrix = _summed(facts, owner, pulled @ jacobian)
        pull = _summed(facts, owner, _times(pulled, offset))
        point = point + _solved(matrix, pull)
    squares = _dot(offset, _times(weight, offset))
    squares[depth <= 0] = np.nan
    return point, squares


def _weights(facts: Facts, views: IntArray, point: FloatArray, policy: Policy) -> FloatArray:
    """Inverse covariance of each view's click and calibration, at the point, (N, 2, 2)."""
    spread = pixel_spreads(facts, views, point[facts.view_group[views]], policy)
    (a, b), (c, d) = spread.transpose(1, 2, 0)
    adjugate = np.stack([np.stack([d, -b], -1), np.stack([-c, a], -1)], 1)
    weights: FloatArray = adjugate / (a * d - b * c)[:, None, None]
    return weights


def _solved(matrix: FloatArray, pull: FloatArray) -> FloatArray:
    """Solutions of 3 x 3 systems by cofactors, NaN where one has none, shape (G, 3)."""
    a, b, c = matrix.transpose(1, 0, 2)
    first = cross(b, c)
    columns = np.stack([first, cross(c, a), cross(a, b)], axis=-1)
    solution: FloatArray = _times(columns, pull) / _dot(a, first)[:, None]
    return solution


def _summed(facts: Facts, owner: IntArray, parts: FloatArray) -> FloatArray:
    flat = parts.reshape(len(parts), int(np.prod(parts.shape[1:])))
    sums = [np.bincount(owner, column, facts.groups) for column in flat.T]
    total: FloatArray = np.stack(sums, axis=-1).astype(float).reshape(-1, *parts.shape[1:])
    return total


def _times(matrices: FloatArray, vectors: FloatArray) -> FloatArray:
    product: FloatArray = (matrices @ vectors[..., None])[..., 0]
    return product


def _dot(a: FloatArray, b: FloatArray) -> FloatArray:
    product: FloatArray = (a * b).sum(axis=-1)
    return product
