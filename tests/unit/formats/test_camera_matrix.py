from __future__ import annotations

from typing import Any

import cv2
import numpy as np
import pytest

from app.errors import DatasetFormatError
from app.formats.camera_matrix import camera_from_matrices, has_camera_matrices
from app.geometry.camera import Camera

CAMERA = Camera(
    rotation=np.array(
        [
            [0.8849182223819824, 0.4657464328326223, 0.0],
            [-0.10563343610753348, 0.20070352860431362, 0.9739402809114598],
            [0.4536092116265145, -0.8618575020903776, 0.226804605813257],
        ]
    ),
    position=np.array([0.0, 62.0, -15.0]),
    focal_length=(1800.0, 1790.0),
    principal_point=(639.5, 359.5),
    distortion=np.array([0.1, -0.02, 0.001, 0.002, 0.003, 0, 0, 0, 0, 0, 0, 0]),
)
K = [[1800.0, 0, 639.5], [0, 1790.0, 359.5], [0, 0, 1]]
R = CAMERA.rotation.tolist()
T = (-CAMERA.rotation @ CAMERA.position).tolist()
DIST = [0.1, -0.02, 0.001, 0.002, 0.003]
VECTOR = cv2.Rodrigues(CAMERA.rotation)[0]
GRASS = np.array([[x, y, 0.0] for x in (-20.0, 0.0, 30.0) for y in (-10.0, 0.0, 20.0)])


def read(value: dict[str, Any]) -> Camera:
    assert has_camera_matrices(value)
    return camera_from_matrices(value, "c.json", None)


class TestCameraFromMatrices:
    @pytest.mark.parametrize(
        "value",
        [
            {"K": K, "R": R, "t": T, "k": DIST},
            {"K": np.array(K).ravel().tolist(), "R": R, "T": [[v] for v in T], "dist": [DIST]},
            {"camera_matrix": K, "rvec": VECTOR.ravel().tolist(), "tvec": T, "distCoeffs": DIST},
            {"mtx": K, "rvecs": VECTOR.tolist(), "tvecs": [[v] for v in T], "dist": [DIST]},
            {"K": K, "R": R, "C": CAMERA.position.tolist(), "D": DIST},
            {"fx": 1800, "fy": 1790, "cx": 639.5, "cy": 359.5, "R": R, "t": T, "dist": DIST},
            {
                "K": {"rows": 3, "cols": 3, "dt": "d", "data": np.array(K).ravel().tolist()},
                "R": {"rows": 3, "cols": 3, "dt": "d", "data": np.array(R).ravel().tolist()},
                "t": {"rows": 3, "cols": 1, "dt": "d", "data": T},
                "distortion_coefficients": {"rows": 1, "cols": 5, "dt": "d", "data": DIST},
            },
        ],
        ids=["krt", "flat", "vector", "vectors", "position", "focal", "storage"],
    )
    def test_every_spelling_is_the_same_camera(self, value: dict[str, Any]) -> None:
        camera = read(value)
        assert np.allclose(camera.project(GRASS), CAMERA.project(GRASS), atol=1e-6)

    @pytest.mark.parametrize("scale", [1.0, -0.01])
    def test_a_projection_matrix_is_taken_apart(self, scale: float) -> None:
        matrix = scale * np.array(K) @ np.column_stack([np.array(R), T])
        camera = read({"P": matrix.tolist()})
        assert np.allclose(camera.rotation, CAMERA.rotation)
        assert np.allclose(camera.position, CAMERA.position)
        assert np.allclose(camera.focal_length, CAMERA.focal_length)

    @pytest.mark.parametrize(
        ("changes", "problem"),
        [
            ({"R": [[1, 0, 0], [0, 1, 0], [0, 0.5, 1]]}, "R: is not a rotation"),
            ({"R": (-np.array(R)).tolist()}, "R: is a mirror image"),
            ({"K": [[1800, 0, 640], [0, 1800, 360]]}, "K: has 6 numbers, not 9"),
            ({"K": np.transpose(K).tolist()}, "K: is not a camera matrix"),
            ({"t": [T, T]}, "t: has 6 numbers, not 3: 2 poses"),
            ({"t": [float("nan"), 0, 1]}, "t: is nan, not a finite number"),
            ({"t": (1000 * np.array(T)).tolist()}, "metres are meant"),
            ({"R": (np.array(R) @ np.diag([1, -1, -1])).tolist()}, "z up"),
            (
                {"R": (np.diag([-1, 1, -1]) @ np.array(R)).tolist(), "t": [-T[0], T[1], -T[2]]},
                "looks away",
            ),
            ({"k": [1, 2, 3]}, "k: has 3 numbers"),
        ],
    )
    def test_what_is_no_camera_of_a_pitch_is_refused_with_its_reason(
        self, changes: dict[str, Any], problem: str
    ) -> None:
        with pytest.raises(DatasetFormatError, match=problem):
            read({"K": K, "R": R, "t": T} | changes)
