"""What the ball's own labels leave of its error: true cameras, and boxes as exact as they can be."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from app.geometry.arrays import FloatArray
from app.sample.scene import Scene
from app.sample.scenes import CENTER_SIGMA_PX, CENTER_SIGMA_SHARE
from app.soccer.frames import Box
from app.soccer.group import View
from app.soccer.policy import PAPER
from app.solving.calibrate import calibrate, compute_calibration_key, measure_calibration
from app.solving.solve import solve_group
from tests.bench.table import print_table
from tests.scenes import make_scenes

GROUPS, SEED = 36, 20261122
"""Those of ``bench_paint``."""
DRAWS = 8
Make = Callable[[Box, Box, np.random.Generator], Box]


def bench_ball_noise() -> None:
    """Print the table."""
    scenes = make_scenes(GROUPS, SEED, faults=False)
    kinds: list[tuple[str, Make, int]] = [
        ("true boxes", lambda box, _, __: box, 1),
        ("true boxes, whole pixels", lambda box, _, __: _rounded(box), 1),
        ("as labelled, two decimals", lambda _, label, __: label, 1),
        ("as labelled, whole pixels", lambda _, label, __: _rounded(label), 1),
        ("drawn anew", lambda box, _, rng: _noisy(box, rng, 1.0), DRAWS),
        ("drawn anew, half the noise", lambda box, _, rng: _noisy(box, rng, 0.5), DRAWS),
    ]
    rows = []
    for name, make, draws in kinds:
        rng = np.random.default_rng(SEED)
        off = [_errors(scene, make, rng) for _ in range(draws) for scene in scenes]
        mean, best = (np.array(column, dtype=float) for column in zip(*off, strict=True))
        rows.append([name, *_two(mean), *_two(best)])
    header = ("boxes, true cameras", "mean of pairs m, median", "p95", "best ball m, median", "p95")
    print_table(f"3D ball of {GROUPS} groups: what the labels of the ball leave", header, rows)


def _errors(scene: Scene, make: Make, rng: np.random.Generator) -> tuple[float, float]:
    group, known = scene.group, {}
    views = tuple(_with_box(view, scene, make, rng) for view in group.views)
    group = replace(group, views=views)
    for view in views:
        truth = scene.truth.view(view.key)
        found = calibrate(view.station.lines, group.pitch, view.size, PAPER.calibration)
        if truth is not None and found.camera is not None:
            key = compute_calibration_key(view.station, group.pitch, PAPER.calibration)
            right = replace(found, camera=truth.camera)
            known[key] = measure_calibration(right, view.station.lines, group.pitch, view.size)
    solution = solve_group(group, PAPER, known)
    places = [None if ball is None else ball.point for ball in (solution.ball, solution.best_ball)]
    mean, best = (
        np.nan if place is None else float(np.linalg.norm(np.subtract(place, scene.truth.ball)))
        for place in places
    )
    return mean, best


def _with_box(view: View, scene: Scene, make: Make, rng: np.random.Generator) -> View:
    truth = scene.truth.view(view.key)
    if truth is None:
        return view
    balls = tuple(
        ball if ball.box is None else replace(ball, box=make(truth.ball_box, ball.box, rng))
        for ball in view.balls
    )
    return replace(view, balls=balls)


def _rounded(box: Box) -> Box:
    left, top = round(box.x), round(box.y)
    right, bottom = round(box.x + box.width), round(box.y + box.height)
    return Box(left, top, max(right - left, 1), max(bottom - top, 1))


def _noisy(box: Box, rng: np.random.Generator, times: float) -> Box:
    sigma = times * np.hypot(CENTER_SIGMA_PX, CENTER_SIGMA_SHARE * box.diameter)
    x, y = rng.normal(0.0, sigma, 2)
    return Box(box.x + x, box.y + y, box.width, box.height)


def _two(values: FloatArray) -> tuple[float, float]:
    return float(np.nanmedian(values)), float(np.nanpercentile(values, 95))


if __name__ == "__main__":
    bench_ball_noise()
