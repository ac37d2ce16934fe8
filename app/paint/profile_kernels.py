"""Compiled kernel: where across a projected marking its paint lies, to a fraction of a pixel.

The profile of brightness along the normal is searched for a bright stripe with grass to both
sides; its place is the middle between its two edges, each where the brightness is half way
between the stripe and the grass on that side. That holds for a line of one pixel (where the
blur makes the edges) and for one of twenty, and does not move when one side is brighter.
"""

from __future__ import annotations

import numpy as np
from numba import njit

from app.paint.grass import is_grass

compiled = njit(cache=True, nogil=True, error_model="numpy")

STEP = 0.5
"""Pixels between samples of a profile."""
SIDE_PX, BEYOND_PX = 3.0, 2.5
"""From the middle to where the grass is compared: at least, and beyond half the paint's width."""
ASIDE_PX = 1.3
"""A profile is the mean of three, this far apart along the marking."""
LONGEST = 400
BROADER, BLUR_PX, NARROWER = 1.6, 3.5, 0.4
"""A stripe may be ``BROADER`` times the paint's width and ``BLUR_PX`` more, and not narrower than
``NARROWER`` times it."""
CLOSE = 0.35
"""How much less a stripe at the end of the window counts than one in the middle."""


@compiled
def find_stripes(
    level, image, hidden, pixels, normals, widths, windows, noise, least, offsets, sigmas, strengths
):
    """Writes where across each place the paint lies.

    Args:
        level: Smoothed brightness, float32, shape (H, W).
        image: Red green blue, uint8, shape (H, W, 3).
        hidden: 1 where nothing is believed (people, overlays), uint8, shape (H, W).
        pixels: Where the paint is expected, shape (N, 2).
        normals: Unit normals, shape (N, 2).
        widths: Of the paint, pixels, shape (N,).
        windows: How far to either side it is sought, pixels, shape (N,).
        noise: Standard deviation of the brightness, grey levels.
        least: Least strength, grey levels.
        offsets: Result: from the pixel along the normal, pixels; NaN where there is none, (N,).
        sigmas: Result: standard deviation, pixels, shape (N,).
        strengths: Result: how much brighter than the brighter side, grey levels, shape (N,).
    """
    profile = np.empty(LONGEST)
    for n in range(len(pixels)):
        offsets[n], sigmas[n], strengths[n] = np.nan, np.nan, 0.0
        side = max(SIDE_PX, 0.5 * widths[n] + BEYOND_PX)
        window = windows[n]
        reach = window + side + 1.0
        half = int(reach / STEP) + 1
        if 2 * half + 1 > LONGEST:
            continue
        x, y, nx, ny = pixels[n, 0], pixels[n, 1], normals[n, 0], normals[n, 1]
        if not _write_profile(level, x, y, nx, ny, half, profile):
            continue
        peak = _find_most_prominent_stripe(
            image, hidden, profile, x, y, nx, ny, half, window, side, least
        )
        if peak < 0:
            continue
        _measure_stripe(profile, peak, half, side, widths[n], noise, n, offsets, sigmas, strengths)
        if abs(offsets[n]) > window:
            offsets[n], strengths[n] = np.nan, 0.0


@compiled
def _write_profile(level, x, y, nx, ny, half, profile):
    """Writes the mean brightness along the normal; False where it leaves the picture."""
    height, width = level.shape
    far = half * STEP
    for sign in (-1, 1):
        ex, ey = x + sign * far * nx, y + sign * far * ny
        if not (2.0 <= ex <= width - 3.0 and 2.0 <= ey <= height - 3.0):
            return False
    for k in range(2 * half + 1):
        s = (k - half) * STEP
        total = 0.0
        for aside in (-ASIDE_PX, 0.0, ASIDE_PX):
            px, py = x + s * nx - aside * ny, y + s * ny + aside * nx
            column, row = int(px), int(py)
            u, v = px - column, py - row
            top = level[row, column] + u * (level[row, column + 1] - level[row, column])
            low = level[row + 1, column]
            low += u * (level[row + 1, column + 1] - low)
            total += top + v * (low - top)
        profile[k] = total / 3.0
    return True


