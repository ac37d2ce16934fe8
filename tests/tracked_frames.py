"""Frames as the tracker returns them, without a video."""

from __future__ import annotations

import numpy as np

from app.soccer.frames import ImageSize
from app.tracking.track import FrameCamera
from tests.cameras import looking

CAMERA = looking((0, 60, -15), (10, 0, 0), 900)


def frame(number: int, outcome: str) -> FrameCamera:
    """A frame of a camera that stands still, or without one."""
    sigma = np.array([0.01, 0.01, 0.01, 0.3, 0.4, 0.2, 0.01, 0.001])
    is_lost = outcome == "lost"
    return FrameCamera(
        number=number,
        time=number / 25,
        outcome=outcome,
        size=ImageSize(1280, 720),
        camera=None if is_lost else CAMERA,
        covariance=None if is_lost else tuple(np.diag(sigma**2).ravel().tolist()),
        supported=None if is_lost else 0.9,
        explained=None if is_lost else 0.7,
        error_px=0.2 if outcome == "tracked" else None,
        is_keyframe=number == 0,
        reason=None if outcome == "tracked" else "no_paint",
    )
