"""Bundle: cameras that stand still, and points that several of them see at once.

The cameras are rows of ``resection``'s parameters. The points are eliminated: for each guess of
the cameras every point is put where its own rays want it, and what is left is a problem of the
cameras alone, whose J^T W J is the Schur complement of the whole one (variable projection).

Source: Hartley & Zisserman, sec. A6.6; Triggs et al., "Bundle adjustment: a modern synthesis",
sec. 6.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from app.geometry.arrays import BoolArray, FloatArray, IntArray
from app.geometry.resection import (
    PARAMETERS,
    X,
    Z,
    camera_from_parameters,
    projection_jacobians,
)

BEHIND = 1000.0
"""Residual, in sigmas, of a point behind its camera."""
_POINT_STEPS = 6
_TINY = 1e-9
"""Keeps the system of a point that its rays leave open from being singular."""


@dataclass(frozen=True)
class RayPixels:
    """Image points, each of one camera and of one point of space.

    Attributes:
        pixels: Relative to the principal point, shape (N, 2).
        camera: Row of the camera, shape (N,).
        point: Row of the point, shape (N,); every point has rays of two cameras at least.
        sigma: Standard deviation of each coordinate, pixels, shape (N,).
        half_diagonals: Half the image diagonal of each camera, pixels, shape (K,).
    """

    pixels: FloatArray
    camera: IntArray
    point: IntArray
    sigma: FloatArray
    half_diagonals: FloatArray

    @property
    def point_count(self) -> int:
        """How many points there are."""
        return int(self.point.max(initial=-1)) + 1

    def select_rays_of_points(self, kept: BoolArray) -> RayPixels:
        """The rays of some points, shape (points,), in the same order."""
        return self._select_rays(kept, kept[self.point])

    def select_common_points(self, *cameras: int) -> tuple[RayPixels, IntArray]:
        """The rays of points that all of some cameras see, from these alone, and the points' rows."""
        seen = np.zeros((self.point_count, len(self.half_diagonals)), dtype=np.bool_)
        seen[self.point, self.camera] = True
        kept: BoolArray = np.logical_and.reduce([seen[:, camera] for camera in cameras])
        rays = self._select_rays(kept, kept[self.point] & np.isin(self.camera, cameras))
        return rays, np.flatnonzero(kept)

    def _select_rays(self, kept: BoolArray, rows: BoolArray) -> RayPixels:
        """Some rays of the points that are kept."""
        place = np.cumsum(kept) - 1
        return RayPixels(
            self.pixels[rows],
            self.camera[rows],
            place[self.point[rows]],
            self.sigma[rows],
            self.half_diagonals,
        )


@dataclass(frozen=True)
class LinearizedRays:
    """Rays at some cameras and points, in sigmas.

    Attributes:
        residuals: Projected less measured, shape (N, 2).
        by_camera: Derivatives by the parameters of the ray's camera, shape (N, 2, 8).
        by_point: Derivatives by the ray's point, shape (N, 2, 3).
    """

    residuals: FloatArray
    by_camera: FloatArray
    by_point: FloatArray


def linearize(parameters: FloatArray, points: FloatArray, rays: RayPixels) -> LinearizedRays:
    """Residuals and derivatives of all rays.

    Args:
        parameters: Of the cameras, shape (K, 8).
        points: Pitch frame, metres, shape (F, 3).
        rays: What was seen.
    """
    places = points[rays.point]
    residuals = np.full((len(rays.pixels), 2), np.nan)
    for row in range(len(parameters)):
        mine = rays.camera == row
        camera = camera_from_parameters(parameters[row], (0.0, 0.0), rays.half_diagonals[row])
        residuals[mine] = camera.project(places[mine], folded=True) - rays.pixels[mine]
    slopes = projection_jacobians(parameters[rays.camera], places, rays.half_diagonals[rays.camera])
    behind = np.isnan(residuals).any(axis=1)
    residuals /= rays.sigma[:, None]
    slopes /= rays.sigma[:, None, None]
    residuals[behind], slopes[behind] = (BEHIND, 0.0), 0.0
    # A pixel depends on the difference of point and position alone.
    return LinearizedRays(residuals, slopes, -slopes[:, :, X : Z + 1])


def triangulate_nearest_points(parameters: FloatArray, rays: RayPixels) -> FloatArray:
    """The points nearest to their rays in space, pitch frame, metres, shape (F, 3).

    The least squares of the distances to rays from C along d: the sum of (I - d d') X equals that
    of (I - d d') C. Where rays are parallel the point is their nearest one to the origin.

    Args:
        parameters: Of the cameras, shape (K, 8).
        rays: What was seen.
    """
    normal, pull = np.zeros((rays.point_count, 3, 3)), np.zeros((rays.point_count, 3))
    for row in range(len(parameters)):
        mine = rays.camera == row
        camera = camera_from_parameters(parameters[row], (0.0, 0.0), rays.half_diagonals[row])
        towards = camera.rays(rays.pixels[mine])
        towards /= np.linalg.norm(towards, axis=1, keepdims=True)
        across = np.eye(3) - towards[:, :, None] * towards[:, None, :]
        np.add.at(normal, rays.point[mine], across)
        np.add.at(pull, rays.point[mine], across @ camera.position)
    points = np.linalg.solve(normal + _TINY * np.eye(3), pull[..., None])[..., 0]
    return np.asarray(points, dtype=np.float64)


