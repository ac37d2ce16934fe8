"""Cameras of tests: turned towards a target."""

from __future__ import annotations

import numpy as np

from app.geometry.arrays import FloatArray


def rotation_looking(position: FloatArray, target: FloatArray) -> FloatArray:
    """World-to-camera rotation of a level camera that looks at a target, shape (3, 3).

    Args:
        position: Camera position in the pitch frame, metres, shape (3,).
        target: Point in the pitch frame, metres, shape (3,).
    """
    forward = np.asarray(target, dtype=np.float64) - position
    forward = forward / np.linalg.norm(forward)
    # z points down, so "right" of a level camera is down x forward.
    right = np.cross(np.array([0.0, 0.0, 1.0]), forward)
    right = right / np.linalg.norm(right)
    return np.vstack([right, np.cross(forward, right), forward])
