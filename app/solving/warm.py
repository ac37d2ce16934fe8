"""Warm up: load (or compile) the kernels before somebody waits for them."""

from __future__ import annotations

import numpy as np

from app.geometry.camera import Camera
from app.geometry.distortion import COEFFICIENTS
from app.geometry.likely_point import CameraTable, likely_points
from app.soccer.annotation import make_lines
from app.soccer.frames import ImageSize
from app.soccer.pitch import Pitch
from app.soccer.policy import CalibrationPolicy
from app.solving.calibrate import calibrate

_SQUARE = {
    "Big rect. right main": [(300.0, 150.0), (500.0, 400.0)],
    "Big rect. right top": [(300.0, 150.0), (700.0, 170.0)],
    "Big rect. right bottom": [(500.0, 400.0), (900.0, 380.0)],
    "Side line right": [(700.0, 170.0), (900.0, 380.0)],
    "Circle right": [(350.0, 260.0), (340.0, 280.0), (380.0, 330.0)],
}


def warm_up() -> None:
    """Calibrate a made-up picture and look for a point once; the first time on a machine this compiles for seconds."""
    calibrate(make_lines(_SQUARE), Pitch(), ImageSize(960, 540), CalibrationPolicy())
    lens = np.array([0.01, *np.zeros(COEFFICIENTS - 1)])
    upright = Camera(np.eye(3), np.zeros(3), (1000.0, 1000.0), (480.0, 270.0), distortion=lens)
    upright.undistort(np.zeros((1, 2)))
    likely_points(
        CameraTable.of([upright]),
        np.zeros((1, 2)),
        np.zeros((1, 1), int),
        np.zeros((1, 3)),
        np.ones((1, 1, 2, 2)),
    )
