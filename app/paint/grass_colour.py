"""Compiled kernel: which pixels have the colour of grass."""

from __future__ import annotations

from numba import njit

compiled = njit(cache=True, nogil=True, error_model="numpy")

DARKEST = 24
"""Largest channel below which nothing has a colour, grey levels."""
LEAST_SATURATION = 0.13
YELLOWEST, BLUEST = 0.93, -0.833
"""Hues of 56 and 190 degrees, as (difference of the lower two channels) / (largest - least)."""


@compiled
def is_grass(red, green, blue):
    """Whether a colour (grey levels) is that of grass: green, from yellowish to bluish."""
    most = max(red, green, blue)
    least = min(red, green, blue)
    spread = float(most) - float(least)
    if most < DARKEST or spread < LEAST_SATURATION * most:
        return False
    if most == green:
        return True
    if most == red:
        return float(green) - float(blue) >= YELLOWEST * spread
    return float(red) - float(green) <= BLUEST * spread


@compiled
def grass_colour(image, grass):
    """Writes 1 where the picture (H, W, 3; red green blue) is the colour of grass, else 0."""
    for row in range(image.shape[0]):
        for column in range(image.shape[1]):
            red, green, blue = image[row, column, 0], image[row, column, 1], image[row, column, 2]
            grass[row, column] = 1 if is_grass(red, green, blue) else 0
