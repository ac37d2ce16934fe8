"""Shot equations: normal equations of the frames of a shot, each tied to the next one.

They are block tridiagonal, one block of eight parameters for each frame, bordered by what the shot has in
common, which is eliminated last (Schur complement).

Source: Triggs et al., "Bundle adjustment: a modern synthesis", section 6.
"""

from __future__ import annotations

import numpy as np

from app.geometry.arrays import FloatArray
from app.geometry.resection import PARAMETERS

SCALE = np.array([1e-3, 1e-3, 1e-3, 1.0, 1.0, 1.0, 1e-3, 1e-3])
"""Units in which the equations are solved."""
SHARED = 8
"""What a shot has in common: place (3), slope by pan (3), distortion and its slope by zoom."""


class ShotEquations:
    """Normal equations: a block tridiagonal matrix with a border.

    Attributes:
        diagonal: Shape (N, 8, 8).
        beside: Block between each frame and the next one, shape (N - 1, 8, 8).
        border: Between each frame and what is shared, shape (N, 8, S).
        corner: Of what is shared, shape (S, S).
        right: Shape (N, 8).
        below: Shape (S,).
    """

    def __init__(self, count: int):
        self.diagonal = np.zeros((count, PARAMETERS, PARAMETERS))
        self.beside = np.zeros((max(count - 1, 0), PARAMETERS, PARAMETERS))
        self.border = np.zeros((count, PARAMETERS, SHARED))
        self.corner = np.zeros((SHARED, SHARED))
        self.right = np.zeros((count, PARAMETERS))
        self.below = np.zeros(SHARED)

    def _scale_equations(self) -> tuple[FloatArray, FloatArray]:
        both = SCALE[:, None] * SCALE
        return self.diagonal * both, self.beside * both

    def solve(self) -> tuple[FloatArray, FloatArray]:
        """The step of the frames, shape (N, 8), and of what is shared, shape (S,)."""
        right = np.concatenate([self.right[:, :, None], self.border], axis=2)
        found = solve_tridiagonal(*self._scale_equations(), right * SCALE[:, None]) * SCALE[:, None]
        alone, border = found[:, :, 0], found[:, :, 1:]
        rest = self.corner - np.einsum("nis,nit->st", self.border, border)
        below = self.below - np.einsum("nis,ni->s", self.border, alone)
        shared = np.linalg.solve(rest, below)
        return alone - border @ shared, shared

    def covariances(self, terms: FloatArray) -> list[FloatArray]:
        """Diagonal blocks of the inverse, and what terms that all have in common add to them.

        Args:
            terms: Right sides of one standard deviation of each term, shape (N, 8, K).
        """
        diagonal, beside = self._scale_equations()
        right = np.concatenate([self.border, terms], axis=2) * SCALE[:, None]
        found = solve_tridiagonal(diagonal, beside, right) * SCALE[:, None]
        border, moved = found[:, :, :SHARED], found[:, :, SHARED:]
        rest = self.corner - np.einsum("nis,nit->st", self.border, border)
        shared = np.linalg.inv(rest)
        below = shared @ -np.einsum("nis,nik->sk", self.border, moved)
        moved = moved - border @ below
        inverses = compute_inverse_diagonal_blocks(diagonal, beside) * (SCALE[:, None] * SCALE)
        covariances = inverses + border @ shared @ border.transpose(0, 2, 1)
        covariances += moved @ moved.transpose(0, 2, 1)
        return [0.5 * (each + each.T) for each in covariances]


def solve_tridiagonal(diagonal: FloatArray, beside: FloatArray, right: FloatArray) -> FloatArray:
    """Solution of a symmetric block tridiagonal system.

    Args:
        diagonal: Shape (N, B, B).
        beside: Above the diagonal, shape (N - 1, B, B).
        right: Shape (N, B, K).

    Returns:
        Shape (N, B, K).

    Raises:
        numpy.linalg.LinAlgError: A block is singular.
    """
    count = len(diagonal)
    pivots, rest = diagonal.copy(), right.copy()
    for n in range(1, count):
        share = np.linalg.solve(pivots[n - 1], beside[n - 1]).T
        pivots[n] -= share @ beside[n - 1]
        rest[n] -= share @ rest[n - 1]
    found = np.empty_like(rest)
    for n in range(count - 1, -1, -1):
        if n < count - 1:
            rest[n] -= beside[n] @ found[n + 1]
        found[n] = np.linalg.solve(pivots[n], rest[n])
    return found


def compute_inverse_diagonal_blocks(diagonal: FloatArray, beside: FloatArray) -> FloatArray:
    """Diagonal blocks of the inverse of such a system, shape (N, B, B)."""
    count = len(diagonal)
    before, after = diagonal.copy(), diagonal.copy()
    for n in range(1, count):
        before[n] -= beside[n - 1].T @ np.linalg.solve(before[n - 1], beside[n - 1])
    for n in range(count - 2, -1, -1):
        after[n] -= beside[n] @ np.linalg.solve(after[n + 1], beside[n].T)
    return np.asarray(np.linalg.inv(before + after - diagonal))
