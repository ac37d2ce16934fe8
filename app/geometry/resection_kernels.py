"""Compiled kernels of resection: damped steps, the descent of a camera, its starts, and points thinned.

A round of the descent is short beside numpy's calls around it. The arithmetic is that of
``least_squares``, operation by operation: the same bits. Types are checked by hand here (numba
compiles these functions from their arguments).
"""

from __future__ import annotations

import numpy as np
from numba import njit

from app.geometry.curve_residuals import SEGMENT, accumulate_equations, compiled


@njit(cache=True, error_model="numpy", nogil=True)
def solve_damped_step(gradient, information, damping, step):
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
        solve_damped_step(slope[:left], bend[:left], damped[:left], step[:left])
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


NEAR_M = 1.0
"""Metres in front of a stand from which a curve counts as seen."""
SHORT_M = 5.0
"""A shorter curve weighs like one of this length."""
LEAST_WIDTH = 1e-3
"""Of normalised image coordinates, where nothing lies in front of a stand."""


@compiled
def aim_starting_cameras(stands, kinds, shapes, pixels, curve, least_spread_px, focals, starts):
    """Writes one start for each stand: level, aimed and zoomed so that the seen curves lie where they are.

    Each curve counts as its middle, the less the longer it is: of a long one perhaps a corner is seen.

    Args:
        stands: Pitch frame, metres, shape (S, 3).
        kinds: As in ``resection.Curves``.
        shapes: Likewise.
        pixels: Relative to the principal point, shape (N, 2).
        curve: Index of each point's curve, shape (N,).
        least_spread_px: The curves are taken to be seen at least so far apart.
        focals: Shortest and longest focal length, pixels.
        starts: Result: parameters of ``resection``, shape (S, 8).
    """
    total, (column, row), (x, y, z) = 0.0, (0.0, 0.0), (0.0, 0.0, 0.0)
    weight, seen, middles = _summarize_seen_curves(kinds, shapes, pixels, curve)
    for m in range(len(kinds)):
        total += weight[m]
    for m in range(len(kinds)):
        weight[m] /= total
        column, row = column + weight[m] * seen[m, 0], row + weight[m] * seen[m, 1]
        x, y, z = (
            x + weight[m] * middles[m, 0],
            y + weight[m] * middles[m, 1],
            z + weight[m] * middles[m, 2],
        )
    squared = 0.0
    for m in range(len(kinds)):
        squared += weight[m] * ((seen[m, 0] - column) ** 2 + (seen[m, 1] - row) ** 2)
    spread_px = max(np.sqrt(squared), least_spread_px)
    for s in range(len(stands)):
        stand = stands[s]
        fx, fy, fz = x - stand[0], y - stand[1], z - stand[2]
        length = np.sqrt(fx * fx + fy * fy + fz * fz)
        fx, fy, fz = fx / length, fy / length, fz / length
        pan, tilt = np.arctan2(fx, -fy), np.arccos(fz)
        wide = _rms_width_from_position(stand, (fx, fy, fz), pan, tilt, middles, weight)
        focal = min(max(spread_px / max(wide, LEAST_WIDTH), focals[0]), focals[1])
        # Turn so that the aim appears where the annotation has it, not in the middle.
        starts[s, 0] = pan - np.arctan(column / focal)
        starts[s, 1] = tilt + np.arctan(row / focal)
        starts[s, 2] = 0.0
        starts[s, 3:6] = stand
        starts[s, 6] = np.log(focal)
        starts[s, 7] = 0.0


@compiled
def _summarize_seen_curves(kinds, shapes, pixels, curve):
    """Of each curve its weight (zero where it is not seen), the mean of its points and its middle."""
    count = len(kinds)
    points, weight = np.zeros(count), np.zeros(count)
    seen, middles = np.zeros((count, 2)), np.zeros((count, 3))
    for n in range(len(pixels)):
        m = curve[n]
        points[m] += 1
        seen[m, 0] += pixels[n, 0]
        seen[m, 1] += pixels[n, 1]
    for m in range(count):
        if points[m] == 0:
            continue
        seen[m] /= points[m]
        weight[m] = 1 / max(_compute_curve_middle(kinds[m], shapes[m], middles[m]), SHORT_M)
    return weight, seen, middles


@compiled
def _compute_curve_middle(kind, shape, middle):
    """Writes the middle of a curve; returns how long it is, an arc as long as it is wide."""
    if kind == SEGMENT:
        for k in range(3):
            middle[k] = (shape[k] + shape[3 + k]) / 2
        dx, dy, dz = shape[3] - shape[0], shape[4] - shape[1], shape[5] - shape[2]
        return np.sqrt(dx * dx + dy * dy + dz * dz)
    middle[0], middle[1], middle[2] = shape[0], shape[1], 0.0
    if shape[4] - shape[3] < 2 * np.pi - 1e-9:
        facing = (shape[3] + shape[4]) / 2
        middle[0] += shape[2] * np.cos(facing)
        middle[1] += shape[2] * np.sin(facing)
    return 2 * shape[2]


@compiled
def _rms_width_from_position(stand, forward, pan, tilt, middles, weight):
    """How wide a stand sees the middles that are in front of it: weighted root mean square of their
    normalised image coordinates."""
    rx, ry = np.cos(pan), np.sin(pan)
    lift, sink = np.cos(tilt), np.sin(tilt)
    squared = 0.0
    for m in range(len(weight)):
        dx, dy, dz = middles[m, 0] - stand[0], middles[m, 1] - stand[1], middles[m, 2] - stand[2]
        depth = dx * forward[0] + dy * forward[1] + dz * forward[2]
        if weight[m] > 0 and depth > NEAR_M:
            right = dx * rx + dy * ry
            down = -lift * ry * dx + lift * rx * dy + sink * dz
            squared += weight[m] * (right * right + down * down) / (depth * depth)
    return np.sqrt(squared)


@compiled
def select_farthest_points(pixels, curve, limits, keep):
    """Writes which points are kept: of a curve the one farthest from the middle of its points, and
    after it each that is farthest from those before it.

    Args:
        pixels: Shape (N, 2).
        curve: Index of each point's curve, shape (N,), increasing.
        limits: How many of each curve are kept, shape (M,).
        keep: Result, shape (N,); of equally far points the first is kept.
    """
    begin, count = 0, len(pixels)
    apart = np.empty(count)
    while begin < count:
        end = begin
        while end < count and curve[end] == curve[begin]:
            end += 1
        left = limits[curve[begin]]
        keep[begin:end] = end - begin <= left
        if end - begin > left:
            x, y = pixels[begin:end, 0].mean(), pixels[begin:end, 1].mean()
            farthest = _update_distances_and_find_farthest(pixels, apart, begin, end, x, y, True)
            for nth in range(left):
                keep[farthest] = True
                x, y = pixels[farthest]
                farthest = _update_distances_and_find_farthest(
                    pixels, apart, begin, end, x, y, nth == 0
                )
        begin = end


@compiled
def _update_distances_and_find_farthest(pixels, apart, begin, end, x, y, anew):
    """Lowers each point's squared distance to the nearest chosen one (``anew``: to this one alone);
    returns the point whose distance is largest."""
    farthest, most = begin, -1.0
    for n in range(begin, end):
        squared = (pixels[n, 0] - x) ** 2 + (pixels[n, 1] - y) ** 2
        apart[n] = squared if anew else min(apart[n], squared)
        if apart[n] > most:
            farthest, most = n, apart[n]
    return farthest
