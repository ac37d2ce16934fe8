"""Chi-square: whether the residuals of the most likely ball are as small as sigma promises."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.special import chdtrc

from app.geometry.arrays import BoolArray, FloatArray, IntArray, cross
from app.soccer.policy import Policy
from app.soccer.solution import ChiSquare
from app.solving.ball_covariance import pixel_covariances
from app.solving.facts import GroupFacts

LOW_P_VALUE = 0.002
"""Below it views contradict each other. Chance alone makes one in five hundred groups."""
_STEPS = 6


@dataclass(frozen=True)
class ChiSquareResiduals:
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

    @property
    def widening(self) -> FloatArray:
        """``sigma_widening`` each group, shape (G,)."""
        return sigma_widening(self.chi_square, self.freedom, self.p_value)


def sigma_widening(chi_square: FloatArray, freedom: IntArray, p_value: FloatArray) -> FloatArray:
    """By what the sigma of a ball is multiplied whose views contradict each other, shape (N,).

    The Birge ratio, sqrt(chi-square / degrees of freedom), where the p-value is below
    ``LOW_P_VALUE``; 1 elsewhere. It is the most likely scale of the noise, if one scale is wrong
    for all clicks. It is not used above the level: with one degree of freedom (two views) a third
    of all ordinary groups have a ratio above 1 by chance, and their sigma is right. Nor are the
    quantiles of Student's t for few degrees of freedom: residuals of two views are one number,
    and its scale is known to a factor of two or three only.

    Args:
        chi_square: Sums of squared residuals in units of sigma, shape (N,).
        freedom: Their degrees of freedom, shape (N,).
        p_value: How often chance alone makes them as large, NaN where that is not known, (N,).

    Source: Birge, "The calculation of errors by the method of least squares", Phys. Rev. 40, 1932.
    """
    with np.errstate(invalid="ignore"):
        contradicted = p_value < LOW_P_VALUE
    ratio = np.sqrt(np.where(contradicted, chi_square / np.maximum(freedom, 1), 1.0))
    widened: FloatArray = np.maximum(ratio, 1.0)
    return widened


def group_sigma_widening(found: ChiSquare | None) -> float:
    """``sigma_widening`` one group; 1 where its views were not tested."""
    if found is None:
        return 1.0
    numbers = (np.array([number]) for number in (found.value, found.freedom, found.p_value))
    return float(sigma_widening(*numbers)[0])


def fit_balls_and_test_residuals(
    facts: GroupFacts, used: BoolArray, start: FloatArray, policy: Policy
) -> ChiSquareResiduals:
    """Fit one ball to all clicks of each group, and test the residuals.

    A click's uncertainty is that of the hand and of its camera, as for every sigma. Lenses
    are linear around the click, which is exact to a thousandth of the residual. Views whose lines
    leave their camera open have residuals of no known size, and do not count.

    Args:
        facts: The groups.
        used: Views that count, shape (V,); a group needs two that are not left open.
        start: A point of each group near the ball, metres, NaN where there is none, shape (G, 3).
        policy: How noisy a click is.

    Source: Hartley & Zisserman, sec. 12.5 and 5.3 (minimum of the residuals, and its expectation).
    """
    views = np.flatnonzero(used & ~facts.view_open & np.isfinite(facts.view_axis[:, 0]))
    return _test_residuals(facts, views, facts.view_group[views], start, policy)


def compute_leave_one_out_chi_square(
    facts: GroupFacts, used: BoolArray, start: FloatArray, policy: Policy
) -> ChiSquareResiduals:
    """The residuals of one group without one of its views: a row for each view that counts, in order.

    Args:
        facts: Of the one group; the rest as for ``fit_balls_and_test_residuals``.
    """
    places = np.flatnonzero(used)
    rest = ~np.eye(len(places), dtype=bool) & np.isfinite(facts.view_axis[places, 0])
    without, views = np.nonzero(rest)
    return _test_residuals(
        facts, places[views], without, np.repeat(start, len(places), axis=0), policy
    )


def _test_residuals(
    facts: GroupFacts, views: IntArray, owner: IntArray, start: FloatArray, policy: Policy
) -> ChiSquareResiduals:
    """Residuals of sets of views, whose numbers are their owners, increasing, shape (N,)."""
    sets, begun = len(start), np.isfinite(start[owner, 0])
    views, owner = views[begun], owner[begun]
    freedom = 2 * np.bincount(owner, minlength=sets) - 3
    with np.errstate(all="ignore"):
        point, squares = _fit_points(facts, views, owner, start, policy)
    total = np.bincount(owner, squares, sets).astype(float)
    total[(freedom < 1) | ~np.isfinite(point[:, 0])] = np.nan
    p_value = np.full(sets, np.nan)
    there = np.isfinite(total)
    p_value[there] = chdtrc(freedom[there], total[there])
    point[~there] = np.nan
    return ChiSquareResiduals(point, total, np.maximum(freedom, 0), p_value)


def p_values(facts: GroupFacts, used: BoolArray, start: FloatArray, policy: Policy) -> FloatArray:
    """p-value of each group, shape (G,); infinite where ``find_untestable_groups`` names it."""
    found = fit_balls_and_test_residuals(facts, used, start, policy).p_value
    found[find_untestable_groups(facts, used, policy)] = np.inf
    return found


def find_untestable_groups(facts: GroupFacts, used: BoolArray, policy: Policy) -> BoolArray:
    """Groups whose residuals say nothing, shape (G,): nobody says how exact one of their given cameras
    is, or lines leave all but one of their cameras open.

    Args:
        facts: The groups.
        used: Views that count, shape (V,).
        policy: Its ``given_sigma_px`` says it of given cameras without covariance.
    """
    found = np.zeros(facts.groups, bool)
    if not policy.given_sigma_px:
        found[facts.view_group[used & facts.view_bare]] = True
    left_open = used & facts.view_open
    rest = np.bincount(facts.view_group[used & ~left_open], minlength=facts.groups)
    with_open = facts.view_group[left_open]
    found[with_open] |= rest[with_open] < 2
    return found


def _fit_points(
    facts: GroupFacts, views: IntArray, owner: IntArray, start: FloatArray, policy: Policy
) -> tuple[FloatArray, FloatArray]:
    """The most likely points, (G, 3), and each view's squared residual in units of sigma, (N,)."""
    slope, axis, position = (
        facts.view_slope[views],
        facts.view_axis[views],
        facts.view_position[views],
    )
    point = start.copy()
    weight = _inverse_covariances(facts, views, point[owner], policy)
    nine, three = _flat_sum_indices(owner, 9), _flat_sum_indices(owner, 3)
    for step in range(_STEPS + 1):
        reach = point[owner] - position
        depth = _row_dot(axis, reach)
        offset = -_matrix_times_vector(slope, reach) / depth[:, None]
        if step == _STEPS:
            break
        # The first step holds the depths, so that a start far off does no harm.
        lean = offset[:, :, None] * axis[:, None] if step else 0.0
        jacobian = (slope + lean) / depth[:, None, None]
        pulled = jacobian.transpose(0, 2, 1) @ weight
        matrix = _sum_by_owner(nine, pulled @ jacobian, (len(point), 3, 3))
        pull = _sum_by_owner(three, _matrix_times_vector(pulled, offset), point.shape)
        point = point + _solve_3x3(matrix, pull)
    squares = _row_dot(offset, _matrix_times_vector(weight, offset))
    squares[depth <= 0] = np.nan
    return point, squares


