"""Compiled descent of resection: ``levenberg_marquardt`` for cameras, its rounds without Python.

A round is short beside numpy's calls around it. The arithmetic is that of ``least_squares``,
operation by operation: the same bits.
"""

from __future__ import annotations

import numpy as np

from app.geometry.curve_residuals import accumulate_equations, compiled
from app.geometry.damped_solve import solve_damped

CONVERGED, OUT_OF_STEPS, STUCK = 0, 1, 2
LEAST_DAMPING, MOST_DAMPING = 1e-9, 1e9


@compiled
def minimize_curve_costs(
    parameters, kinds, shapes, pixels, curve, weight, mean, sigma, scale, half_diagonal,
    steps, tolerance, damping, cost, gradient, information, accepted, rejected, reasons,
):  # fmt: skip
    """Move each row of parameters to a minimum; results are written to it and to the last six."""
    count, size = parameters.shape
    accumulate_equations(
        parameters, kinds, shapes, pixels, curve, weight, mean, sigma, scale, half_diagonal,
        cost, gradient, information,
    )  # fmt: skip
    damping_of = np.full(count, damping)
    moving = np.arange(count)
    trial, step, slope = (
        np.empty_like(parameters),
        np.empty_like(parameters),
        np.empty_like(parameters),
    )
    bend, damped, found = np.empty((count, size, size)), np.empty(count), np.empty(count)
    left = count
    for _ in range(steps):
        for i in range(left):
            b = moving[i]
            slope[i], bend[i], damped[i] = gradient[b], information[b], damping_of[b]
        solve_damped(slope[:left], bend[:left], damped[:left], step[:left])
        for i in range(left):
            trial[i] = parameters[moving[i]] + step[i]
        accumulate_equations(
            trial[:left], kinds, shapes, pixels, curve, weight, mean, sigma, scale, half_diagonal,
            found[:left], slope[:left], bend[:left],
        )  # fmt: skip
        still = 0
        for i in range(left):
            b = moving[i]
            if found[i] < cost[b]:
                gain = 1 - found[i] / cost[b]
                parameters[b], cost[b] = trial[i], found[i]
                gradient[b], information[b] = slope[i], bend[i]
                accepted[b] += 1
                damping_of[b] = max(damping_of[b] / 5, LEAST_DAMPING)
                if gain < tolerance:
                    reasons[b] = CONVERGED
            else:
                rejected[b] += 1
                damping_of[b] *= 4
                if damping_of[b] > MOST_DAMPING:
                    reasons[b] = STUCK
            if reasons[b] == OUT_OF_STEPS:
                moving[still] = b
                still += 1
        left = still
        if left == 0:
            break
