import numpy as np
import pytest
from scipy.stats import chi2

from app.solving.line_noise import line_noise

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
    return line_noise(residuals, jacobian, marking, NO_PRIOR, 1.0, 0.1), off


def held(share):
    """Share of fits whose error lies within the 95 % ellipsoid."""
    limit = chi2.ppf(0.95, UNKNOWNS)
    found = [noise_of(share, seed=seed) for seed in range(300)]
    return np.mean([off @ np.linalg.solve(item.parameters, off) < limit for item, off in found])


class TestLineNoise:
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
        found = line_noise(0 * residuals, jacobian, marking, NO_PRIOR, 1.0, 0.5)
        assert found.variance >= 0.25

    def test_markings_of_one_point_have_nothing_to_share(self):
        jacobian, residuals, _, _ = fitted(0.0)
        found = line_noise(residuals, jacobian, np.arange(len(residuals)), NO_PRIOR, 1.0, 0.1)
        plain = np.linalg.inv(jacobian.T @ jacobian) * (residuals**2).mean()
        assert np.diag(found.parameters) == pytest.approx(np.diag(plain), rel=0.2)

    def test_a_prior_stands_in_for_what_the_points_do_not_show(self):
        jacobian, residuals, marking, _ = fitted(0.0)
        blind = jacobian * [1, 1, 1, 0]
        found = line_noise(residuals, blind, marking, np.array([0, 0, 0, 25.0]), 1.0, 0.1)
        assert found.parameters[3, 3] == pytest.approx(0.04)
