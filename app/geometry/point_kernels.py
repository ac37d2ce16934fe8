"""Compiled kernel that thins points: of each curve those that lie farthest apart."""

from __future__ import annotations

import numpy as np

from app.geometry.curve_residuals import compiled


@compiled
def keep_farthest_points(pixels, curve, limits, keep):
    """Writes which points are kept: of a curve the one farthest from the middle of its points, and
    after it each that is farthest from those before it.

    Args:
        pixels: Shape (N, 2).
        curve: Index of each point's curve, shape (N,), increasing.
        limits: How many of each curve are kept, shape (M,).
        keep: Result, shape (N,); of equally far points the first is kept.
    """
    begin, count = 0, len(pixels)
    apart = np.empty(count)
    while begin < count:
        end = begin
        while end < count and curve[end] == curve[begin]:
            end += 1
        left = limits[curve[begin]]
        keep[begin:end] = end - begin <= left
        if end - begin > left:
            x, y = pixels[begin:end, 0].mean(), pixels[begin:end, 1].mean()
            farthest = _update_distances(pixels, apart, begin, end, x, y, True)
            for nth in range(left):
                keep[farthest] = True
                x, y = pixels[farthest]
                farthest = _update_distances(pixels, apart, begin, end, x, y, nth == 0)
        begin = end


@compiled
def _update_distances(pixels, apart, begin, end, x, y, anew):
    """Lowers each point's squared distance to the nearest chosen one (``anew``: to this one alone);
    returns the point whose distance is largest."""
    farthest, most = begin, -1.0
    for n in range(begin, end):
        squared = (pixels[n, 0] - x) ** 2 + (pixels[n, 1] - y) ** 2
        apart[n] = squared if anew else min(apart[n], squared)
        if apart[n] > most:
            farthest, most = n, apart[n]
    return farthest
