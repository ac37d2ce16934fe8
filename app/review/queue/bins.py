"""Bins: where the bars of histograms begin and end, equally wide or equally wide on a log scale.

Their edges are short decimal numbers, so that the query of a bar can repeat them exactly.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from app.geometry.arrays import FloatArray, IntArray


def even(low: float, high: float, bins: int) -> tuple[float, ...]:
    """Edges of bins of equal width, shape (bins + 1,)."""
    return tuple(np.round(np.linspace(low, high, bins + 1), 6).tolist())


def decades(first: int, last: int, per_decade: int) -> tuple[float, ...]:
    """Edges of logarithmic bins from ``10**first`` to ``10**last``, after one that begins at 0.

    Numbers that spread over decades (errors of given and of drawn cameras, say) would fall into
    one bin of equal width. 0 has no logarithm: the bin before the first decade holds it, and
    whatever else is too small to matter.

    Args:
        first: Exponent of the first power of ten.
        last: Exponent of the last one.
        per_decade: Bins from one power of ten to the next.

    Example:
        >>> decades(-1, 1, 2)
        (0.0, 0.1, 0.316, 1.0, 3.16, 10.0)
    """
    steps = range(first * per_decade, last * per_decade + 1)
    return (0.0, *(float(f"{10 ** (step / per_decade):.3g}") for step in steps))


SIGMA_M = decades(-2, 2, 5)
"""Of the ball's uncertainty, metres: from a centimetre to a hundred metres."""
ERROR_PERCENT = decades(-2, 1, 6)
"""Of the reprojection error, per cent of the diagonal: from 0.2 px in HD to 220 px."""


def places(
    edges: Sequence[float], values: FloatArray, *, open_low: bool, open_high: bool
) -> IntArray:
    """The bin of each value, -1 for one in no bin (NaN, or beyond an end that is closed).

    As queries compare: from an edge on and below the next one; a closed last bin has its end.
    """
    bins = len(edges) - 1
    place = np.searchsorted(np.array(edges), values, "right") - 1
    if open_low:
        place = np.maximum(place, 0)
    place[values == edges[-1]] = bins - 1
    if open_high:
        place = np.minimum(place, bins - 1)
    place[np.isnan(values) | (place >= bins)] = -1
    return place.astype(np.int64)
