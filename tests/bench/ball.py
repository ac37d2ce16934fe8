"""The ball on synthetic scenes with known truth: place, uncertainty, boxes, planted faults."""

from __future__ import annotations

from collections import Counter

import numpy as np

from app.geometry.arrays import FloatArray
from app.sample.scene import Scene
from app.soccer.policy import PAPER
from app.soccer.solution import Ball3D, BestBall, Solution
from app.solving.solve import solve_group
from tests.bench.boxes import paper_table_1
from tests.bench.table import print_table
from tests.scenes import make_scenes

GROUPS = 150
SEED = 7
INSIDE_95 = 7.815
"""Chi-squared with three degrees of freedom."""
FINDING_OF = {
    "bad_point": ("bad_point", "wrong_label"),
    "swapped_sides": ("sides_swapped",),
    "not_synchronous": ("not_synchronous", "view_disagrees"),
    "tiny_baseline": ("low_parallax",),
    "missing_ball": (),
    "wrong_label": ("wrong_label",),
}


def bench_ball() -> None:
    """Everything about the ball that needs the truth."""
    scenes = make_scenes(GROUPS, SEED, faults=False)
    solutions = {scene.group.key: solve_group(scene.group, PAPER) for scene in scenes}
    print_table(
        f"3D ball, {GROUPS} synthetic groups without faults",
        ("estimator", "solved", "error m, median", "mean", "p95", "truth in 95 % ellipsoid"),
        [
            _place("mean of valid pairs (the paper)", scenes, solutions, best=False),
            _place("maximum likelihood", scenes, solutions, best=True),
        ],
    )
    table = paper_table_1(
        [scene.group for scene in scenes],
        solutions,
        {scene.group.key: scene.truth for scene in scenes},
    )
    print_table(
        "Boxes against the true ones (the paper's table 1: 0.57 / 19.01 and 0.66 / 7.27)",
        ("boxes", "IoU", "size error % of diagonal", "count"),
        [[row.boxes, row.iou, row.size_error_percent, row.count] for row in table],
    )
    _faults()


def _place(
    name: str, scenes: list[Scene], solutions: dict[str, Solution], *, best: bool
) -> list[object]:
    errors, distances = [], []
    for scene in scenes:
        solution = solutions[scene.group.key]
        ball: Ball3D | BestBall | None = solution.best_ball if best else solution.ball
        if ball is None:
            continue
        off: FloatArray = np.array(ball.point) - np.array(scene.truth.ball)
        errors.append(float(np.linalg.norm(off)))
        distances.append(float(off @ np.linalg.solve(np.reshape(ball.covariance, (3, 3)), off)))
    inside = float(np.mean(np.array(distances) < INSIDE_95))
    return [
        name,
        len(errors),
        float(np.median(errors)),
        float(np.mean(errors)),
        float(np.percentile(errors, 95)),
        inside,
    ]


def _faults() -> None:
    """How often a planted fault is named, or stopped by a gate."""
    planted, named, stopped = Counter[str](), Counter[str](), Counter[str]()
    for scene in make_scenes(GROUPS, SEED + 1, faults=True):
        solution = solve_group(scene.group, PAPER)
        kinds = {finding.kind for finding in solution.findings}
        for fault in scene.truth.faults:
            planted[fault.kind] += 1
            named[fault.kind] += bool(kinds & set(FINDING_OF[fault.kind]))
            stopped[fault.kind] += not solution.passes
    rows = [[kind, planted[kind], named[kind], stopped[kind]] for kind in FINDING_OF]
    print_table(
        "Planted faults",
        ("kind", "planted", "named by a finding", "group stopped by a gate"),
        rows,
    )
