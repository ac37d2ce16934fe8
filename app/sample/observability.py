"""Observability: how well the markings in view determine a camera, before anybody clicks."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from app.geometry.arrays import FloatArray
from app.geometry.camera import Camera
from app.sample.views import COARSE, CORNER_RADIUS, Mask, seen_points

CLICK_SIGMA = 1.0
DISTORTION_SIGMA = 12.0
"""Prior on the distortion: displacement at the corner, pixels."""
POINTS_PER_MARKING = 5


@dataclass(frozen=True)
class Certainty:
    """Standard deviations that follow from clicks with 1 px noise.

    ``ball_sigma_m``: of the ray to the ball, metres at the ball, its longest axis.
    ``size_sigma``: relative, of the ball's projected diameter.
    """

    ball_sigma_m: float
    size_sigma: float


def certainty(camera: Camera, ball: FloatArray, seen: Mask) -> Certainty:
    """What a calibration from the visible markings would know about a ball.

    Args:
        ball: Pitch frame, metres, shape (3,).
        seen: Which points of ``COARSE`` are in view, shape (N,).
    """
    counts = np.maximum(seen_points(seen, COARSE), 1)
    index = np.flatnonzero(seen)
    # Annotators click a few points a marking, however many the skeleton has.
    weights = np.minimum(1.0, POINTS_PER_MARKING / counts[COARSE.marking[index]])
    x = camera.pitch_to_camera(np.vstack([COARSE.points[index], ball]))
    jacobian = _point_jacobian(camera, x)
    tangents = COARSE.tangents[index] @ camera.rotation.T
    normals = _normals(x[:-1], tangents)
    rows = normals[:, 0, None] * jacobian[:-1, 0] + normals[:, 1, None] * jacobian[:-1, 1]
    rows *= np.sqrt(weights)[:, None]
    information = np.einsum("ni,nj->ij", rows, rows) / CLICK_SIGMA**2
    # One unit of k1 moves a corner by f (r / f)^3 pixels.
    focal = camera.focal_length[0]
    information[7, 7] += (CORNER_RADIUS**3 / focal**2 / DISTORTION_SIGMA) ** 2
    # Priors so weak that they only keep the inverse finite.
    information[np.arange(8), np.arange(8)] += 1e-9
    covariance = np.linalg.inv(information)
    of_ball = jacobian[-1]
    spread = of_ball @ covariance @ of_ball.T
    sigma = float(np.sqrt(max(float(np.linalg.eigvalsh(spread)[-1]), 0.0)))
    size = _size_gradient(camera, x[-1])
    size_sigma = float(np.sqrt(max(float(size @ covariance @ size), 0.0)))
    return Certainty(sigma * float(x[-1, 2]) / focal, size_sigma)


def _normals(x: FloatArray, tangents: FloatArray) -> FloatArray:
    """Unit normals of projected markings; points and tangents in the camera frame, (N, 3)."""
    depth = x[:, 2]
    along_u = tangents[:, 0] - tangents[:, 2] * x[:, 0] / depth
    along_v = tangents[:, 1] - tangents[:, 2] * x[:, 1] / depth
    length = np.maximum(np.hypot(along_u, along_v), 1e-12)
    return np.column_stack([-along_v / length, along_u / length])


def _point_jacobian(camera: Camera, x: FloatArray) -> FloatArray:
    """Derivative of pixels by (rotation, position, log focal length, k1), shape (N, 2, 8).

    The bend of distortion is left out: it changes these derivatives by a few per cent.

    Args:
        x: Camera frame, metres, shape (N, 3).
    """
    focal = camera.focal_length[0]
    depth = x[:, 2]
    a, b = x[:, 0] / depth, x[:, 1] / depth
    r2 = a * a + b * b
    jacobian = np.empty((len(x), 2, 8))
    R = camera.rotation
    # A turn w moves X by w x X; a step of the camera moves it by -R dC.
    jacobian[:, 0, 0], jacobian[:, 0, 1], jacobian[:, 0, 2] = -a * b, 1 + a * a, -b
    jacobian[:, 1, 0], jacobian[:, 1, 1], jacobian[:, 1, 2] = -1 - b * b, a * b, a
    jacobian[:, 0, 3:6] = (np.outer(a, R[2]) - R[0]) / depth[:, None]
    jacobian[:, 1, 3:6] = (np.outer(b, R[2]) - R[1]) / depth[:, None]
    jacobian[:, 0, 6], jacobian[:, 1, 6] = a, b
    jacobian[:, 0, 7], jacobian[:, 1, 7] = a * r2, b * r2
    jacobian *= focal
    return jacobian


def _size_gradient(camera: Camera, ball: FloatArray) -> FloatArray:
    """Derivative of log(focal / depth), shape (8,); the ball in the camera frame, (3,)."""
    x, y, depth = ball
    turn = np.array([-y, x, 0.0]) / depth
    move = camera.rotation[2] / depth
    return np.concatenate([turn, move, [1.0, 0.0]])
