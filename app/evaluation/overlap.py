"""Overlap and size of two boxes, the two numbers by which boxes are compared."""

from __future__ import annotations

import math

from app.soccer.frames import Box


def iou(a: Box, b: Box) -> float:
    """Intersection over union of two boxes; 0 when they only touch.

    Example:
        >>> iou(Box(0, 0, 2, 2), Box(1, 0, 2, 2))
        0.3333333333333333
    """
    width = min(a.x + a.width, b.x + b.width) - max(a.x, b.x)
    height = min(a.y + a.height, b.y + b.height) - max(a.y, b.y)
    shared = max(width, 0.0) * max(height, 0.0)
    return shared / (a.width * a.height + b.width * b.height - shared)


def size_error_percent(box: Box, careful: Box) -> float:
    """|d - d_careful| in per cent of the reference box's diagonal, d = (width + height) / 2.

    Example:
        >>> size_error_percent(Box(0, 0, 6, 8), Box(0, 0, 3, 4))
        70.0
    """
    return 100.0 * abs(box.diameter - careful.diameter) / math.hypot(careful.width, careful.height)
