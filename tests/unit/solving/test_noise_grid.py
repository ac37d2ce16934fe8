"""Noise grid: the lowest point between those of a grid, and its variance from leaving out blocks."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.stats import f

from app.solving.noise_grid import (
    calibrated_log_sigma,
    interpolate_cost,
    jackknife_variance,
    lowest_cost_vertex,
    posterior_variance,
    sigma_prior_cost,
)


@given(st.floats(-0.49, 0.49), st.floats(0.1, 9.0), st.floats(-5.0, 5.0))
def test_the_lowest_point_of_a_parabola_is_found(off: float, bend: float, least: float) -> None:
    cost = least + bend * (np.arange(7) - 3 - off) ** 2
    assert lowest_cost_vertex(cost, 3) == (
        pytest.approx(off, abs=1e-9),
        pytest.approx(least, abs=1e-9),
    )


@pytest.mark.parametrize("at", [0, 3])
def test_at_an_end_it_is_the_end(at: int) -> None:
    cost = np.arange(4.0) if at == 0 else np.arange(4.0)[::-1]
    assert lowest_cost_vertex(cost, at) == (0.0, 0.0)


def test_a_flat_ground_has_no_lowest_point() -> None:
    assert lowest_cost_vertex(np.full(3, 7.0), 1) == (0.0, 7.0)


def test_the_jackknife_of_means_is_the_variance_of_their_mean() -> None:
    numbers = np.random.default_rng(1).normal(size=(10, 1))
    without = (numbers.sum(axis=0) - numbers) / 9
    assert jackknife_variance(without) == pytest.approx(numbers.var(axis=0, ddof=1) / 10)


def test_between_the_points_of_a_grid_costs_are_those_of_the_parabola() -> None:
    places = np.array([0.0, 0.4, 2.5, 5.9, 6.0])
    cost = 2.0 + 0.7 * (np.arange(7) - 2.2) ** 2
    assert interpolate_cost(cost, places) == pytest.approx(2.0 + 0.7 * (places - 2.2) ** 2)


@pytest.mark.parametrize("numbers", [5, 20, 200])
def test_a_sigma_of_few_numbers_is_as_much_wider_as_fishers_quantile_is(numbers: int) -> None:
    """Three axes by a variance from so many numbers: the ratio of both has Fisher's distribution."""
    logs = np.linspace(-4, 4, 801)
    cost = numbers * (logs + np.exp(-2 * logs) / 2)
    exact = np.sqrt(f.ppf(0.95, 3, numbers) / f.ppf(0.95, 3, 1e9))
    assert np.exp(calibrated_log_sigma(logs, cost)) == pytest.approx(exact, rel=0.01)


def test_the_prior_counts_as_the_two_numbers_that_it_is_worth_and_a_scatter_as_it_is() -> None:
    assert posterior_variance(0.0, 0, spread=0.5) == pytest.approx(0.25)
    assert posterior_variance(0.0, 50) == pytest.approx(1 / 101)
    assert posterior_variance(0.3, 50) == 0.3
    cost = sigma_prior_cost(np.log([1.0, 2.0, 4.0]), expected=2.0, spread=np.log(2))
    assert cost == pytest.approx([0.5, 0.0, 0.5])
