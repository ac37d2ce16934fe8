from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from app.geometry.resection import PARAMETERS, camera_from_parameters, parameters_from_camera
from app.soccer.camera_sigma import camera_sigma
from app.soccer.solution import Calibration
from tests.unit.stores import MAIN

HALF_DIAGONAL = math.hypot(1280, 720) / 2
SIGMAS = np.array([0.001, 0.002, 0.003, 0.3, 0.4, 0.5, 0.01, 0.004])


def calibration(covariance: np.ndarray | None) -> Calibration:
    spread = None if covariance is None else tuple(covariance.ravel().tolist())
    lens = replace(MAIN, distortion=np.array([0.12, *[0.0] * 11]))
    return Calibration(source="lines", camera=lens, covariance=spread)


class TestCameraSigma:
    def test_numbers_by_hand(self) -> None:
        sigma = camera_sigma(calibration(np.diag(SIGMAS**2)))
        assert sigma is not None
        assert sigma.pan_degrees == pytest.approx(0.0572957795)
        assert sigma.roll_degrees == pytest.approx(3 * sigma.pan_degrees)
        assert sigma.position_meters == pytest.approx((0.3, 0.4, 0.5))
        assert sigma.focal_px == pytest.approx(15.0)

    def test_agrees_with_many_cameras_drawn_from_the_covariance(self) -> None:
        rng = np.random.default_rng(4)
        mixed = np.diag(SIGMAS) @ (np.eye(PARAMETERS) + 0.3 * rng.normal(size=(PARAMETERS,) * 2))
        spread = mixed @ mixed.T
        known = calibration(spread)
        assert known.camera is not None
        mean = parameters_from_camera(known.camera, HALF_DIAGONAL)
        drawn = [
            camera_from_parameters(row, known.camera.principal_point, HALF_DIAGONAL)
            for row in rng.multivariate_normal(mean, spread, size=4000)
        ]
        sigma = camera_sigma(known)
        assert sigma is not None
        # A sigma of 4000 draws is itself known to 1 / sqrt(2 * 4000), about 1.1 %.
        assert sigma.k1 == pytest.approx(np.std([one.distortion[0] for one in drawn]), rel=0.06)
        focals = [one.focal_length[0] for one in drawn]
        assert sigma.focal_px == pytest.approx(np.std(focals), rel=0.06)

    def test_a_given_camera_and_a_view_without_camera_have_no_sigma(self) -> None:
        assert camera_sigma(calibration(None)) is None
        assert camera_sigma(Calibration(source="lines", camera=None)) is None
