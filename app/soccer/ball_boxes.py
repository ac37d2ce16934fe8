"""Which boxes of the ball a view has: one rule for exports, the evaluation and the screen.

The optimised and the exact box follow from the 3D ball, so only a view that helped to find it
has them: one in a valid pair. In any other view the 3D ball may lie anywhere; what a person
annotated there stays, and nothing is computed from it.
"""

from __future__ import annotations

import math
from dataclasses import replace
from typing import get_args

from app.soccer.choices import BoxKind
from app.soccer.frames import Box
from app.soccer.group import View
from app.soccer.solution import BallFit, Solution

BOX_KINDS: tuple[str, ...] = get_args(BoxKind)


def is_ball_3d_valid_in_view(solution: Solution | None, view: View) -> bool:
    """Whether the 3D ball holds in a view: there is one, and the view is in a valid pair.

    That there is a fit says nothing: it is computed for other views, too.
    """
    solved = solution.view(view.key) if solution else None
    return solved is not None and solution is not None and bool(solution.ball and solved.included)


def collect_ball_boxes(solution: Solution | None, view: View) -> dict[str, Box]:
    """The boxes that a view has, by kind of ``BOX_KINDS``."""
    boxes = {"annotated": view.ball.box if view.ball else None}
    solved = solution.view(view.key) if solution else None
    if solved is not None and solved.ball is not None and is_ball_3d_valid_in_view(solution, view):
        boxes |= {"optimized": solved.ball.optimized_box, "exact": solved.ball.exact_box}
    return {kind: box for kind, box in boxes.items() if box is not None and _is_finite(box)}


def _is_finite(box: Box) -> bool:
    return all(map(math.isfinite, (box.x, box.y, box.width, box.height)))


def find_ball_fit(solution: Solution | None, view: View, everything: bool) -> BallFit | None:
    """The 3D ball seen again in a view.

    In a view that annotates a ball and is in no valid pair it stands only when everything is
    asked, for its error alone: without boxes and what they are made from.
    """
    solved = solution.view(view.key) if solution else None
    if solution is None or solution.ball is None or solved is None or solved.ball is None:
        return None
    if is_ball_3d_valid_in_view(solution, view):
        return solved.ball
    if view.ball is None or not everything:
        return None
    return replace(
        solved.ball,
        optimized_diameter_px=None,
        optimized_box=None,
        optimized_error_m=None,
        exact_box=None,
        size_ratio=None,
    )
