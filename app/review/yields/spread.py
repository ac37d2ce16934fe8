"""Spreads: how certain the mean of pairs is, for many groups at once.

The same numbers as ``solving.triangulate.mean_covariance`` gives for one group. A covariance is
kept in three parts, so that both noises of the policy can be chosen afterwards:
``click^2 A + share^2 B + C``.
"""

from __future__ import annotations

from threading import Lock

import numpy as np
from numba import njit

from app.geometry.arrays import BoolArray, FloatArray, IntArray
from app.geometry.curve_residuals import projection_derivatives, unpack
from app.review.yields.table import YieldTable
from app.soccer.policy import Policy
from app.solving.triangulate import CLICK_DIAGONAL

_BITS = 62


def pair_spread(table: YieldTable) -> FloatArray:
    """The three parts of each pair alone, at its own point, shape (P, 3, 3, 3)."""
    total = np.zeros((len(table.pair_group), 3, 3, 3))
    for side in (0, 1):
        total += view_spread(
            table, table.pair_view[:, side], table.pair_point, table.pair_slope[:, side]
        )
    return total


def mean_spread(
    table: YieldTable, valid: BoolArray, groups: IntArray, points: FloatArray
) -> FloatArray:
    """The three parts of the mean of the valid pairs of some groups, shape (N, 3, 3, 3).

    Args:
        table: The dataset.
        valid: Pairs that count, shape (P,).
        groups: Rows of groups that have any, increasing, shape (N,).
        points: Their mean points, pitch frame, metres, shape (N, 3).
    """
    chosen = np.flatnonzero(valid & np.isin(table.pair_group, groups))
    place = np.searchsorted(groups, table.pair_group[chosen])
    number = np.bincount(place, minlength=len(groups))
    # A view moves the mean through every pair that it is in.
    views, rows = np.unique(table.pair_view[chosen].ravel(), return_inverse=True)
    slopes = np.zeros((len(views), 2, 3))
    shares = table.pair_slope[chosen] / number[place][:, None, None, None]
    np.add.at(slopes, rows, shares.reshape(-1, 2, 3))
    owner = np.searchsorted(groups, table.view_group[views])
    parts = view_spread(table, views, points[owner], slopes)
    total = np.zeros((len(groups), 3, 3, 3))
    np.add.at(total, owner, parts)
    return total


class SpreadMemo:
    """Spreads of means from before: while somebody moves a threshold, few groups change pairs."""

    def __init__(self, table: YieldTable):
        self._table, self._lock = table, Lock()
        starts = np.searchsorted(table.pair_group, np.arange(table.groups))
        place = np.arange(len(table.pair_group)) - starts[table.pair_group]
        # A group of twelve views has more pairs than a number has bits: it is computed anew.
        self._bit = np.where(place < _BITS, np.int64(1) << np.minimum(place, _BITS), 0)
        self._long = np.isin(np.arange(table.groups), table.pair_group[place >= _BITS])
        self._pattern = np.zeros(table.groups, np.int64)
        self._spread = np.zeros((table.groups, 3, 3, 3))

    def mean_spread(self, valid: BoolArray, groups: IntArray, points: FloatArray) -> FloatArray:
        """``mean_spread`` of the same arguments."""
        pattern = np.zeros(self._table.groups, np.int64)
        np.add.at(pattern, self._table.pair_group[valid], self._bit[valid])
        with self._lock:
            new = (pattern != self._pattern)[groups] | self._long[groups]
            fresh = groups[new]
            if len(fresh):
                self._spread[fresh] = mean_spread(self._table, valid, fresh, points[new])
                self._pattern[fresh] = pattern[fresh]
            return self._spread[groups]


def sigma_of(spread: FloatArray, policy: Policy) -> FloatArray:
    """Standard deviation along the longest axis under a policy, metres, shape (N,)."""
    weights = np.array([policy.click_sigma_px**2, policy.box_sigma_share**2, 1.0])
    covariance = np.einsum("p,npij->nij", weights, spread)
    return np.sqrt(np.linalg.eigvalsh(covariance)[:, -1])


def view_spread(
    table: YieldTable, views: IntArray, points: FloatArray, slopes: FloatArray
) -> FloatArray:
    """What each view adds to the covariance of its point, in three parts, shape (N, 3, 3, 3)."""
    pixels = np.zeros((len(views), 3, 2, 2))
    pixels[:, 0, (0, 1), (0, 1)] = (table.view_diagonal[views, None] / CLICK_DIAGONAL) ** 2
    pixels[:, 1, (0, 1), (0, 1)] = table.view_ball_px[views, None] ** 2
    known = np.flatnonzero(table.view_covariance[views, 0, 0] > 0)
    jacobians = np.empty((len(known), 2, table.view_parameters.shape[1]))
    half = table.view_diagonal[views[known]] / 2
    _jacobians(table.view_parameters[views[known]], points[known], half, jacobians)
    spread = table.view_covariance[views[known]]
    pixels[known, 2] = jacobians @ spread @ jacobians.transpose(0, 2, 1)
    turned = slopes.transpose(0, 2, 1)[:, None]
    total: FloatArray = turned @ pixels @ slopes[:, None]
    return total


# Not cached on disk: numba would not see that the kernels which it calls have changed.
@njit(error_model="numpy")
def _jacobians(
    parameters: FloatArray, points: FloatArray, half_diagonals: FloatArray, jacobians: FloatArray
) -> None:
    for row in range(len(parameters)):
        camera = unpack(parameters[row], half_diagonals[row])
        x, y, z = points[row] - parameters[row, 3:6]
        projection_derivatives(camera, x, y, z, jacobians[row])
