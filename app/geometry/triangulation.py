"""Triangulation: points of space from their images in two or more cameras."""

from __future__ import annotations

import numpy as np
from numba import njit

from app.geometry.arrays import FloatArray, cross, require_shape

_PARALLEL = 1e-12
"""Fourth coordinate of a unit vector below which it is no place but a direction."""


def triangulate_pairs(
    P_a: FloatArray, P_b: FloatArray, pixels_a: FloatArray, pixels_b: FloatArray
) -> FloatArray:
    """Points of space from two views each, by the homogeneous linear DLT on pixels.

    Neither pixels nor matrices are normalised: this is what ``cv2.triangulatePoints`` does, and
    other estimators give other datasets (docs/decisions/0007-triangulation-on-pixels.md).

    Args:
        P_a: Projection matrices of the first views, shape (N, 3, 4).
        P_b: Of the second views, shape (N, 3, 4).
        pixels_a: Undistorted pixels in the first views, shape (N, 2).
        pixels_b: In the second views, shape (N, 2).

    Returns:
        Points in the pitch frame, metres, infinite where two rays are parallel, shape (N, 3).

    Source: Hartley & Zisserman, sec. 12.2.
    """
    count = len(P_a)
    for name, array, shape in (
        ("P_a", P_a, (count, 3, 4)),
        ("P_b", P_b, (count, 3, 4)),
        ("pixels_a", pixels_a, (count, 2)),
        ("pixels_b", pixels_b, (count, 2)),
    ):
        require_shape(array, shape, name)
    rows = np.empty((count, 4, 4))
    rows[:, 0] = pixels_a[:, :1] * P_a[:, 2] - P_a[:, 0]
    rows[:, 1] = pixels_a[:, 1:] * P_a[:, 2] - P_a[:, 1]
    rows[:, 2] = pixels_b[:, :1] * P_b[:, 2] - P_b[:, 0]
    rows[:, 3] = pixels_b[:, 1:] * P_b[:, 2] - P_b[:, 1]
    homogeneous = np.empty((count, 4))
    smallest_singular_vectors(rows, homogeneous)
    homogeneous[np.abs(homogeneous[:, 3]) < _PARALLEL] = (np.inf, np.inf, np.inf, 1.0)
    points: FloatArray = homogeneous[:, :3] / homogeneous[:, 3:]
    return points


def triangulation_shifts(
    P_a: FloatArray,
    P_b: FloatArray,
    pixels_a: FloatArray,
    pixels_b: FloatArray,
    step_px: float,
    slopes: tuple[FloatArray, FloatArray] | None = None,
) -> FloatArray:
    """Where ``triangulate_pairs`` puts its points when one pixel of a view is moved.

    Args:
        P_a: As ``triangulate_pairs`` takes them, like ``P_b``, ``pixels_a`` and ``pixels_b``.
        step_px: How far the pixel is moved.
        slopes: Derivatives of the undistorted pixels of each view by those of the image, shapes
            (N, 2, 2); None where the lenses bend so little that they are the same.

    Returns:
        Pitch frame, metres, shape (N, 2, 2, 2, 3): view a or b, pixel axis, forwards or back.
    """
    ways = np.array([step_px, -step_px])[:, None, None]
    # By view and axis, then way: what is added to the pixels of both views.
    steps = (ways * np.eye(4).reshape(4, 1, 2, 2)).reshape(8, 2, 2)
    by_a, by_b = steps[:, 0], steps[:, 1]
    if slopes is not None:
        by_a, by_b = by_a @ slopes[0].transpose(0, 2, 1), by_b @ slopes[1].transpose(0, 2, 1)
    moved = triangulate_pairs(
        np.repeat(P_a, 8, axis=0),
        np.repeat(P_b, 8, axis=0),
        (pixels_a[:, None] + by_a).reshape(-1, 2),
        (pixels_b[:, None] + by_b).reshape(-1, 2),
    )
    return moved.reshape(-1, 2, 2, 2, 3)


