"""The ball as cameras of tests see it."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from app.geometry.camera import Camera
from app.soccer.annotation import BallAnnotation
from app.soccer.frames import Box, ImagePoint

BALL_M = 0.226
"""Its diameter, metres."""


def seen(camera: Camera, point: Sequence[float]) -> ImagePoint:
    """Where a camera sees a point of the pitch frame, metres."""
    x, y = camera.project(np.array([point], dtype=float))[0]
    return ImagePoint(float(x), float(y))


def box_around(camera: Camera, point: Sequence[float], scale: float = 1.0) -> BallAnnotation:
    """A square box around a ball at that point, ``scale`` times as large as the ball."""
    depth = camera.pitch_to_camera(np.array([point], dtype=float))[0, 2]
    diameter = scale * BALL_M * camera.focal_length[1] / depth
    return BallAnnotation(box=Box.square(seen(camera, point), float(diameter)))
