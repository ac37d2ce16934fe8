"""Compiled kernel of a camera's step towards its paint."""

from __future__ import annotations

import numpy as np
from numba import njit

compiled = njit(cache=True, error_model="numpy", nogil=True)


@compiled
def robust_weight(rest, sigma, strict, soft_px, strict_sigmas, strict_px):
    """Weight of a place of paint by how far off it lies, pixels.

    Args:
        strict: Whether what lies far off counts little (redescending), or by soft-L1.
        soft_px: Scale of the soft-L1 loss; ``strict_sigmas`` and ``strict_px`` those of the other.
    """
    if not strict:
        off = rest / soft_px
        return 1.0 / np.sqrt(1.0 + off * off)
    off = rest / max(strict_sigmas * sigma, strict_px)
    root = 1.0 / (1.0 + off * off)
    return root * root


@compiled
def step_to_paint(
    offsets, sigmas, base, jacobian, information, pull, rounds, damping,
    strict, soft_px, strict_sigmas, strict_px, moved,
):  # fmt: skip
    """Writes the step of iteratively reweighted least squares.

    Args:
        offsets: Of the paint from its markings, pixels, shape (N,), as ``sigmas``.
        base: Weight of each place but for its residual, shape (N,).
        jacobian: Shape (N, 8).
        information: What is known beforehand, shape (8, 8), and its ``pull``, shape (8,).
        rounds: How often the weights are taken anew.
        damping: Relative to the diagonal.
        moved: Result, shape (8,).

    Raises:
        numpy.linalg.LinAlgError: Nothing determines the step.
    """
    width = jacobian.shape[1]
    normal, right = np.empty((width, width)), np.empty(width)
    moved[:] = 0.0
    for _ in range(rounds):
        normal[:], right[:] = information, pull
        for n in range(len(offsets)):
            rest = offsets[n]
            for i in range(width):
                rest -= jacobian[n, i] * moved[i]
            weight = base[n] * robust_weight(
                rest, sigmas[n], strict, soft_px, strict_sigmas, strict_px
            )
            for i in range(width):
                share = weight * jacobian[n, i]
                right[i] += share * offsets[n]
                for k in range(width):
                    normal[i, k] += share * jacobian[n, k]
        for i in range(width):
            normal[i, i] *= 1.0 + damping
        moved[:] = np.linalg.solve(normal, right)