def parallax_angle(
    position_a: FloatArray, position_b: FloatArray, points: FloatArray
) -> FloatArray:
    """Angle between the two rays that meet at each point, in radians.

    A small angle means that depth is poorly constrained.

    Args:
        position_a: Of the cameras A in the pitch frame, metres, shape (N, 3).
        position_b: Of the cameras B in the pitch frame, metres, shape (N, 3).
        points: Points in the pitch frame, metres, shape (N, 3).

    Returns:
        Angles in [0, pi], NaN where a point coincides with a camera position, shape (N,).

    Raises:
        ShapeError: An argument has another shape.

    Example:
        >>> origin, east = np.zeros((1, 3)), np.array([[2.0, 0.0, 0.0]])
        >>> np.degrees(parallax_angle(origin, east, np.array([[1.0, 1.0, 0.0]]))).round(9)
        array([90.])
    """
    points = require_shape(points, (None, 3), "points")
    to_a = require_shape(position_a, (len(points), 3), "position_a") - points
    to_b = require_shape(position_b, (len(points), 3), "position_b") - points
    sine = np.linalg.norm(cross(to_a, to_b), axis=1)
    cosine = (to_a * to_b).sum(axis=1)
    nowhere = (to_a == 0).all(axis=1) | (to_b == 0).all(axis=1)
    # atan2 of (sine, cosine): arccos loses half the digits near zero, which
    # is exactly where small-baseline pairs live.
    return np.where(nowhere, np.nan, np.arctan2(sine, cosine))


_SWEEPS = 30
_ORTHOGONAL = 1e-15


# Types are checked by hand from here on: numba compiles these functions from their arguments.
@njit(cache=True, error_model="numpy", nogil=True)
def smallest_singular_vectors(matrices, vectors):
    """Writes for each matrix the unit vector that it shortens most.

    One-sided Jacobi: columns are turned against each other in pairs until all are orthogonal;
    it squares nothing, so small singular values keep their digits.

    Args:
        matrices: Shape (N, 4, 4).
        vectors: Result, shape (N, 4); the sign is arbitrary.

    Source: Golub & Van Loan, sec. 8.6.3.
    """
    A = np.empty((4, 4))
    V = np.empty((4, 4))
    for n in range(len(matrices)):
        for i in range(4):
            for j in range(4):
                A[i, j] = matrices[n, i, j]
                V[i, j] = 1.0 if i == j else 0.0
        for _ in range(_SWEEPS):
            largest = 0.0
            for p in range(3):
                for q in range(p + 1, 4):
                    largest = max(largest, _rotate_columns(A, V, p, q))
            if largest < _ORTHOGONAL:
                break
        best, shortest = 0, np.inf
        for j in range(4):
            length = A[0, j] ** 2 + A[1, j] ** 2 + A[2, j] ** 2 + A[3, j] ** 2
            if length < shortest:
                best, shortest = j, length
        for i in range(4):
            vectors[n, i] = V[i, best]


@njit(cache=True, error_model="numpy", nogil=True)
def _rotate_columns(A, V, p, q):
    """Make columns p and q of A orthogonal; returns how far they were from it."""
    pp = qq = pq = 0.0
    for i in range(4):
        pp += A[i, p] * A[i, p]
        qq += A[i, q] * A[i, q]
        pq += A[i, p] * A[i, q]
    scale = np.sqrt(pp * qq)
    if scale == 0.0 or abs(pq) <= 1e-16 * scale:
        return 0.0
    zeta = (qq - pp) / (2 * pq)
    tangent = np.sign(zeta) / (abs(zeta) + np.sqrt(1 + zeta * zeta)) if zeta != 0 else 1.0
    cosine = 1 / np.sqrt(1 + tangent * tangent)
    sine = cosine * tangent
    for i in range(4):
        a, b = A[i, p], A[i, q]
        A[i, p], A[i, q] = cosine * a - sine * b, sine * a + cosine * b
        a, b = V[i, p], V[i, q]
        V[i, p], V[i, q] = cosine * a - sine * b, sine * a + cosine * b
    return abs(pq) / scale
