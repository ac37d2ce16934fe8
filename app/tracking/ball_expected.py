"""Where other views of an instant say that the ball is in a picture."""

from __future__ import annotations

import numpy as np

from app.geometry.camera import Camera
from app.soccer.frames import ImagePoint, ImageSize
from app.soccer.solution import ExpectedBall
from app.tracking.ball_run import ExpectedPlace

INEXACT_PX = 12.0
"""What given cameras of a static rig contradict each other by, pixels: one standard deviation."""
HIGHEST_M, FARTHEST_M, STEPS = 20.0, 300.0, 64


def make_expected_place(expected: ExpectedBall) -> ExpectedPlace:
    """Where the 3D ball of the other views is seen."""
    spread = np.array(expected.covariance, float).reshape(2, 2)
    known = np.isfinite(spread).all()
    sigma = float(np.sqrt(max(np.linalg.eigvalsh(spread)[-1], 0.0))) if known else 0.0
    place = expected.place.x, expected.place.y
    return ExpectedPlace(place, place, float(np.hypot(INEXACT_PX, sigma)))


def project_ray_segment(
    source: Camera, ball: ImagePoint, target: Camera, size: ImageSize
) -> ExpectedPlace | None:
    """Where the ray of another view's ball runs through a picture, between the grass and 20 m above it.

    Args:
        source: The camera of the other view.
        ball: Its ball, pixels there.
        target: The camera of the picture.
        size: Of the picture.

    Returns:
        None where it is not seen.
    """
    ray = source.rays(np.array([[ball.x, ball.y]]))[0]
    height, climb = -float(source.position[2]), -float(ray[2])
    if not np.isfinite(ray).all() or abs(climb) < 1e-9:
        return None
    grass, top = sorted((-height / climb, (HIGHEST_M - height) / climb))
    near, far = max(grass, 0.5), min(top, FARTHEST_M)
    if near >= far:
        return None
    points = source.position + np.linspace(near, far, STEPS)[:, None] * ray
    seen = target.project(points)
    border = 0.1 * size.width
    inside = np.isfinite(seen).all(axis=1)
    inside &= ((seen > -border) & (seen < np.array([size.width, size.height]) + border)).all(axis=1)
    if not inside.any():
        return None
    first, last = seen[inside][0], seen[inside][-1]
    return ExpectedPlace(
        (float(first[0]), float(first[1])), (float(last[0]), float(last[1])), INEXACT_PX
    )
