from __future__ import annotations

import numpy as np
import pytest

from app.geometry.arrays import FloatArray
from app.tracking.ball_fit_kernels import factor_block_tridiagonal, inverse_blocks, solve_factored

SIZE, COUNT = 3, 5


@pytest.fixture(scope="module")
def blocks() -> tuple[FloatArray, FloatArray, FloatArray]:
    """A positive definite block tridiagonal matrix, as blocks and whole."""
    generator = np.random.default_rng(0)
    diagonal = generator.normal(size=(COUNT, SIZE, SIZE))
    diagonal = diagonal @ diagonal.transpose(0, 2, 1) + 8 * np.eye(SIZE)
    beside = generator.normal(size=(COUNT - 1, SIZE, SIZE))
    whole = np.zeros((COUNT * SIZE, COUNT * SIZE))
    for at in range(COUNT):
        here = slice(at * SIZE, (at + 1) * SIZE)
        whole[here, here] = diagonal[at]
        if at + 1 < COUNT:
            after = slice((at + 1) * SIZE, (at + 2) * SIZE)
            whole[here, after], whole[after, here] = beside[at], beside[at].T
    return diagonal, beside, whole


def test_a_system_is_solved(blocks: tuple[FloatArray, FloatArray, FloatArray]) -> None:
    diagonal, beside, whole = blocks
    right = np.arange(COUNT * SIZE, dtype=float)
    found = solve_factored(factor_block_tridiagonal(diagonal, beside), right)
    assert np.allclose(whole @ found, right)


def test_blocks_of_the_inverse_are_those_of_the_whole(
    blocks: tuple[FloatArray, FloatArray, FloatArray],
) -> None:
    diagonal, beside, whole = blocks
    own, right_of = inverse_blocks(factor_block_tridiagonal(diagonal, beside))
    inverse = np.linalg.inv(whole).reshape(COUNT, SIZE, COUNT, SIZE)
    for at in range(COUNT):
        assert np.allclose(own[at], inverse[at, :, at])
        if at + 1 < COUNT:
            assert np.allclose(right_of[at], inverse[at, :, at + 1])
