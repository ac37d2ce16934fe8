"""Speed of the kernels, as ratios to OpenCV, scipy and numpy in the same run."""

from __future__ import annotations

import time
from collections.abc import Callable

import cv2
import numpy as np
from scipy.optimize import least_squares

from app.geometry.arrays import FloatArray
from app.geometry.camera import Camera
from app.geometry.likely_point import invert_symmetric
from app.geometry.resection_kernels import solve_damped_step
from app.geometry.triangulation import smallest_singular_vectors, triangulate_pairs
from app.soccer.annotation import make_lines
from app.soccer.frames import ImageSize
from app.soccer.pitch import Pitch
from app.soccer.policy import CalibrationPolicy
from app.solving.jaccard import project_markings
from app.solving.observations import make_observations
from app.solving.resect import ResectionProblem
from tests.bench.table import print_table
from tests.cameras import looking

SIZE = ImageSize(960, 540)
PAIRS = 1_000_000
REPEATS = 5
TIMES = 1000
"""Calls in one measurement of what takes microseconds."""


def bench_geometry() -> None:
    """Triangulation of many pairs, one refinement of a camera, and the compiled kernels alone."""
    rows = [*_triangulation(), *_refinement(), *_damped_steps(), *_inverse()]
    # One pair is what an edit asks for, many are a dataset.
    rows += [*_singular_vectors(1, TIMES), *_singular_vectors(100_000, 1)]
    print_table(
        "Speed against libraries, same run, best of five",
        ("what", "Touchline", "library", "unit", "ratio library / Touchline"),
        rows,
    )


def _triangulation() -> list[list[object]]:
    generator = np.random.default_rng(1)
    main, replay = _camera(0.0, 60.0, -15.0), _camera(75.0, -10.0, -8.0)
    points = generator.uniform([10, -20, -5], [40, 20, 0], (PAIRS, 3))
    a, b = main.project(points), replay.project(points)
    P_a, P_b = (np.broadcast_to(camera.P, (PAIRS, 3, 4)) for camera in (main, replay))
    few = 2000

    def one_by_one() -> None:
        for index in range(few):
            cv2.triangulatePoints(P_a[index], P_b[index], a[index][:, None], b[index][:, None])

    ours = _best(lambda: triangulate_pairs(P_a, P_b, a, b)) / PAIRS
    # Every pair of a dataset has cameras of its own, so OpenCV is called pair by pair.
    theirs = _best(one_by_one) / few
    name = f"triangulate {PAIRS} pairs (cv2)"
    return [[name, PAIRS * ours, PAIRS * theirs, "s", theirs / ours]]


def _refinement() -> list[list[object]]:
    camera, pitch = _camera(0.0, 60.0, -15.0), Pitch()
    lines = {
        marking: polyline[:: max(len(polyline) // 5, 1)]
        for marking, polyline in project_markings(camera, pitch, SIZE).items()
    }
    observations = make_observations(make_lines(lines), pitch, SIZE)
    problem = ResectionProblem.of(SIZE, CalibrationPolicy())
    start = problem.parameters(camera) + np.array([0.01, 0.01, 0.002, 1.0, 1.0, 0.5, 0.02, 0.0])
    ours = _best(lambda: problem.refine(observations, start[None]))
    theirs = _best(
        lambda: least_squares(
            lambda row: problem.distances(row, observations), start, loss="soft_l1", f_scale=2.0
        )
    )
    return [["refine one camera (scipy)", 1e3 * ours, 1e3 * theirs, "ms", theirs / ours]]


def _damped_steps() -> list[list[object]]:
    """One step from each of 40 starts of a camera with 8 parameters, as resection asks for it."""
    generator = np.random.default_rng(2)
    jacobians = generator.normal(size=(40, 60, 8))
    information = np.swapaxes(jacobians, 1, 2) @ jacobians
    gradient, damping = generator.normal(size=(40, 8)), np.full(40, 1e-3)
    step, diagonal = np.empty((40, 8)), np.arange(8)

    def by_numpy() -> FloatArray:
        damped = information.copy()
        damped[:, diagonal, diagonal] *= 1 + damping[:, None]
        return np.linalg.solve(damped, -gradient[..., None])[..., 0]

    ours = _best(lambda: _often(lambda: solve_damped_step(gradient, information, damping, step)))
    theirs = _best(lambda: _often(by_numpy))
    np.testing.assert_allclose(step, by_numpy(), rtol=1e-6)
    return [
        ["40 damped steps (numpy)", 1e6 * ours / TIMES, 1e6 * theirs / TIMES, "us", theirs / ours]
    ]


def _inverse() -> list[list[object]]:
    """The information about a ball, inverted, as the descent to the likeliest point asks for it."""
    slopes = np.random.default_rng(4).normal(size=(12, 3))
    information, found = slopes.T @ slopes, np.empty((3, 3))
    ours = _best(lambda: _often(lambda: invert_symmetric(information, found)))
    theirs = _best(lambda: _often(lambda: np.linalg.inv(information)))
    np.testing.assert_allclose(found, np.linalg.inv(information), rtol=1e-9)
    name = "inverse of 3 x 3 (numpy)"
    return [[name, 1e6 * ours / TIMES, 1e6 * theirs / TIMES, "us", theirs / ours]]


def _singular_vectors(count: int, times: int) -> list[list[object]]:
    matrices, found = np.random.default_rng(3).normal(size=(count, 4, 4)), np.empty((count, 4))
    ours = _best(lambda: _often(lambda: smallest_singular_vectors(matrices, found), times))
    theirs = _best(lambda: _often(lambda: np.linalg.svd(matrices), times))
    name = f"{count} smallest singular vectors (numpy)"
    return [[name, 1e6 * ours / times, 1e6 * theirs / times, "us", theirs / ours]]


def _often(work: Callable[[], object], times: int = TIMES) -> None:
    for _ in range(times):
        work()


def _camera(*position: float) -> Camera:
    return looking(position, (25.0, 0.0, 0.0), 2000.0, size=SIZE)


def _best(work: Callable[[], object]) -> float:
    """Shortest CPU time of several runs after one that is not counted, seconds."""
    work()
    times = []
    for _ in range(REPEATS):
        began = time.process_time()
        work()
        times.append(time.process_time() - began)
    return min(times)
