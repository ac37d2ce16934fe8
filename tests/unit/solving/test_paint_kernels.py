"""The compiled step towards the paint is the algebra that it stands for."""

from __future__ import annotations

import numpy as np
import pytest

from app.solving.paint_kernels import step_to_paint

SOFT_PX, SIGMAS, STRICT_PX, DAMPING, ROUNDS = 1.0, 4.0, 0.3, 1e-4, 4


def step_in_numpy(offsets, sigmas, base, jacobian, information, pull, strict):
    moved = np.zeros(8)
    for _ in range(ROUNDS):
        rest = offsets - jacobian @ moved
        if strict:
            robust = (1 + (rest / np.maximum(SIGMAS * sigmas, STRICT_PX)) ** 2) ** -2.0
        else:
            robust = 1 / np.sqrt(1 + (rest / SOFT_PX) ** 2)
        normal = jacobian.T @ ((base * robust)[:, None] * jacobian) + information
        normal[np.diag_indices(8)] *= 1 + DAMPING
        moved = np.linalg.solve(normal, jacobian.T @ (base * robust * offsets) + pull)
    return moved


def problem(seed=5):
    rng = np.random.default_rng(seed)
    jacobian = rng.normal(size=(60, 8)) * [900, 700, 300, 9, 9, 12, 400, 60]
    offsets = jacobian @ (rng.normal(size=8) * 1e-3) + rng.normal(size=60) * 0.1
    # Some of it is a player's sock.
    offsets[:6] += 5.0
    sigmas = rng.uniform(0.05, 0.4, 60)
    information = np.diag(rng.uniform(0.1, 4.0, 8))
    return offsets, sigmas, sigmas**-2.0, jacobian, information, rng.normal(size=8)


def solve(parts, strict):
    moved = np.empty(8)
    step_to_paint(*parts, ROUNDS, DAMPING, strict, SOFT_PX, SIGMAS, STRICT_PX, moved)
    return moved


@pytest.mark.parametrize("strict", [False, True])
def test_the_step_is_that_of_reweighted_least_squares(strict):
    parts = problem()
    assert solve(parts, strict) == pytest.approx(step_in_numpy(*parts, strict), rel=1e-9)


def test_what_lies_far_off_hardly_moves_a_strict_step():
    offsets, sigmas, base, *others = parts = problem()
    without = solve((offsets, sigmas, base * (np.arange(60) >= 6), *others), strict=True)
    strict, soft = (
        np.abs(parts[3] @ (solve(parts, strict=each) - without)).max() for each in (True, False)
    )
    assert strict < 0.05
    assert soft > 5 * strict


def test_a_step_that_nothing_determines_is_an_error():
    offsets, sigmas, base, jacobian, *_ = problem()
    jacobian[:, 2] = 0.0
    nothing = np.zeros((8, 8)), np.zeros(8)
    with pytest.raises(np.linalg.LinAlgError):
        solve((offsets, sigmas, base, jacobian, *nothing), strict=False)