@compiled
def _find_most_prominent_stripe(image, hidden, profile, x, y, nx, ny, half, window, side, least):
    """Index of the most prominent stripe within the window; -1 where there is none."""
    apart = int(side / STEP + 0.5)
    inner = int(window / STEP)
    best, peak = 0.0, -1
    for k in range(half - inner, half + inner + 1):
        here = profile[k]
        response = here - max(profile[k - apart], profile[k + apart])
        if response < least:
            continue
        s = (k - half) * STEP
        value = response * (1.0 - CLOSE * (s / window) ** 2)
        if value <= best:
            continue
        if not (
            _is_grass_at(image, hidden, x + (s - side) * nx, y + (s - side) * ny)
            and _is_grass_at(image, hidden, x + (s + side) * nx, y + (s + side) * ny)
            and hidden[int(y + s * ny + 0.5), int(x + s * nx + 0.5)] == 0
        ):
            continue
        best, peak = value, k
    # A stripe that ends the window goes on outside it.
    if peak == half - inner or peak == half + inner:
        return -1
    return peak


@compiled
def _is_grass_at(image, hidden, x, y):
    row, column = int(y + 0.5), int(x + 0.5)
    if hidden[row, column] == 1:
        return False
    return is_grass(image[row, column, 0], image[row, column, 1], image[row, column, 2])


@compiled
def _measure_stripe(profile, peak, half, side, width, noise, n, offsets, sigmas, strengths):
    """Writes place, sigma and strength of the stripe at a peak."""
    apart = int(side / STEP + 0.5)
    low, high = profile[peak - apart], profile[peak + apart]
    top = profile[peak]
    for k in range(peak - apart + 1, peak + apart):
        top = max(top, profile[k])
    left_level, right_level = 0.5 * (top + low), 0.5 * (top + high)
    i = peak
    while i > peak - apart and profile[i] >= left_level:
        i -= 1
    j = peak
    while j < peak + apart and profile[j] >= right_level:
        j += 1
    rise, fall = profile[i + 1] - profile[i], profile[j - 1] - profile[j]
    if rise <= 0.0 or fall <= 0.0:
        return
    left = i + (left_level - profile[i]) / rise
    right = j - (right_level - profile[j]) / fall
    broad = (right - left) * STEP
    if broad > BROADER * width + BLUR_PX or broad < NARROWER * width:
        return
    offsets[n] = (0.5 * (left + right) - half) * STEP
    # Each edge moves by noise over slope; the middle by half of both together.
    slope_left, slope_right = rise / STEP, fall / STEP
    sigmas[n] = 0.5 * noise * np.sqrt(1.0 / slope_left**2 + 1.0 / slope_right**2)
    strengths[n] = top - max(low, high)


@compiled
def drop_outlier_offsets(offsets, marking, around, apart, share):
    """Sets to NaN what its neighbours along the marking do not confirm.

    Args:
        offsets: Of all places, NaN where nothing was found, shape (N,).
        marking: Of each place, shape (N,), increasing.
        around: How many places to either side are neighbours.
        apart: How far the offset of a neighbour may differ, pixels.
        share: Least share of the places around that must have paint at such an offset.
    """
    confirmed = np.zeros(len(offsets), np.bool_)
    for n in range(len(offsets)):
        if np.isnan(offsets[n]):
            continue
        neighbours, agree = 0, 0
        for i in range(max(n - around, 0), min(n + around + 1, len(offsets))):
            if marking[i] == marking[n]:
                neighbours += 1
                if abs(offsets[i] - offsets[n]) <= apart:
                    agree += 1
        confirmed[n] = agree >= share * neighbours
    for n in range(len(offsets)):
        if not confirmed[n]:
            offsets[n] = np.nan
