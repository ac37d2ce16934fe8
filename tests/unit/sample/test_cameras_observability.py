from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from app.geometry.camera import Camera
from app.sample import cameras as observability
from app.sample.cameras import COARSE, estimate_ball_certainty, is_inside_image
from app.sample.scene import Scene


def _moved(camera: Camera, step: np.ndarray) -> Camera:
    distortion = np.zeros(12)
    distortion[0] = step[7]
    return replace(
        camera,
        rotation=Rotation.from_rotvec(step[:3]).as_matrix() @ camera.rotation,
        position=camera.position + step[3:6],
        focal_length=(camera.focal_length[0] * np.exp(step[6]),) * 2,
        distortion=distortion,
    )


class TestPointJacobian:
    def test_meets_its_finite_difference(self, clean_scenes: list[Scene]):
        camera = replace(clean_scenes[0].truth.views[0].camera, distortion=np.zeros(12))
        points = np.array([[3.0, 4.0, -1.0], [20.0, -10.0, 0.0]])
        analytic = observability._point_jacobian(camera, camera.pitch_to_camera(points))
        for i in range(8):
            step = np.eye(8)[i] * 1e-6
            ahead, behind = (
                _moved(camera, step).project(points),
                _moved(camera, -step).project(points),
            )
            scale = np.abs(analytic[:, :, i]).max()
            np.testing.assert_allclose(
                (ahead - behind) / 2e-6, analytic[:, :, i], atol=1e-6 * scale
            )


class TestCertainty:
    def test_more_markings_in_view_tell_more(self, clean_scenes: list[Scene]):
        view = clean_scenes[0].truth.views[0]
        seen = is_inside_image(view.camera.project(COARSE.points))
        fewer = seen & (COARSE.marking != COARSE.marking[np.flatnonzero(seen)[0]])
        ball = np.array(view.ball)
        assert (
            estimate_ball_certainty(view.camera, ball, seen).ball_sigma_m
            < estimate_ball_certainty(view.camera, ball, fewer).ball_sigma_m
        )

    def test_parallel_lines_alone_leave_the_camera_open(self, clean_scenes: list[Scene]):
        view = clean_scenes[0].truth.views[0]
        seen = is_inside_image(view.camera.project(COARSE.points))
        only = seen & COARSE.runs_along_x[COARSE.marking]
        assert estimate_ball_certainty(view.camera, np.array(view.ball), only).ball_sigma_m > 1.0

    def test_every_view_of_a_clean_scene_is_determined(self, clean_scenes: list[Scene]):
        for scene in clean_scenes:
            for view in scene.truth.views:
                seen = is_inside_image(view.camera.project(COARSE.points), 4.0)
                known = estimate_ball_certainty(view.camera, np.array(view.ball), seen)
                assert known.ball_sigma_m < 0.06
                assert known.size_sigma == pytest.approx(0, abs=0.04)
