"""Table 1 of the paper: how annotated and optimised ball boxes compare with the true ones."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass

import numpy as np

from app.evaluation.frame import iou, size_error_percent
from app.sample.scene import SceneTruth
from app.soccer.ball_boxes import collect_ball_boxes
from app.soccer.frames import Box
from app.soccer.group import Group
from app.soccer.solution import Solution


@dataclass(frozen=True)
class BoxRow:
    """One line of the table.

    Attributes:
        boxes: ``annotated`` or ``optimized``.
        iou: Mean intersection over union with the true box.
        size_error_percent: Mean of |d - d_true| in per cent of the true box's diagonal, with d of
            a box (w + h) / 2.
        count: Boxes compared; the same views for both lines.
    """

    boxes: str
    iou: float
    size_error_percent: float
    count: int


def paper_table_1(
    groups: Iterable[Group], solutions: Mapping[str, Solution], truth: Mapping[str, SceneTruth]
) -> list[BoxRow]:
    """Compare boxes with the truth, over the views that have all three.

    Args:
        groups: As annotated.
        solutions: By group key.
        truth: By group key; its tight boxes take the place of careful manual ones.

    Returns:
        The line of the annotated boxes and the line of the optimised ones; both count 0 and hold
        zeros when there is nothing to compare.
    """
    annotated: list[tuple[Box, Box]] = []
    optimized: list[tuple[Box, Box]] = []
    for group in groups:
        solution, true = solutions.get(group.key), truth.get(group.key)
        if solution is None or true is None:
            continue
        for said, found, careful in _boxes(group, solution, true):
            annotated.append((said, careful))
            optimized.append((found, careful))
    return [_row("annotated", annotated), _row("optimized", optimized)]


def _boxes(group: Group, solution: Solution, truth: SceneTruth) -> Iterable[tuple[Box, Box, Box]]:
    """Annotated, optimised and true box of every view that has them."""
    for view in group.views:
        boxes, true = collect_ball_boxes(solution, view), truth.view(view.key)
        if true is not None and "annotated" in boxes and "optimized" in boxes:
            yield boxes["annotated"], boxes["optimized"], true.ball_box


def _row(name: str, pairs: list[tuple[Box, Box]]) -> BoxRow:
    if not pairs:
        return BoxRow(name, 0.0, 0.0, 0)
    return BoxRow(
        boxes=name,
        iou=float(np.mean([iou(box, careful) for box, careful in pairs])),
        size_error_percent=float(np.mean([size_error_percent(*pair) for pair in pairs])),
        count=len(pairs),
    )
