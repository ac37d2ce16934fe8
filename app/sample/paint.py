"""Paint: the lines on the grass, at their true width.

Each pixel takes the share of its footprint on the grass that is painted, so that a far line
fades instead of growing to a whole pixel.
"""

from __future__ import annotations

import math

import numba

HALF_LENGTH, HALF_WIDTH = 52.5, 34.0
HALF_LINE = 0.06

_jit = numba.njit(cache=True, nogil=True, fastmath=False)


@_jit
def _line_coverage(distance: float, width: float, half: float) -> float:
    """Share of a footprint of that width that a line of half width ``half`` covers."""
    if abs(distance) > half + 0.5 * width:
        return 0.0
    low = max(distance - 0.5 * width, -half)
    high = min(distance + 0.5 * width, half)
    return max(high - low, 0.0) / width


@_jit
def edge_coverage(distance: float, width: float) -> float:
    """Share of a footprint that lies on the positive side."""
    if abs(distance) > 0.5 * width:
        return 1.0 if distance > 0 else 0.0
    return distance / width + 0.5


@_jit
def _ring_coverage(
    x: float, y: float, radius: float, ax_x: float, ax_y: float, ay_x: float, ay_y: float
) -> float:
    r = math.hypot(x, y)
    if abs(r - radius) > 6.0 or r < 1e-6:
        return 0.0
    width = (abs(x * ax_x + y * ax_y) + abs(x * ay_x + y * ay_y)) / r + 1e-6
    return _line_coverage(r - radius, width, HALF_LINE)


@_jit
def paint_coverage(
    gx: float, gy: float, ax_x: float, ax_y: float, ay_x: float, ay_y: float
) -> float:
    """Share of a pixel that is painted white.

    (ax_x, ax_y) is the step on the grass for one pixel to the right, (ay_x, ay_y) for one down.
    """
    x, y = abs(gx), abs(gy)
    wx = abs(ax_x) + abs(ay_x) + 1e-6
    wy = abs(ax_y) + abs(ay_y) + 1e-6
    paint = 0.0
    end_x, end_y = (
        edge_coverage(HALF_LENGTH + HALF_LINE - x, wx),
        edge_coverage(HALF_WIDTH + HALF_LINE - y, wy),
    )
    paint = max(paint, _line_coverage(y - HALF_WIDTH, wy, HALF_LINE) * end_x)
    paint = max(paint, _line_coverage(x - HALF_LENGTH, wx, HALF_LINE) * end_y)
    paint = max(paint, _line_coverage(x, wx, HALF_LINE) * end_y)
    for depth, half in ((16.5, 20.16), (5.5, 9.16)):
        front = HALF_LENGTH - depth
        end = edge_coverage(half + HALF_LINE - y, wy)
        paint = max(paint, _line_coverage(x - front, wx, HALF_LINE) * end)
        end = edge_coverage(x - front + HALF_LINE, wx) * end_x
        paint = max(paint, _line_coverage(y - half, wy, HALF_LINE) * end)
    paint = max(paint, _ring_coverage(gx, gy, 9.15, ax_x, ax_y, ay_x, ay_y))
    sign = 1.0 if gx > 0 else -1.0
    off = gx - sign * 41.5
    outside = edge_coverage(36.0 - x + HALF_LINE, wx)
    if outside > 0.0:
        paint = max(paint, _ring_coverage(off, gy, 9.15, ax_x, ax_y, ay_x, ay_y) * outside)
    if x < HALF_LENGTH + 0.06 and y < HALF_WIDTH + 0.06:
        corner_x, corner_y = x - HALF_LENGTH, y - HALF_WIDTH
        if corner_x > -1.5 and corner_y > -1.5:
            # Footprints are symmetric, so the mirrored corner may use the same steps.
            paint = max(paint, _ring_coverage(corner_x, corner_y, 1.0, ax_x, ax_y, ay_x, ay_y))
    width = 0.5 * (wx + wy)
    paint = max(paint, edge_coverage(0.12 - math.hypot(off, gy), width) * min(1.0, 0.24 / wy))
    return max(paint, edge_coverage(0.13 - math.hypot(gx, gy), width) * min(1.0, 0.26 / wy))
