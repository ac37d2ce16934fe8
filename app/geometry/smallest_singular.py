"""Compiled kernel of triangulation: smallest right singular vectors of many 4 x 4 matrices."""

from __future__ import annotations

import numpy as np
from numba import njit

_SWEEPS = 30
_ORTHOGONAL = 1e-15


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
