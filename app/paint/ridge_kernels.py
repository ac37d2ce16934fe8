"""Compiled kernels: strength and direction of ridges of brightness, and their crest."""

from __future__ import annotations

import numpy as np
from numba import njit

compiled = njit(cache=True, nogil=True, error_model="numpy")

FLAT = 0.6
"""Largest share that the bend along a ridge may have in the bend across it."""
STEPS = ((0, 1), (1, 1), (1, 0), (1, -1))
"""Row and column to the neighbour across a ridge: across the columns, diagonal, ..."""


@compiled
def ridge_strength(level, grass, inside, side, strength, across):
    """Strength of the bright ridge at each pixel, and the direction across it.

    Args:
        level: Smoothed brightness, float32, shape (H, W).
        grass: 1 where the colour is that of grass, shape (H, W).
        inside: 1 on the field of play, shape (H, W).
        side: Where grass is looked for to both sides, pixels.
        strength: Result: the bend across, grey levels per square pixel; 0 where there is no ridge.
        across: Result: index into ``STEPS``.
    """
    height, width = level.shape
    strength[:] = 0.0
    across[:] = 0
    for y in range(1, height - 1):
        for x in range(1, width - 1):
            if inside[y, x] == 0:
                continue
            here = 2.0 * level[y, x]
            xx = level[y, x + 1] + level[y, x - 1] - here
            yy = level[y + 1, x] + level[y - 1, x] - here
            if xx + yy >= 0.0:
                continue
            xy = 0.25 * (
                level[y + 1, x + 1]
                + level[y - 1, x - 1]
                - level[y + 1, x - 1]
                - level[y - 1, x + 1]
            )
            half = 0.5 * (xx - yy)
            root = np.sqrt(half * half + xy * xy)
            low, high = 0.5 * (xx + yy) - root, 0.5 * (xx + yy) + root
            if low >= 0.0 or abs(high) > -FLAT * low:
                continue
            # Eigenvector of the lower eigenvalue, from the better conditioned of two forms.
            if half < 0:
                vx, vy = half - root, xy
            else:
                vx, vy = xy, -half - root
            length = np.sqrt(vx * vx + vy * vy)
            if length == 0.0:
                continue
            vx, vy = vx / length, vy / length
            if not (
                _is_grass_at(grass, x + side * vx, y + side * vy)
                and _is_grass_at(grass, x - side * vx, y - side * vy)
            ):
                continue
            strength[y, x] = -low
            if abs(vy) < 0.4142 * abs(vx):
                across[y, x] = 0
            elif abs(vx) < 0.4142 * abs(vy):
                across[y, x] = 2
            else:
                across[y, x] = 1 if vx * vy > 0 else 3


@compiled
def _is_grass_at(grass, x, y):
    column, row = int(x + 0.5), int(y + 0.5)
    if column < 0 or row < 0 or column >= grass.shape[1] or row >= grass.shape[0]:
        return False
    return grass[row, column] == 1


@compiled
def thin_ridges(strength, across, strong, thin):
    """Writes 1 where a strong ridge is strongest across itself, else 0."""
    height, width = strength.shape
    thin[:] = 0
    for y in range(1, height - 1):
        for x in range(1, width - 1):
            if strong[y, x] == 0:
                continue
            dy, dx = STEPS[across[y, x]]
            here = strength[y, x]
            if here > strength[y + dy, x + dx] and here >= strength[y - dy, x - dx]:
                thin[y, x] = 1
