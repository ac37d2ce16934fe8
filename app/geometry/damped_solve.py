"""Compiled kernel of the least-squares optimiser: many small damped systems at once."""

from __future__ import annotations

import numpy as np
from numba import njit


@njit(cache=True, error_model="numpy", nogil=True)
def solve_damped(gradient, information, damping, step):
    """Writes the step of each start, by Cholesky decomposition.

    Args:
        gradient: Shape (B, n).
        information: Symmetric, shape (B, n, n).
        damping: Relative to the diagonal, shape (B,).
        step: Result, shape (B, n); zero where the system is not positive definite, which the
            caller sees as a step that does not lower the cost.
    """
    n = gradient.shape[1]
    L = np.empty((n, n))
    for b in range(len(gradient)):
        sound = True
        for i in range(n):
            for j in range(i + 1):
                value = information[b, i, j]
                if i == j:
                    value += damping[b] * value + 1e-12
                for k in range(j):
                    value -= L[i, k] * L[j, k]
                if i == j:
                    sound = sound and value > 0
                    L[i, i] = np.sqrt(value) if value > 0 else 1.0
                else:
                    L[i, j] = value / L[j, j]
        for i in range(n):
            value = -gradient[b, i]
            for k in range(i):
                value -= L[i, k] * step[b, k]
            step[b, i] = value / L[i, i]
        for i in range(n - 1, -1, -1):
            value = step[b, i]
            for k in range(i + 1, n):
                value -= L[k, i] * step[b, k]
            step[b, i] = value / L[i, i]
        if not sound:
            step[b] = 0.0
