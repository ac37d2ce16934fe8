from __future__ import annotations

import numpy as np

from app.geometry.camera import Camera
from app.geometry.rotation import rotation_from_pan_tilt_roll
from app.sample.views import (
    CENTER,
    COARSE,
    TrialCameras,
    count_seen_points,
    is_inside_image,
    project_trials,
)
from app.soccer.pitch import MARKINGS


def _trials() -> TrialCameras:
    return TrialCameras(
        position=np.array([[1.0, 60.0, -14.0], [-70.0, 3.0, -9.0]]),
        pan=np.array([0.3, 1.4]),
        tilt=np.array([1.32, 1.40]),
        roll=np.array([0.01, -0.01]),
        focal=np.array([1800.0, 1500.0]),
        k1=np.array([0.1, 0.05]),
    )


class TestProjectTrials:
    def test_agrees_with_the_camera_of_the_geometry_floor(self):
        trials = _trials()
        pixels = project_trials(trials, COARSE.points)
        for i in range(2):
            distortion = np.zeros(12)
            distortion[0] = trials.k1[i]
            camera = Camera(
                rotation_from_pan_tilt_roll(trials.pan[i], trials.tilt[i], trials.roll[i]),
                trials.position[i],
                (trials.focal[i], trials.focal[i]),
                (CENTER[0], CENTER[1]),
                distortion=distortion,
            )
            np.testing.assert_allclose(pixels[i], camera.project(COARSE.points), atol=1e-7)


class TestSeenPoints:
    def test_counts_the_points_of_each_marking(self):
        counts = count_seen_points(np.ones(len(COARSE.points), dtype=bool), COARSE)
        assert counts.sum() == len(COARSE.points)
        assert counts.shape == (len(MARKINGS),)
        assert counts.min() >= 5


class TestInside:
    def test_what_is_not_visible_is_not_inside(self):
        assert is_inside_image(np.array([[5.0, 5.0], [-1.0, 5.0], [np.nan, np.nan]])).tolist() == [
            True,
            False,
            False,
        ]
