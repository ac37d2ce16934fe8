from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.stats import chi2, f

from app.solving.line_noise import (
    EXPECTED_PX,
    LinePrior,
    collect_line_evidence,
    compute_line_noise,
    estimate_line_noise,
    fit_cost_minimum,
    interpolate_cost,
    jackknife_variance,
    log_sigma_posterior_variance,
    log_sigma_with_95_percent_coverage,
    sigma_prior_cost,
)
from app.solving.observations import compute_point_weights

MARKINGS, EACH, UNKNOWNS = 14, 6, 4
NO_PRIOR = np.zeros(UNKNOWNS)


def fitted(share, sigma=1.0, seed=0):
    """A linear problem with errors that the points of a marking share, and its fit."""
    rng = np.random.default_rng(seed)
    marking = np.repeat(np.arange(MARKINGS), EACH)
    slopes = rng.normal(size=(MARKINGS, UNKNOWNS))[marking]
    jacobian = slopes + 0.3 * rng.normal(size=(len(marking), UNKNOWNS))
    shared = np.sqrt(share) * rng.normal(size=MARKINGS)[marking]
    errors = sigma * (shared + np.sqrt(1 - share) * rng.normal(size=len(marking)))
    off = np.linalg.lstsq(jacobian, errors, rcond=None)[0]
    return jacobian, errors - jacobian @ off, marking, off


def noise_of(share, sigma=1.0, seed=0):
    jacobian, residuals, marking, off = fitted(share, sigma, seed)
    return compute_line_noise(residuals, jacobian, marking, NO_PRIOR, LinePrior(1.0, 0.1)), off


def held(share):
    """Share of fits whose error lies within the 95 % ellipsoid."""
    limit = chi2.ppf(0.95, UNKNOWNS)
    found = [noise_of(share, seed=seed) for seed in range(300)]
    return np.mean([off @ np.linalg.solve(item.parameters, off) < limit for item, off in found])


def evidence_of(share, sigma=1.0, seed=0):
    jacobian, residuals, marking, _ = fitted(share, sigma, seed)
    return collect_line_evidence(residuals, jacobian, marking, NO_PRIOR)


class TestEstimateLineNoise:
    @pytest.mark.parametrize(("share", "sigma"), [(0.0, 0.6), (0.45, 0.6), (0.6, 1.5)])
    def test_all_images_together_know_both_numbers(self, share, sigma):
        found = estimate_line_noise([evidence_of(share, sigma, seed) for seed in range(60)])
        assert found.views == 60
        assert found.sigma.low < sigma < found.sigma.high
        assert found.share.low - 0.01 <= share <= found.share.high
        assert found.sigma.high < 1.3 * found.sigma.low
        assert found.share.high - found.share.low < 0.3

    def test_an_image_of_wrong_points_in_ten_changes_little(self):
        good = [evidence_of(0.3, 1.0, seed) for seed in range(54)]
        bad = [evidence_of(0.3, 20.0, seed) for seed in range(6)]
        assert estimate_line_noise(good + bad).sigma.value == pytest.approx(1.0, rel=0.3)

    def test_no_image_says_nothing_and_neither_do_exact_lines(self):
        assert estimate_line_noise([]) is None
        assert estimate_line_noise([evidence_of(0.3, 1e-3, seed) for seed in range(30)]) is None

    @pytest.mark.parametrize("sigma", [0.3, 3.0])
    def test_each_further_image_moves_it_from_what_is_expected_to_what_is_seen(self, sigma):
        """No number of images is the first that counts."""
        found = [
            estimate_line_noise([evidence_of(0.3, sigma, seed) for seed in range(count)]).sigma
            for count in (1, 8, 40)
        ]
        off = [abs(np.log(one.value / sigma)) for one in found]
        assert off[0] < abs(np.log(EXPECTED_PX / sigma)) and off[2] < 0.1
        assert found[0].high / found[0].low > found[1].high / found[1].low
        assert all(one.low < sigma < one.high for one in found)

    def test_one_image_leaves_the_share_open(self):
        found = estimate_line_noise([evidence_of(0.3)]).share
        assert 0.05 < found.value < 0.6 and found.high - found.low > 0.25

    def test_pixels_of_a_larger_image_count_as_those_of_the_smaller(self):
        large = [
            evidence_of(0.3, 2.0, seed).rescaled_to_reference_pixels(2.0) for seed in range(30)
        ]
        small = [evidence_of(0.3, 1.0, seed) for seed in range(30)]
        assert estimate_line_noise(large).sigma.value == pytest.approx(
            estimate_line_noise(small).sigma.value
        )


