"""Compiled kernel of motion: the turn and zoom of a camera that stays where it is."""

from __future__ import annotations

import numpy as np
from numba import njit

from app.geometry.curve_residuals import (
    NEAR,
    pitch_to_camera,
    radial_growth_factor,
    unpack_camera,
    write_derivative_row,
)

compiled = njit(cache=True, error_model="numpy", nogil=True)

UNSEEN_PX = 1e3
"""Of a point that no camera shows."""
SETTLED = 1e-6


@compiled
def turn_to_points(parameters, points, pixels, half_diagonal, rounds, robust_px, apart):
    """Turns and zooms a camera until it shows points where they are seen; far ones count little.

    Args:
        parameters: The camera, see ``geometry.resection``, shape (8,); changed.
        points: Pitch frame, metres, shape (N, 3).
        pixels: Where they are seen, from the principal point, shape (N, 2).
        rounds: Of reweighted least squares at most.
        robust_px: What is farther off than this, and than the median, counts little.
        apart: Result: how far off each was before the last step, pixels, shape (N,).

    Raises:
        numpy.linalg.LinAlgError: The points determine no turn.
    """
    rest, rows = np.empty((len(points), 2)), np.empty((len(points), 2, 8))
    # Pan, tilt, roll and the logarithm of the focal length.
    free = (0, 1, 2, 6)
    normal, right = np.empty((4, 4)), np.empty(4)
    for _ in range(rounds):
        camera = unpack_camera(parameters, half_diagonal)
        for n in range(len(points)):
            px, py, pz = points[n, 0], points[n, 1], points[n, 2]
            x, y, z = pitch_to_camera(camera, px, py, pz)
            rest[n, 0], rest[n, 1] = UNSEEN_PX, UNSEEN_PX
            if z > NEAR:
                ix, iy = camera[12] * x / z, camera[12] * y / z
                growth = radial_growth_factor(camera[13] * (ix * ix + iy * iy))
                rest[n, 0], rest[n, 1] = pixels[n, 0] - ix * growth, pixels[n, 1] - iy * growth
            write_derivative_row(camera, px - camera[9], py - camera[10], pz - camera[11], rows, n)
            apart[n] = np.hypot(rest[n, 0], rest[n, 1])
        scale = max(robust_px, np.median(apart))
        normal[:], right[:] = 0.0, 0.0
        for n in range(len(points)):
            weight = 1.0 / (1.0 + (apart[n] / scale) ** 2)
            for row in range(2):
                for i in range(4):
                    share = weight * rows[n, row, free[i]]
                    right[i] += share * rest[n, row]
                    for k in range(4):
                        normal[i, k] += share * rows[n, row, free[k]]
        step = np.linalg.solve(normal, right)
        for i in range(4):
            parameters[free[i]] += step[i]
        if np.abs(step).max() < SETTLED:
            break
