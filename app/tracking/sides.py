"""Sides: cameras over time as they are once the pitch is turned by half, which its paint cannot tell from as it was.

The tracker takes the camera to stand on the near side (y > 0), where main cameras are. One that stands opposite is
then tracked turned: people see it, and so do rays of the ball that meet those of another shot only once turned.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from app.geometry.resection import PARAMETERS, X, Y
from app.solving.sides import turn_camera
from app.tracking.track import FrameCamera

_HALF_TURN = np.array([-1.0, -1.0, 1.0])
_SIGNS = np.ones(PARAMETERS)
_SIGNS[[X, Y]] = -1.0
"""Of the parameters of a camera: pan grows by half a turn, which changes no derivative."""


def move_camera_to_opposite_side(frame: FrameCamera) -> FrameCamera:
    """The camera of a frame, and its covariance, turned by 180 degrees about the centre mark; twice is as before."""
    if frame.camera is None:
        return frame
    covariance = frame.covariance
    if covariance is not None:
        matrix = np.reshape(covariance, (PARAMETERS, PARAMETERS)) * np.outer(_SIGNS, _SIGNS)
        covariance = tuple(matrix.ravel().tolist())
    return replace(frame, camera=turn_camera(frame.camera), covariance=covariance)


def are_on_opposite_side(frames: Sequence[FrameCamera], before: Mapping[int, FrameCamera]) -> bool:
    """Whether cameras stand nearer to the earlier ones of the same frames once they are turned.

    Args:
        frames: Cameras of frames.
        before: Earlier ones by number of their frame.
    """
    found = 0.0
    for frame in frames:
        earlier = before.get(frame.number)
        if frame.camera is not None and earlier is not None and earlier.camera is not None:
            place, other = frame.camera.position, earlier.camera.position
            found += float(np.linalg.norm(place - other))
            found -= float(np.linalg.norm(place * _HALF_TURN - other))
    return found > 0