class TestLineNoise:
    @pytest.mark.parametrize("share", [0.0, 0.5])
    def test_what_the_dataset_knows_makes_the_ellipsoid_neither_too_wide_nor_too_narrow(
        self, share
    ):
        limit, half = chi2.ppf([0.95, 0.5], UNKNOWNS)
        apart = []
        for seed in range(400):
            jacobian, residuals, marking, off = fitted(share, 0.5, seed)
            known = LinePrior(0.5, 0.05, share)
            found = compute_line_noise(residuals, jacobian, marking, NO_PRIOR, known).parameters
            apart.append(off @ np.linalg.solve(found, off))
        assert 0.925 < np.mean(np.array(apart) < limit) < 0.975
        assert np.median(apart) == pytest.approx(half, rel=0.15)

    @pytest.mark.parametrize("share", [0.0, 0.5, 0.8])
    def test_the_ellipsoid_holds_whatever_the_points_of_a_marking_share(self, share):
        assert 0.92 < held(share) < 0.985

    @pytest.mark.parametrize("share", [0.1, 0.5, 0.8])
    def test_the_share_is_found(self, share):
        found = [noise_of(share, seed=seed)[0].share for seed in range(40)]
        assert np.median(found) == pytest.approx(share, abs=0.1)

    def test_the_noise_is_found(self):
        found = [noise_of(0.3, sigma=2.0, seed=seed)[0].variance for seed in range(40)]
        assert np.sqrt(np.median(found)) == pytest.approx(2.0, rel=0.12)

    def test_a_perfect_fit_is_not_believed_beyond_the_floor(self):
        jacobian, residuals, marking, _ = fitted(0.0)
        found = compute_line_noise(0 * residuals, jacobian, marking, NO_PRIOR, LinePrior(1.0, 0.5))
        assert found.variance >= 0.25

    def test_markings_of_one_point_have_nothing_to_share(self):
        jacobian, residuals, _, _ = fitted(0.0)
        found = compute_line_noise(
            residuals, jacobian, np.arange(len(residuals)), NO_PRIOR, LinePrior(1.0, 0.1)
        )
        plain = np.linalg.inv(jacobian.T @ jacobian) * (residuals**2).mean()
        assert np.diag(found.parameters) == pytest.approx(np.diag(plain), rel=0.2)

    def test_a_prior_stands_in_for_what_the_points_do_not_show(self):
        jacobian, residuals, marking, _ = fitted(0.0)
        blind = jacobian * [1, 1, 1, 0]
        found = compute_line_noise(
            residuals, blind, marking, np.array([0, 0, 0, 25.0]), LinePrior(1.0, 0.1)
        )
        assert found.parameters[3, 3] == pytest.approx(0.04)


class TestWeights:
    """Fits that weigh points of crowded markings less, as errors that they share ask for."""

    SIZES = np.array([2] * 14 + [30, 40])
    SHARE = 0.5

    def fit(self, seed, share_of_fit):
        rng = np.random.default_rng(seed)
        marking = np.repeat(np.arange(len(self.SIZES)), self.SIZES)
        jacobian = rng.normal(size=(len(self.SIZES), UNKNOWNS))[marking]
        jacobian = jacobian + 0.3 * rng.normal(size=jacobian.shape)
        shared = np.sqrt(self.SHARE) * rng.normal(size=len(self.SIZES))[marking]
        errors = shared + np.sqrt(1 - self.SHARE) * rng.normal(size=len(marking))
        weights = compute_point_weights(marking, share_of_fit)
        weighted = jacobian.T * weights
        off = np.linalg.solve(weighted @ jacobian, weighted @ errors)
        known = LinePrior(1.0, 0.1, self.SHARE)
        noise = compute_line_noise(
            errors - jacobian @ off, jacobian, marking, NO_PRIOR, known, weights
        )
        return off, noise.parameters

    def errors_and_held(self, share_of_fit):
        found = [self.fit(seed, share_of_fit) for seed in range(400)]
        inside = [off @ np.linalg.solve(known, off) for off, known in found]
        squares = [off @ off for off, _ in found]
        return np.mean(squares), np.mean(np.array(inside) < chi2.ppf(0.95, UNKNOWNS))

    def test_they_are_nearer_to_the_truth_and_their_covariance_holds_it(self):
        alike, held_alike = self.errors_and_held(0.0)
        weighed, held_weighed = self.errors_and_held(self.SHARE)
        assert weighed < 0.9 * alike
        assert 0.92 < held_alike < 0.98 and 0.92 < held_weighed < 0.98


@given(st.floats(-0.49, 0.49), st.floats(0.1, 9.0), st.floats(-5.0, 5.0))
def test_the_lowest_point_of_a_parabola_is_found(off: float, bend: float, least: float) -> None:
    cost = least + bend * (np.arange(7) - 3 - off) ** 2
    assert fit_cost_minimum(cost, 3) == (
        pytest.approx(off, abs=1e-9),
        pytest.approx(least, abs=1e-9),
    )


@pytest.mark.parametrize("at", [0, 3])
def test_at_an_end_it_is_the_end(at: int) -> None:
    cost = np.arange(4.0) if at == 0 else np.arange(4.0)[::-1]
    assert fit_cost_minimum(cost, at) == (0.0, 0.0)


def test_a_flat_ground_has_no_lowest_point() -> None:
    assert fit_cost_minimum(np.full(3, 7.0), 1) == (0.0, 7.0)


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
    assert np.exp(log_sigma_with_95_percent_coverage(logs, cost)) == pytest.approx(exact, rel=0.01)


def test_the_prior_counts_as_the_two_numbers_that_it_is_worth_and_a_scatter_as_it_is() -> None:
    assert log_sigma_posterior_variance(0.0, 0, spread=0.5) == pytest.approx(0.25)
    assert log_sigma_posterior_variance(0.0, 50) == pytest.approx(1 / 101)
    assert log_sigma_posterior_variance(0.3, 50) == 0.3
    cost = sigma_prior_cost(np.log([1.0, 2.0, 4.0]), expected=2.0, spread=np.log(2))
    assert cost == pytest.approx([0.5, 0.0, 0.5])
