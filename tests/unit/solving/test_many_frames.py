"""Many frames: what is left of each once its camera is eliminated, and how well all know it."""

from __future__ import annotations

import numpy as np
import pytest

from app.geometry.resection import PARAMETERS
from app.solving.many_frames import (
    eliminate_camera,
    eliminate_own_numbers,
    sigmas_of_shared_numbers,
)

SHARED = 2


@pytest.fixture
def rows() -> np.ndarray:
    """Derivatives of 40 measurements by camera and shared numbers, shape (40, P + 2)."""
    return np.random.default_rng(3).normal(size=(40, PARAMETERS + SHARED))


class TestWithoutCamera:
    def test_it_is_what_the_whole_adjustment_says_of_the_shared_numbers(self, rows) -> None:
        apart = np.random.default_rng(4).normal(size=len(rows))
        pull, told = eliminate_camera(rows.T @ apart, rows.T @ rows, 4.0)
        whole = np.linalg.lstsq(rows, apart, rcond=None)[0][PARAMETERS:]
        assert np.linalg.solve(told, pull) == pytest.approx(whole, abs=1e-12)
        covariance = 4.0 * np.linalg.inv(rows.T @ rows)[PARAMETERS:, PARAMETERS:]
        assert np.linalg.inv(told) == pytest.approx(covariance, rel=1e-9)

    def test_what_a_camera_could_explain_says_nothing(self, rows) -> None:
        rows[:, PARAMETERS:] = rows[:, :SHARED]
        apart = np.random.default_rng(4).normal(size=len(rows))
        _, told = eliminate_camera(rows.T @ apart, rows.T @ rows, 1.0)
        assert told == pytest.approx(np.zeros((SHARED, SHARED)), abs=1e-10)


class TestWithOwnNumbers:
    def test_variances_add_up(self, rows) -> None:
        share = eliminate_camera(rows.T @ np.ones(len(rows)), rows.T @ rows, 1.0)
        sigma = np.array([0.3, 2.0])
        pull, told = eliminate_own_numbers(share, sigma)
        assert np.linalg.inv(told) == pytest.approx(np.linalg.inv(share[1]) + np.diag(sigma**2))
        # What the frame says the numbers are stays the same.
        assert np.linalg.solve(told, pull) == pytest.approx(np.linalg.solve(share[1], share[0]))


class TestSharedSigmas:
    def test_frames_that_agree_leave_what_clicks_say(self) -> None:
        found = sigmas_of_shared_numbers(np.zeros((5, 2)), np.diag([4.0, 25.0]), spent=1)
        assert found == pytest.approx([0.5, 0.2])

    def test_frames_that_disagree_know_it_worse_than_clicks_say(self) -> None:
        pulls = np.array([[3.0, 0.0], [-3.0, 0.0], [3.0, 0.0], [-3.0, 0.0]])
        found = sigmas_of_shared_numbers(pulls, np.diag([4.0, 25.0]), spent=2)
        assert found == pytest.approx([np.sqrt(36 * 4 / 2) / 4, 0.2])
