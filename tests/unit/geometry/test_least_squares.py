import itertools

import numpy as np
import pytest

from app.errors import DegenerateGeometryError
from app.geometry.least_squares import (
    CONVERGED,
    OUT_OF_STEPS,
    covariance,
    levenberg_marquardt,
    require_determined_parameters,
)

TIMES = np.linspace(0, 2, 30)
TRUTH = np.array([3.0, -1.3])


def decay(parameters):
    """Normal equations of y = a exp(b t), measured without noise at TRUTH."""
    measured = TRUTH[0] * np.exp(TRUTH[1] * TIMES)
    a, b = parameters[:, :1], parameters[:, 1:]
    curve = np.exp(b * TIMES)
    residuals = a * curve - measured
    jacobian = np.stack([curve, a * TIMES * curve], axis=2)
    gradient = np.einsum("bni,bn->bi", jacobian, residuals)
    information = np.einsum("bni,bnj->bij", jacobian, jacobian)
    return 0.5 * (residuals**2).sum(axis=1), gradient, information


class TestLevenbergMarquardt:
    def test_several_starts_arrive_at_the_same_minimum(self):
        fit = levenberg_marquardt(decay, np.array([[1.0, 0.0], [6.0, -3.0], [2.0, 0.5]]), 60)
        assert np.allclose(fit.parameters, TRUTH, atol=1e-6)

    def test_a_start_is_solved_as_it_would_be_alone(self):
        starts = np.array([[1.0, 0.0], [6.0, -3.0]])
        together = levenberg_marquardt(decay, starts, 60)
        alone = levenberg_marquardt(decay, starts[:1], 60)
        assert np.allclose(together.parameters[0], alone.parameters[0], rtol=1e-12)

    def test_the_cost_never_rises(self):
        start = np.array([[6.0, 2.0]])
        costs = [levenberg_marquardt(decay, start, steps).cost[0] for steps in range(1, 12)]
        assert all(later <= earlier for earlier, later in itertools.pairwise(costs))

    def test_a_refused_step_is_counted_and_changes_nothing(self):
        def rising(parameters):
            cost, gradient, information = decay(parameters)
            return cost, -gradient, information

        fit = levenberg_marquardt(rising, np.array([[2.0, -1.0]]), 5)
        assert fit.rejected[0] == 5
        assert np.array_equal(fit.parameters, [[2.0, -1.0]])

    def test_says_why_it_stopped(self):
        def offset(parameters):
            # A residual that stays keeps the cost away from zero.
            cost, gradient, information = decay(parameters)
            return cost + 1.0, gradient, information

        start = np.array([[1.0, 0.0]])
        assert levenberg_marquardt(decay, start, 1).reasons == (OUT_OF_STEPS,)
        assert levenberg_marquardt(offset, start, 100).reasons == (CONVERGED,)


class TestCovariance:
    def test_is_the_inverse_of_the_information(self):
        information = np.array([[4.0, 1.0], [1.0, 9.0]])
        assert np.allclose(covariance(information), np.linalg.inv(information))

    def test_survives_parameters_of_very_different_scale(self):
        information = np.diag([1e12, 1e-6])
        assert np.allclose(np.diag(covariance(information)), [1e-12, 1e6])


class TestRequireDetermined:
    def test_an_open_combination_is_said(self):
        with pytest.raises(DegenerateGeometryError, match="do not determine"):
            require_determined_parameters(np.array([[1.0, 1.0], [1.0, 1.0]]))

    def test_a_parameter_without_influence_is_said(self):
        with pytest.raises(DegenerateGeometryError, match="no influence"):
            require_determined_parameters(np.diag([1.0, 0.0]))
