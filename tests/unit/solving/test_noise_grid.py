"""Noise grid: the lowest point between those of a grid, and its variance from leaving out blocks."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from app.solving.noise_grid import jackknife_variance, vertex


@given(st.floats(-0.49, 0.49), st.floats(0.1, 9.0), st.floats(-5.0, 5.0))
def test_the_lowest_point_of_a_parabola_is_found(off: float, bend: float, least: float) -> None:
    cost = least + bend * (np.arange(7) - 3 - off) ** 2
    assert vertex(cost, 3) == (pytest.approx(off, abs=1e-9), pytest.approx(least, abs=1e-9))


@pytest.mark.parametrize("at", [0, 3])
def test_at_an_end_it_is_the_end(at: int) -> None:
    cost = np.arange(4.0) if at == 0 else np.arange(4.0)[::-1]
    assert vertex(cost, at) == (0.0, 0.0)


def test_a_flat_ground_has_no_lowest_point() -> None:
    assert vertex(np.full(3, 7.0), 1) == (0.0, 7.0)


def test_the_jackknife_of_means_is_the_variance_of_their_mean() -> None:
    numbers = np.random.default_rng(1).normal(size=(10, 1))
    without = (numbers.sum(axis=0) - numbers) / 9
    assert jackknife_variance(without) == pytest.approx(numbers.var(axis=0, ddof=1) / 10)
