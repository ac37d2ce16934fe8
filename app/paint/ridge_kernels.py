"""Compiled kernels: strength and direction of ridges of brightness, and their crest."""

from __future__ import annotations

import numpy as np
from numba import njit

from app.paint.grass_colour import is_grass

compiled = njit(cache=True, nogil=True, error_model="numpy")

FLAT = 0.6
"""Largest share that the bend along a ridge may have in the bend across it."""
STEPS = ((0, 1), (1, 1), (1, 0), (1, -1))
"""Row and column to the neighbour across a ridge: across the columns, diagonal, ..."""


@compiled
def ridge_strength(level, image, inside, side, least, strength, across):
    """Strength of the bright ridge at each pixel, and the direction across it.

    Args:
        level: Smoothed brightness, float32, shape (H, W).
        image: Red green blue, shape (H, W, 3).
        inside: 1 on the field of play, shape (H, W).
        side: Where grass is looked for to both sides, pixels.
        least: Strength from which on a ridge is looked at.
        strength: Result: the bend across, grey levels per square pixel; 0 where there is no ridge.
        across: Result: index into ``STEPS``.
    """
    height, width = level.shape
    strength[:] = 0.0
    across[:] = 0
    # A bend across of b is with one along of FLAT b at most, either way.
    bent, folded, flattest = FLAT / (1.0 + FLAT) ** 2, -FLAT / (1.0 - FLAT) ** 2, FLAT - 1.0
    bends = np.empty(width)
    for y in range(1, height - 1):
        # Nothing branches here, so that several pixels are worked out at once.
        for x in range(1, width - 1):
            here = 2.0 * level[y, x]
            xx = level[y, x + 1] + level[y, x - 1] - here
            bends[x] = xx + (level[y + 1, x] + level[y - 1, x] - here)
        for x in range(1, width - 1):
            both = bends[x]
            if both > flattest * least or inside[y, x] == 0:
                continue
            here = 2.0 * level[y, x]
            xx = level[y, x + 1] + level[y, x - 1] - here
            yy = level[y + 1, x] + level[y - 1, x] - here
            xy = 0.25 * (
                level[y + 1, x + 1]
                + level[y - 1, x - 1]
                - level[y + 1, x - 1]
                - level[y - 1, x + 1]
            )
            product, square = xx * yy - xy * xy, both * both
            if (product > bent * square) | (product < folded * square):
                continue
            half = 0.5 * (xx - yy)
            root = np.sqrt(half * half + xy * xy)
            bend = root - 0.5 * both
            if bend < least:
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
                _is_grass_at(image, x + side * vx, y + side * vy)
                and _is_grass_at(image, x - side * vx, y - side * vy)
            ):
                continue
            strength[y, x] = bend
            if abs(vy) < 0.4142 * abs(vx):
                across[y, x] = 0
            elif abs(vx) < 0.4142 * abs(vy):
                across[y, x] = 2
            else:
                across[y, x] = 1 if vx * vy > 0 else 3


@compiled
def _is_grass_at(image, x, y):
    column, row = int(x + 0.5), int(y + 0.5)
    if column < 0 or row < 0 or column >= image.shape[1] or row >= image.shape[0]:
        return False
    return is_grass(image[row, column, 0], image[row, column, 1], image[row, column, 2])


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
