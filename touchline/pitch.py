"""Pitch: the 26 markings as points, to draw or to measure with."""

from __future__ import annotations

import math

import numpy as np

from touchline.lens import FloatArray

AREAS = (("Big rect.", 16.5, 40.32), ("Small rect.", 5.5, 18.32))
"""Depth and width of the penalty area and of the goal area, metres."""
MARK_M, RADIUS_M, GOAL_WIDTH_M, GOAL_HEIGHT_M = 11.0, 9.15, 7.32, 2.44
_TURN = 2 * math.pi


def markings(
    length: float = 105.0, width: float = 68.0, step: float = 0.25
) -> dict[str, FloatArray]:
    """Points along every marking, from end to end.

    Args:
        length: Of the pitch, metres.
        width: The same.
        step: Between two points, metres, at most.

    Returns:
        By name: points in the pitch frame, metres, z down, shape (N, 3).
    """
    x, y = length / 2, width / 2
    found = {
        "Side line top": _line((-x, -y), (x, -y), step),
        "Side line bottom": _line((-x, y), (x, y), step),
        "Side line left": _line((-x, -y), (-x, y), step),
        "Side line right": _line((x, -y), (x, y), step),
        "Middle line": _line((0, -y), (0, y), step),
        "Circle central": _arc(0.0, 0.0, _TURN, step),
    }
    # The penalty arc is what lies outside the penalty area.
    opening = math.acos((AREAS[0][1] - MARK_M) / RADIUS_M)
    for side, sign in (("left", -1), ("right", 1)):
        goal = sign * x
        for name, depth, across in AREAS:
            front, half = goal - sign * depth, across / 2
            left, right = sorted((goal, front))
            found[f"{name} {side} top"] = _line((left, -half), (right, -half), step)
            found[f"{name} {side} bottom"] = _line((left, half), (right, half), step)
            found[f"{name} {side} main"] = _line((front, -half), (front, half), step)
        facing = 0.0 if side == "left" else math.pi
        ends = facing - opening, facing + opening
        found[f"Circle {side}"] = _arc(goal - sign * MARK_M, *ends, step)
        # Posts are named as seen from the pitch.
        post, up = sign * GOAL_WIDTH_M / 2, -GOAL_HEIGHT_M
        found[f"Goal {side} post left"] = _line((goal, -post), (goal, -post, up), step)
        found[f"Goal {side} post right"] = _line((goal, post), (goal, post, up), step)
        found[f"Goal {side} crossbar"] = _line((goal, -post, up), (goal, post, up), step)
    return found


def _line(start: tuple[float, ...], end: tuple[float, ...], step: float) -> FloatArray:
    ends = np.array([(*point, 0.0)[:3] for point in (start, end)])
    count = max(math.ceil(float(np.linalg.norm(ends[1] - ends[0])) / step), 1)
    share = np.linspace(0.0, 1.0, count + 1)[:, None]
    points: FloatArray = (1 - share) * ends[0] + share * ends[1]
    return points


def _arc(x: float, first: float, last: float, step: float) -> FloatArray:
    count = math.ceil(RADIUS_M * (last - first) / step)
    angle = np.linspace(first, last, count + 1)
    return np.column_stack(
        [x + RADIUS_M * np.cos(angle), RADIUS_M * np.sin(angle), np.zeros_like(angle)]
    )
