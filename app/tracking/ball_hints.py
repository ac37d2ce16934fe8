"""Where a view has to show a ball that a linked view shows: the epipolar segment of likely heights."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from app.geometry.arrays import FloatArray
from app.geometry.camera import Camera
from app.tracking.ball_run import PredictedPlace

HEIGHT_M, HEIGHT_SIGMA_M = 1.0, 2.0
"""Of a ball of which one ray is known."""
NOISE_PX = 4.0
"""What the cameras of both views leave uncertain, along each axis."""
LONGEST_GAP_S = 0.2
"""Between two frames that show the ball, beyond which nothing is said of those between."""
_FARTHEST_M = 250.0


@dataclass(frozen=True)
class LinkedBall:
    """A ball as another view shows it.

    Attributes:
        times: Seconds, as the view that is asked about counts them, increasing, shape (N,).
        positions: Of its cameras in the pitch frame, metres, shape (N, 3).
        rays: Unit directions in the pitch frame, shape (N, 3).
    """

    times: FloatArray
    positions: FloatArray
    rays: FloatArray

    @staticmethod
    def of(
        times: Sequence[float], pixels: Sequence[tuple[float, float]], cameras: Sequence[Camera]
    ) -> LinkedBall:
        """The ball at pixels of frames, in any order; of frames of the same time the first."""
        order = np.unique(np.asarray(times, dtype=float), return_index=True)[1]
        rays = np.array([cameras[at].rays(np.array([pixels[at]]))[0] for at in order])
        rays = rays.reshape(-1, 3)
        return LinkedBall(
            np.asarray(times, dtype=float)[order],
            np.array([cameras[at].position for at in order]).reshape(-1, 3),
            rays / np.linalg.norm(rays, axis=1, keepdims=True),
        )


def predicted_places(
    ball: LinkedBall, frames: Mapping[int, tuple[float, Camera]], sigma_s: float
) -> dict[int, PredictedPlace]:
    """Where frames of a view show the ball of another view.

    Args:
        ball: As the other view shows it.
        frames: Time and camera of each frame, by number.
        sigma_s: Standard deviation of what the times of both views are apart.

    Returns:
        By number, of frames whose instant the other view shows, and whose camera has the ball before it.
    """
    found = {}
    for number, (time, camera) in frames.items():
        here = _point_at(ball, time)
        if here is None:
            continue
        later = _point_at(ball, time + sigma_s)
        earlier = _point_at(ball, time - sigma_s)
        points = [here[0], here[0] + here[1] * HEIGHT_SIGMA_M]
        points.append(points[0] if later is None else later[0])
        points.append(points[0] if earlier is None else earlier[0])
        seen = camera.project(np.array(points))
        depth = camera.pitch_to_camera(np.array(points))[:, 2]
        if not np.isfinite(seen).all() or depth.min() <= 0:
            continue
        along, moved = seen[1] - seen[0], (seen[2] - seen[3]) / 2
        covariance = np.outer(along, along) + np.outer(moved, moved) + NOISE_PX**2 * np.eye(2)
        found[number] = PredictedPlace(float(seen[0, 0]), float(seen[0, 1]), covariance)
    return found


def _point_at(ball: LinkedBall, time: float) -> tuple[FloatArray, FloatArray] | None:
    """The likeliest place on the ray of a time, and how it moves with each metre of height; None: no ray is known."""
    behind = int(np.searchsorted(ball.times, time))
    if behind == 0:
        behind += bool(len(ball.times) > 1 and ball.times[0] == time)
    if not 0 < behind < len(ball.times):
        return None
    before = behind - 1
    gap = ball.times[behind] - ball.times[before]
    if gap > LONGEST_GAP_S:
        return None
    share = (time - ball.times[before]) / gap
    ray = (1 - share) * ball.rays[before] + share * ball.rays[behind]
    centre = (1 - share) * ball.positions[before] + share * ball.positions[behind]
    # z points down: rays that do not fall meet no height.
    if ray[2] < 1e-3:
        return None
    far = (-HEIGHT_M - centre[2]) / ray[2]
    if not 0 < far < _FARTHEST_M:
        return None
    return centre + far * ray, -ray / ray[2]
