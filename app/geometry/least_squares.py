"""Batched Levenberg-Marquardt: several starts of one problem, solved side by side.

Source: Madsen, Nielsen and Tingleff, "Methods for non-linear least squares problems", sec. 3.2.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from app.errors import DegenerateGeometryError
from app.geometry.arrays import FloatArray
from app.geometry.resection_kernels import solve_damped_step

NormalEquations = Callable[[FloatArray], tuple[FloatArray, FloatArray, FloatArray]]
"""Maps parameters (B, n) to cost (B,), gradient (B, n) and J^T W J (B, n, n)."""

CONVERGED = "converged"
OUT_OF_STEPS = "out of steps"
STUCK = "no step lowers the cost"

TOLERANCE = 1e-6
"""A start has converged when a kept step lowers its cost by less than this share."""
_FIRST_DAMPING, _DAMPING_RANGE = 1e-3, (1e-9, 1e9)
"""Relative to the diagonal of J^T W J."""


@dataclass(frozen=True)
class LeastSquaresResult:
    """Where each start ended.

    Attributes:
        parameters: Shape (B, n).
        cost: Shape (B,).
        information: J^T W J at the end, shape (B, n, n).
        accepted: Number of accepted steps, shape (B,).
        rejected: Number of rejected steps, shape (B,).
        reasons: Why each start stopped: ``CONVERGED``, ``OUT_OF_STEPS`` or ``STUCK``.
    """

    parameters: FloatArray
    cost: FloatArray
    information: FloatArray
    accepted: FloatArray
    rejected: FloatArray
    reasons: tuple[str, ...]


def levenberg_marquardt(
    normal_equations: NormalEquations, start: FloatArray, steps: int
) -> LeastSquaresResult:
    """Minimise a sum of squares from each row of ``start``.

    Each round damps the normal equations, proposes a step for every start that still moves,
    keeps it where it lowers the cost, and damps less after a kept step and more after a
    refused one.

    Args:
        normal_equations: The problem; called with all starts that still move.
        start: Shape (B, n).
        steps: Most rounds.
    """
    parameters = np.array(start, dtype=np.float64)
    count = len(parameters)
    cost, gradient, information = (np.array(part) for part in normal_equations(parameters))
    damping = np.full(count, _FIRST_DAMPING)
    accepted, rejected = np.zeros(count), np.zeros(count)
    reasons = np.full(count, OUT_OF_STEPS, dtype=object)
    moving = np.arange(count)
    for _ in range(steps):
        step = _damped_step(gradient[moving], information[moving], damping[moving])
        trial = parameters[moving] + step
        trial_cost, trial_gradient, trial_information = normal_equations(trial)
        better = trial_cost < cost[moving]
        kept, refused = moving[better], moving[~better]
        gain = 1 - trial_cost[better] / cost[kept]
        parameters[kept], cost[kept] = trial[better], trial_cost[better]
        gradient[kept], information[kept] = trial_gradient[better], trial_information[better]
        accepted[kept] += 1
        rejected[refused] += 1
        damping[kept] = np.maximum(damping[kept] / 5, _DAMPING_RANGE[0])
        damping[refused] *= 4
        reasons[kept[gain < TOLERANCE]] = CONVERGED
        reasons[refused[damping[refused] > _DAMPING_RANGE[1]]] = STUCK
        moving = np.flatnonzero(reasons == OUT_OF_STEPS)
        if len(moving) == 0:
            break
    return LeastSquaresResult(parameters, cost, information, accepted, rejected, tuple(reasons))


def require_determined_parameters(information: FloatArray) -> None:
    """Refuse a minimum at which the residuals do not determine every parameter.

    Args:
        information: J^T W J at the minimum, shape (n, n).

    Raises:
        DegenerateGeometryError: Some combination of parameters is not determined.
    """
    scale = np.sqrt(np.diag(information))
    if not np.all(np.isfinite(scale)) or np.any(scale <= 0):
        raise DegenerateGeometryError("a parameter has no influence on the residuals")
    values = np.linalg.eigvalsh(information / np.outer(scale, scale))
    if values[0] < 1e-14 * values[-1]:
        raise DegenerateGeometryError(
            "the residuals do not determine a combination of the parameters"
        )


def covariance(information: FloatArray) -> FloatArray:
    """Covariance of the parameters: the inverse of J^T W J, its weights one over the variances.

    Args:
        information: J^T W J at the minimum, shape (n, n).

    Raises:
        DegenerateGeometryError: Some combination of parameters is not determined.
    """
    require_determined_parameters(information)
    scale = np.sqrt(np.diag(information))
    values, vectors = np.linalg.eigh(information / np.outer(scale, scale))
    inverse = vectors / values @ vectors.T
    return np.asarray(inverse / np.outer(scale, scale), dtype=np.float64)


def _damped_step(gradient: FloatArray, information: FloatArray, damping: FloatArray) -> FloatArray:
    """Solve (J^T W J + damping diag) step = -gradient for each start."""
    step = np.empty_like(gradient)
    solve_damped_step(gradient, information, damping, step)
    return step
