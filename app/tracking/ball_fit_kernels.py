"""Compiled solution of block tridiagonal systems; ``ball_fit`` is the door to this file.

LAPACK's banded solver asks for threads that systems as narrow as these only wait for.
"""

from __future__ import annotations

import numpy as np
from numba import njit


@njit(cache=True, nogil=True, error_model="numpy")
def factor(diagonal, beside):
    """Cholesky factor of a positive definite block tridiagonal matrix.

    Args:
        diagonal: Blocks on the diagonal, shape (K, S, S).
        beside: Those right of them, shape (K - 1, S, S).

    Returns:
        Rows of the factor, the diagonal in the last column, shape (K * S, 2 * S).
    """
    count, size = diagonal.shape[0], diagonal.shape[1]
    wide = 2 * size
    rows = np.zeros((count * size, wide))
    for i in range(count * size):
        block, own = i // size, i % size
        first = max(0, (block - 1) * size)
        for j in range(first, i + 1):
            other = j // size
            if other == block:
                total = diagonal[block, own, j % size]
            else:
                total = beside[other, j % size, own]
            begin = max(first, (other - 1) * size)
            for m in range(begin, j):
                total -= rows[i, wide - 1 - (i - m)] * rows[j, wide - 1 - (j - m)]
            if j == i:
                rows[i, wide - 1] = np.sqrt(max(total, 1e-12))
            else:
                rows[i, wide - 1 - (i - j)] = total / rows[j, wide - 1]
    return rows


@njit(cache=True, nogil=True, error_model="numpy")
def solve_factored(rows, size, right):
    """Solve for a right side, shape (N,), with the factor of ``factor``."""
    count, wide = rows.shape
    found = right.copy()
    for i in range(count):
        for m in range(max(0, (i // size - 1) * size), i):
            found[i] -= rows[i, wide - 1 - (i - m)] * found[m]
        found[i] /= rows[i, wide - 1]
    for i in range(count - 1, -1, -1):
        found[i] /= rows[i, wide - 1]
        for m in range(max(0, (i // size - 1) * size), i):
            found[m] -= rows[i, wide - 1 - (i - m)] * found[i]
    return found


@njit(cache=True, nogil=True, error_model="numpy")
def inverse_blocks(rows, size):
    """Blocks of the inverse on the diagonal, (K, S, S), and right of them, (K - 1, S, S).

    Source: K. Takahashi, J. Fagan, M. Chin, 1973: the inverse within the pattern of its factor.
    """
    count, wide = rows.shape
    blocks = count // size
    own, beside = np.zeros((blocks, size, size)), np.zeros((max(blocks - 1, 0), size, size))
    for i in range(count - 1, -1, -1):
        block, a = i // size, i % size
        last = min(count, (block + 2) * size)
        for j in range(last - 1, i - 1, -1):
            total = 1.0 / rows[i, wide - 1] if i == j else 0.0
            for m in range(i + 1, last):
                # The entry at (m, j), both of this block or the next.
                low, high = min(m, j), max(m, j)
                if low // size == high // size:
                    entry = own[low // size, low % size, high % size]
                else:
                    entry = beside[block, low % size, high % size]
                total -= rows[m, wide - 1 - (m - i)] * entry
            total /= rows[i, wide - 1]
            if j // size == block:
                own[block, a, j % size] = total
                own[block, j % size, a] = total
            else:
                beside[block, a, j % size] = total
    return own, beside
