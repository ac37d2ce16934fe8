"""Compiled kernels of scoring and of the rough refinement; ``search`` is the door to this file.

Types are checked by hand here. Pixels are relative to the principal point.
"""

from __future__ import annotations

import numpy as np
from numba import njit

from app.geometry.curve_residuals import (
    ideal_pixel,
    pitch_to_camera,
    radial_growth_factor,
    unpack_camera,
    write_residual_row,
)

compiled = njit(cache=True, nogil=True, error_model="numpy")

FIRST = 16
"""Points after which a hopeless candidate is left."""
HOPELESS = 0.8


@compiled
def find_nearest_place(camera, px, py, shapes, nearest, origin, cell):
    """The place on the nearest marking for a pixel without distortion: x, y, z and its tangent.

    Before it 1 where the place lies within its marking, 0 at an end, -1 where the pixel shows no
    grass near the pitch.
    """
    nowhere = -1, (0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
    u, v = px / camera[12], py / camera[12]
    z = camera[2] * u + camera[5] * v + camera[8]
    if z < 1e-4:
        return nowhere
    reach = -camera[11] / z
    x = camera[9] + reach * (camera[0] * u + camera[3] * v + camera[6])
    y = camera[10] + reach * (camera[1] * u + camera[4] * v + camera[7])
    across, down = (x - origin[0]) / cell, (y - origin[1]) / cell
    # As floats: NaN and what is too large for an integer fail here.
    if not (0 <= across < nearest.shape[1] and 0 <= down < nearest.shape[0]):
        return nowhere
    m = nearest[int(down), int(across)]
    left, top = shapes[m, 1], shapes[m, 2]
    if shapes[m, 0] == 1.0:
        dx, dy = x - left, y - top
        far = np.sqrt(dx * dx + dy * dy) + 1e-9
        dx, dy = dx / far, dy / far
        radius = shapes[m, 3]
        return 1, (left + radius * dx, top + radius * dy, 0.0, -dy, dx, 0.0)
    dx, dy = shapes[m, 3] - left, shapes[m, 4] - top
    length = np.sqrt(dx * dx + dy * dy)
    dx, dy = dx / length, dy / length
    along = (x - left) * dx + (y - top) * dy
    inside = 1 if 0.0 <= along <= length else 0
    along = min(max(along, 0.0), length)
    return inside, (left + along * dx, top + along * dy, 0.0, dx, dy, 0.0)


@compiled
def distance_from_place(camera, place, inside, px, py):
    """Distance of a pixel from a place's tangent in the picture, or from the place at an end."""
    a, b, c = pitch_to_camera(camera, place[0], place[1], 0.0)
    if c < 0.3:
        return 1e6
    focal = camera[12]
    ex, ey = px - focal * a / c, py - focal * b / c
    if inside == 0:
        return np.sqrt(ex * ex + ey * ey)
    va = camera[0] * place[3] + camera[1] * place[4]
    vb = camera[3] * place[3] + camera[4] * place[4]
    vc = camera[6] * place[3] + camera[7] * place[4]
    tx, ty = va * c - a * vc, vb * c - b * vc
    length = np.sqrt(tx * tx + ty * ty)
    return abs(tx * ey - ty * ex) / length if length > 1e-12 else np.sqrt(ex * ex + ey * ey)


@compiled
def write_unexplained_paint_cost(
    parameters, points, shapes, nearest, origin, cell, reach, half_diagonal, cost
):
    """Writes the mean truncated distance of the paint to the nearest marking, 0 to 1."""
    for b in range(len(parameters)):
        camera = unpack_camera(parameters[b], half_diagonal)
        total = 0.0
        for n in range(len(points)):
            px, py = ideal_pixel(camera, points[n, 0], points[n, 1])
            inside, place = find_nearest_place(camera, px, py, shapes, nearest, origin, cell)
            if inside < 0:
                total += 1.0
            else:
                total += min(distance_from_place(camera, place, inside, px, py) / reach, 1.0)
            if n + 1 == FIRST and total > HOPELESS * FIRST:
                total = 1.0 * len(points)
                break
        cost[b] = total / len(points)


@compiled
def write_unsupported_markings(
    parameters, samples, spacing, distance, field, center, reach, half_diagonal, result
):  # fmt: skip
    """Writes mean truncated distance of visible markings to paint, their length, and off grass.

    Args:
        distance: To the nearest line-like paint, pixels, shape (H, W).
        field: Whether a pixel shows the field, shape (H, W).
        center: Principal point, pixels.
        result: Cost 0 to 1, length on the field, length elsewhere in the picture, (B, 3).
    """
    height, width = distance.shape
    for b in range(len(parameters)):
        camera = unpack_camera(parameters[b], half_diagonal)
        focal, kappa = camera[12], camera[13]
        total, length, off = 0.0, 0.0, 0.0
        for n in range(len(samples)):
            a, e, c = pitch_to_camera(camera, samples[n, 0], samples[n, 1], 0.0)
            if c < 0.3:
                continue
            px, py = focal * a / c, focal * e / c
            growth = radial_growth_factor(kappa * (px * px + py * py))
            x, y = px * growth + center[0], py * growth + center[1]
            if not (0 <= x < width - 0.5 and 0 <= y < height - 0.5):
                continue
            column, row = int(x + 0.5), int(y + 0.5)
            tx, ty = samples[n, 2], samples[n, 3]
            va, vb, vc = (
                camera[0] * tx + camera[1] * ty,
                camera[3] * tx + camera[4] * ty,
                camera[6] * tx + camera[7] * ty,
            )
            sx, sy = focal * (va * c - a * vc) / (c * c), focal * (vb * c - e * vc) / (c * c)
            weight = spacing * np.sqrt(sx * sx + sy * sy)
            if field[row, column]:
                total += weight * min(distance[row, column] / reach, 1.0)
                length += weight
            else:
                off += weight
        result[b, 0] = total / length if length > 0 else 1.0
        result[b, 1], result[b, 2] = length, off


@compiled
def refine_camera_rows(
    parameters, points, shapes, nearest, origin, cell, scales, mean, sigma, half_diagonal
):  # fmt: skip
    """Moves each camera so that the paint comes to lie on the nearest markings.

    One damped Gauss-Newton step for each of ``scales`` (pixels) with Geman-McClure weights; the
    nearest places are found anew each time. Shapes of mean (B, 8), sigma (8,).
    """
    offset, jacobian = np.empty((1, 2)), np.empty((1, 2, 8))
    H, g = np.empty((8, 8)), np.empty(8)
    for b in range(len(parameters)):
        for scale in scales:
            camera = unpack_camera(parameters[b], half_diagonal)
            g[:] = 0.0
            H[:] = 0.0
            for k in range(8):
                weight = scale * scale / (sigma[k] * sigma[k])
                g[k] = weight * (parameters[b, k] - mean[b, k])
                H[k, k] = weight
            for n in range(len(points)):
                px, py = ideal_pixel(camera, points[n, 0], points[n, 1])
                inside, place = find_nearest_place(camera, px, py, shapes, nearest, origin, cell)
                if inside < 0 or distance_from_place(camera, place, inside, px, py) > 3.0 * scale:
                    continue
                write_residual_row(
                    camera, place, inside == 1, points[n, 0], points[n, 1], offset, jacobian, 0
                )
                squared = offset[0, 0] * offset[0, 0] + offset[0, 1] * offset[0, 1]
                root = 1.0 / (1.0 + squared / (scale * scale))
                w = root * root
                for row in range(2 - inside):
                    # Whole rows, though the lower half alone counts: they are added eight at once.
                    for i in range(8):
                        wj = w * jacobian[0, row, i]
                        g[i] += wj * offset[0, row]
                        for k in range(8):
                            H[i, k] += wj * jacobian[0, row, k]
            take_damped_step(H, g, parameters[b])


@compiled
def take_damped_step(H, g, parameters):
    """Adds the damped step -H^-1 g, by Cholesky decomposition of H's lower half."""
    L = np.zeros((8, 8))
    step = np.empty(8)
    for i in range(8):
        for j in range(i + 1):
            value = H[i, j]
            if i == j:
                value += 1e-3 * value + 1e-9
            for k in range(j):
                value -= L[i, k] * L[j, k]
            if i == j:
                if not value > 0:
                    return
                L[i, i] = np.sqrt(value)
            else:
                L[i, j] = value / L[j, j]
    for i in range(8):
        value = -g[i]
        for k in range(i):
            value -= L[i, k] * step[k]
        step[i] = value / L[i, i]
    for i in range(7, -1, -1):
        value = step[i]
        for k in range(i + 1, 8):
            value -= L[k, i] * step[k]
        step[i] = value / L[i, i]
    for i in range(8):
        parameters[i] += step[i]
