"""Camera numbers: what of a camera is known how exactly, and whether its picture was changed."""

from __future__ import annotations

import numpy as np

from app.geometry.resection import parameters_from_camera
from app.soccer.picture import PictureGeometry
from app.soccer.solution import Calibration
from app.solving.camera_numbers import CameraNumbers
from tests.cameras import SIZE
from tests.unit.solving.conftest import BEHIND_GOAL, MAIN

KNOWN = tuple(np.arange(64.0))


class TestOf:
    def test_without_a_camera_and_of_unknown_exactness_there_are_none(self):
        assert CameraNumbers.of(Calibration("none", None), SIZE.diagonal) is None
        assert CameraNumbers.of(Calibration("given", MAIN), SIZE.diagonal) is None

    def test_a_picture_as_it_was_taken_says_nothing_of_its_own(self):
        calibration = Calibration("lines", MAIN, covariance=KNOWN)
        found = CameraNumbers.of(calibration, SIZE.diagonal)
        assert np.array_equal(found.parameters, parameters_from_camera(MAIN, SIZE.diagonal / 2))
        assert np.array_equal(found.covariance, np.reshape(KNOWN, (8, 8)))
        assert found.picture is None

    def test_a_changed_picture_has_the_camera_that_took_it(self):
        changed = PictureGeometry(1.2).camera_of_shown_picture(BEHIND_GOAL, SIZE)
        whole = np.arange(121.0).reshape(11, 11)
        calibration = Calibration(
            "lines", changed, covariance=KNOWN, picture_covariance=tuple(whole.ravel())
        )
        found = CameraNumbers.of(calibration, SIZE.diagonal)
        taken = parameters_from_camera(BEHIND_GOAL, SIZE.diagonal / 2)
        assert np.allclose(found.parameters, taken, atol=1e-12)
        assert np.array_equal(found.covariance, whole[:8, :8])
        assert np.array_equal(found.picture, whole[8:])
