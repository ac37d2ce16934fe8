"""Camera stack: several cameras looked through at once, for the price of about one."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from app.geometry.arrays import BoolArray, FloatArray, IntArray
from app.geometry.camera import MIN_DEPTH, Camera
from app.geometry.distortion import COEFFICIENTS, distort, distort_jacobian


class CameraStack:
    """Cameras as arrays; each pixel and derivative has the bits that its camera alone gives it.

    Args:
        cameras: One or more; wide lenses among them are looked through one by one.
    """

    def __init__(self, cameras: Sequence[Camera]):
        self._cameras = tuple(cameras)
        self._rotation = np.array([camera.rotation for camera in cameras])
        self._position = np.array([camera.position for camera in cameras])
        self._K = np.array([camera.K for camera in cameras])
        self._bends = np.array([camera.distorts for camera in cameras])
        self._some_bend = bool(self._bends.any())
        self._wide = np.array([camera.is_wide for camera in cameras])
        self._fold = np.array([camera.model.fold_radius(camera.distortion) for camera in cameras])
        self._lens = np.array(
            [np.zeros(COEFFICIENTS) if item.is_wide else item.distortion for item in cameras]
        )

    def linearize(self, points: FloatArray, which: IntArray) -> tuple[FloatArray, FloatArray]:
        """Pixels of points in some of the cameras each, and their derivatives by the points.

        Args:
            points: Pitch frame, metres, shape (E, 3).
            which: Numbers of the cameras that look at each point, shape (E, V).

        Returns:
            As ``Camera.project`` and ``Camera.jacobian``: pixels, NaN where a camera does not show
            the point, shape (E, V, 2), and pixels per metre, shape (E, V, 2, 3).
        """
        R, K = self._rotation[which], self._K[which]
        reach = points[:, None] - self._position[which]
        slope = np.zeros((*which.shape, 2, 3))
        slope[..., 0, 0] = slope[..., 1, 1] = 1.0
        pixels = np.empty((*which.shape, 2))
        with np.errstate(all="ignore"):
            # Camera multiplies once from the right and once from the left, which may round apart.
            ahead = (reach[:, :, None] @ R.swapaxes(-1, -2))[:, :, 0]
            turned = (R @ reach[..., None])[..., 0]
            depth = turned[..., 2:]
            slope[..., 2] = -turned[..., :2] / depth
            slope = slope / depth[..., None] @ R
            ideal = ahead[..., :2] / ahead[..., 2:]
            shown = ahead[..., 2] > MIN_DEPTH
            if self._some_bend:
                place = turned[..., :2] / depth
                ideal, slope, inside = self._bent(ideal, slope, place, which)
                shown &= inside
            u, v = ideal[..., 0], ideal[..., 1]
            pixels[..., 0] = K[..., 0, 0] * u + K[..., 0, 1] * v + K[..., 0, 2]
            pixels[..., 1] = K[..., 1, 1] * v + K[..., 1, 2]
            pixels[~shown] = np.nan
            return pixels, K[..., :2, :2] @ slope

    def _bent(
        self, ideal: FloatArray, slope: FloatArray, place: FloatArray, which: IntArray
    ) -> tuple[FloatArray, FloatArray, BoolArray]:
        """Where lenses bend rays to, how that moves, and whether they show them at all."""
        ideal, slope = ideal.copy(), slope.copy()
        bends, wide = self._bends[which], self._wide[which]
        inside = ~bends | (np.hypot(ideal[..., 0], ideal[..., 1]) <= self._fold[which])
        rows = bends & ~wide
        lenses = self._lens[which[rows]].T
        ideal[rows] = distort(ideal[rows], lenses)
        slope[rows] = distort_jacobian(place[rows], lenses) @ slope[rows]
        for row in zip(*np.nonzero(wide), strict=True):
            camera = self._cameras[which[row]]
            u, v = ideal[row].tolist()
            ideal[row] = camera.model.distort_point(u, v, camera.distortion.tolist())
            slope[row] = camera.model.jacobian(place[row][None], camera.distortion)[0] @ slope[row]
        return ideal, slope, inside