def optimize_points(parameters: FloatArray, rays: RayPixels, scale: float) -> FloatArray:
    """The points of least soft-L1 cost for these cameras, metres, shape (F, 3).

    Args:
        parameters: Of the cameras, shape (K, 8).
        rays: What was seen.
        scale: Of the loss, in sigmas; infinite for plain least squares.
    """
    points = triangulate_nearest_points(parameters, rays)
    for _ in range(_POINT_STEPS):
        at = linearize(parameters, points, rays)
        weights = soft_l1_weights(at.residuals, scale)
        information, gradient = _point_equations(at, weights, rays)
        points = points - np.asarray(np.linalg.solve(information, gradient[..., None]))[..., 0]
    return points


def soft_l1_weights(residuals: FloatArray, scale: float) -> FloatArray:
    """Weight of each ray under the soft-L1 loss, ``1 / sqrt(1 + (d / scale)^2)``, shape (N,)."""
    weights: FloatArray = 1 / np.sqrt(1 + (residuals**2).sum(axis=1) / scale**2)
    return weights


def bundle_equations(
    parameters: FloatArray, rays: RayPixels, scale: float
) -> tuple[float, FloatArray, FloatArray]:
    """Cost, gradient and J^T W J of the cameras with every point at its best.

    Args:
        parameters: Of the cameras, shape (K, 8).
        rays: What was seen.
        scale: Of the soft-L1 loss, in sigmas.

    Returns:
        The cost, and shapes (8 K,) and (8 K, 8 K).
    """
    points = optimize_points(parameters, rays, scale)
    at = linearize(parameters, points, rays)
    weights = soft_l1_weights(at.residuals, scale)
    cameras = len(parameters)
    gradient = np.zeros((cameras, PARAMETERS))
    information = np.zeros((cameras, PARAMETERS, cameras, PARAMETERS))
    coupling = np.zeros((rays.point_count, 3, cameras, PARAMETERS))
    weighted = weights[:, None, None] * at.by_camera
    for row in range(cameras):
        mine = rays.camera == row
        gradient[row] = np.einsum("nia,ni->a", weighted[mine], at.residuals[mine])
        information[row, :, row] = np.einsum("nia,nib->ab", weighted[mine], at.by_camera[mine])
        shared = at.by_point[mine].transpose(0, 2, 1) @ weighted[mine]
        np.add.at(coupling[:, :, row], rays.point[mine], shared)
    of_points, _ = _point_equations(at, weights, rays)
    size = cameras * PARAMETERS
    mixed = coupling.reshape(rays.point_count, 3, size)
    carried = np.linalg.solve(of_points, mixed)
    reduced = information.reshape(size, size) - np.tensordot(mixed, carried, ((0, 1), (0, 1)))
    squares = (at.residuals**2).sum(axis=1)
    # scale^2 (sqrt(1 + squares / scale^2) - 1), which is squares / 2 where scale is infinite.
    cost = float((squares * weights / (1 + weights)).sum())
    return cost, gradient.ravel(), (reduced + reduced.T) / 2


def _point_equations(
    at: LinearizedRays, weights: FloatArray, rays: RayPixels
) -> tuple[FloatArray, FloatArray]:
    """J^T W J and gradient of each point, shapes (F, 3, 3) and (F, 3)."""
    information, gradient = np.zeros((rays.point_count, 3, 3)), np.zeros((rays.point_count, 3))
    weighted = weights[:, None, None] * at.by_point
    np.add.at(information, rays.point, weighted.transpose(0, 2, 1) @ at.by_point)
    pulls = (weighted.transpose(0, 2, 1) @ at.residuals[..., None])[..., 0]
    np.add.at(gradient, rays.point, pulls)
    return information + _TINY * np.eye(3), gradient


def ray_pair_distances_px(
    parameters: FloatArray, rays: RayPixels
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """How far the two rays of each point pass each other in the pictures, in pixels.

    Args:
        parameters: Of the cameras, shape (K, 8).
        rays: Two for each point, as ``select_common_points`` gives them.

    Returns:
        The gap, both reprojection errors of the best point added, shape (F,); the same with a
        sign, in standard deviations, shape (F,); and the direction of the four pixel coordinates
        along which no point can explain anything, in sigmas, shape (F, 4).
    """
    points = optimize_points(parameters, rays, np.inf)
    at = linearize(parameters, points, rays)
    order = np.argsort(rays.point, kind="stable").reshape(-1, 2)
    apart = np.hypot(*at.residuals.T) * rays.sigma
    slopes = at.by_point[order].reshape(-1, 4, 3)
    free = np.linalg.svd(slopes)[0][:, :, 3]
    free = free * np.where(free[:, :1] < 0, -1.0, 1.0)
    signed = (free * at.residuals[order].reshape(-1, 4)).sum(axis=1)
    return apart[order].sum(axis=1), signed, free
