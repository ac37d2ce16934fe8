"""Motion: how a camera turned and zoomed between two frames, from the static background.

Corners of stands, boards and grass are followed by optical flow (Lucas and Kanade, pyramids); what most
of them do together is the camera's turn, whatever their distance, as it stands on a tripod.
Players, and graphics that stay where they are, do something else and are left out.
"""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
import numpy.typing as npt
from numba import njit

from app.geometry.arrays import FloatArray
from app.geometry.camera import Camera
from app.geometry.curve_residuals import (
    NEAR,
    pitch_to_camera,
    radial_growth_factor,
    unpack_camera,
    write_derivative_row,
)
from app.geometry.resection import (
    LOG_FOCAL,
    PAN,
    ROLL,
    TILT,
    camera_from_parameters,
    parameters_from_camera,
)

compiled = njit(cache=True, error_model="numpy", nogil=True)

UNSEEN_PX = 1e3
"""Of a point that no camera shows."""
SETTLED = 1e-6

Grey = npt.NDArray[np.uint8]

AIM = [PAN, TILT, ROLL, LOG_FOCAL]
CORNERS, QUALITY, APART_PX = 300, 0.01, 12.0
WINDOW_PX, LEVELS = 21, 3
TOGETHER_PX = 2.0
"""What lies farther off than this from the common motion is no background."""
LEAST_CORNERS, LEAST_SHARE = 24, 0.3
"""Fewer corners that move together, or a smaller share, say nothing."""
BLURRED = 4
"""Pictures are made so many times smaller where their motion is sought from nothing."""
LEAST_ALIKE = 0.05
ROUNDS, ROBUST_PX = 8, 0.5
FAR_M = 60.0
STILL_PX, MOVING_PX = 0.25, 1.5


@dataclass(frozen=True)
class BackgroundMatches:
    """The background of two frames: the same corners in both, pixels, shapes (N, 2)."""

    here: FloatArray
    there: FloatArray

    def swap_frames(self) -> BackgroundMatches:
        """The same from the later frame to the earlier one."""
        return BackgroundMatches(self.there, self.here)


def match_background(here: Grey, there: Grey) -> BackgroundMatches | None:
    """The background of two pictures of one camera; None where nothing moves together.

    Args:
        here: The earlier picture, grey, shape (H, W).
        there: The later one.
    """
    corners = np.asarray(cv2.goodFeaturesToTrack(here, CORNERS, QUALITY, APART_PX), np.float32)
    if corners.ndim != 3 or len(corners) < LEAST_CORNERS:
        return None
    found = _track_corners(here, there, corners, np.zeros(2))
    if found is None:
        shift = _estimate_image_shift(here, there)
        if shift is not None:
            found = _track_corners(here, there, corners, shift)
    return found


def _track_corners(
    here: Grey, there: Grey, corners: npt.NDArray[np.float32], shift: FloatArray
) -> BackgroundMatches | None:
    """Corners that move together, sought from where a shift of the picture puts them."""
    guess = np.asarray(corners + shift, np.float32)
    flags = cv2.OPTFLOW_USE_INITIAL_FLOW
    found, status, _ = cv2.calcOpticalFlowPyrLK(
        here, there, corners, guess, winSize=(WINDOW_PX, WINDOW_PX), maxLevel=LEVELS, flags=flags
    )
    kept = status[:, 0] > 0
    one, other = corners[kept, 0].astype(np.float64), found[kept, 0].astype(np.float64)
    moved = np.hypot(*(other - one).T)
    # Graphics stay where they are while the picture moves.
    if len(moved) and np.median(moved) > MOVING_PX:
        one, other = one[moved > STILL_PX], other[moved > STILL_PX]
    if len(one) < LEAST_CORNERS:
        return None
    _, inside = cv2.findHomography(one, other, cv2.USAC_MAGSAC, TOGETHER_PX, maxIters=500)
    if inside is None:
        return None
    chosen = inside[:, 0] > 0
    if chosen.sum() < max(LEAST_CORNERS, LEAST_SHARE * len(corners)):
        return None
    return BackgroundMatches(one[chosen], other[chosen])


def _estimate_image_shift(here: Grey, there: Grey) -> FloatArray | None:
    """By how much all of a picture moved, pixels, shape (2,); None where both are not alike."""
    small = [
        cv2.resize(each, None, fx=1 / BLURRED, fy=1 / BLURRED, interpolation=cv2.INTER_AREA)
        for each in (here, there)
    ]
    one, other = (each.astype(np.float32) for each in small)
    window = cv2.createHanningWindow((one.shape[1], one.shape[0]), cv2.CV_32F)
    shift, alike = cv2.phaseCorrelate(one, other, window)
    return np.array(shift) * BLURRED if alike >= LEAST_ALIKE else None


def apply_background_motion(
    camera: Camera, match: BackgroundMatches, half_diagonal: float
) -> tuple[Camera, float]:
    """A camera after the motion of a match, at the same place, and how well that explains it.

    Args:
        camera: Of the earlier frame.
        match: To the later frame.
        half_diagonal: Half the image diagonal, pixels.

    Returns:
        The camera of the later frame, and the median distance of its corners, pixels.
    """
    start = parameters_from_camera(camera, half_diagonal)
    points = camera.position + FAR_M * camera.rays(match.here)
    seen = np.isfinite(points).all(axis=1)
    points, there = points[seen], match.there[seen]
    parameters, apart = start.copy(), np.empty(len(points))
    rotate_and_zoom_to_points(
        parameters, points, there - camera.principal_point, half_diagonal, ROUNDS, ROBUST_PX, apart
    )
    moved = camera_from_parameters(parameters, camera.principal_point, half_diagonal)
    return moved, float(np.median(apart))


@compiled
def rotate_and_zoom_to_points(parameters, points, pixels, half_diagonal, rounds, robust_px, apart):
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