def _inverse_covariances(
    facts: GroupFacts, views: IntArray, points: FloatArray, policy: Policy
) -> FloatArray:
    """Inverse covariance of each view's click and calibration, at a point each, (N, 2, 2)."""
    covariances = pixel_covariances(facts, views, points, policy)
    (a, b), (c, d) = covariances.transpose(1, 2, 0)
    adjugate = np.empty_like(covariances)
    adjugate[:, 0, 0], adjugate[:, 0, 1] = d, -b
    adjugate[:, 1, 0], adjugate[:, 1, 1] = -c, a
    weights: FloatArray = adjugate / (a * d - b * c)[:, None, None]
    return weights


def _solve_3x3(matrix: FloatArray, pull: FloatArray) -> FloatArray:
    """Solutions of 3 x 3 systems by cofactors, NaN where one has none, shape (G, 3)."""
    a, b, c = matrix.transpose(1, 0, 2)
    columns = np.empty(matrix.shape)
    columns[..., 0] = first = cross(b, c)
    columns[..., 1] = cross(c, a)
    columns[..., 2] = cross(a, b)
    solution: FloatArray = _matrix_times_vector(columns, pull) / _row_dot(a, first)[:, None]
    return solution


def _flat_sum_indices(owner: IntArray, width: int) -> IntArray:
    """Where each number of rows of a width is added for its owner."""
    cells: IntArray = (width * owner[:, None] + np.arange(width)).ravel()
    return cells


def _sum_by_owner(cells: IntArray, parts: FloatArray, shape: tuple[int, ...]) -> FloatArray:
    """Sums of rows by their owners, one after the other: alone as among others the same bits."""
    total: FloatArray = np.bincount(cells, parts.ravel(), int(np.prod(shape))).astype(float)
    return total.reshape(shape)


def _matrix_times_vector(matrices: FloatArray, vectors: FloatArray) -> FloatArray:
    product: FloatArray = (matrices @ vectors[..., None])[..., 0]
    return product


def _row_dot(a: FloatArray, b: FloatArray) -> FloatArray:
    product: FloatArray = (a * b).sum(axis=-1)
    return product
