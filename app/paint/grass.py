"""Grass: which part of a picture shows the field of play.

Everything that reads paint asks this first: white is everywhere in a stadium, and paint is what
is white with grass to both sides of it.
"""

from __future__ import annotations

import cv2
import numpy as np
import numpy.typing as npt
from numba import njit

from app.geometry.arrays import BoolArray

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
def mark_grass_colour(image, grass):
    """Writes 1 where the picture (H, W, 3; red green blue) is the colour of grass, else 0."""
    for row in range(image.shape[0]):
        for column in range(image.shape[1]):
            red, green, blue = image[row, column, 0], image[row, column, 1], image[row, column, 2]
            grass[row, column] = 1 if is_grass(red, green, blue) else 0


Image = npt.NDArray[np.uint8]
Mask = npt.NDArray[np.uint8]

WORK_WIDTH = 480
"""Pixels: the field has no fine detail, and a small picture is quick to sort."""
LEAST_SHARE = 0.08
"""Of the picture; less grass than this is a close-up, a crowd or another place."""
PIECE_SHARE = 0.10
"""Of the largest piece of grass: smaller pieces are no part of the field."""
GREY_SPREAD, DARK_LEVEL, PALE_LEVEL = 12.0, 28.0, 215.0
"""Grey levels: mean distance of the channels, brightness of a night and of a snow picture."""


def find_field_of_play(image: Image) -> BoolArray:
    """Where the picture shows the field of play, lines and people on it included.

    Args:
        image: Red green blue, shape (H, W, 3).

    Returns:
        Shape (H, W); nowhere true where there is too little grass, see ``explain_missing_field``.
    """
    height, width = image.shape[:2]
    small = _downscale(image)
    grass: Mask = np.empty(small.shape[:2], np.uint8)
    mark_grass_colour(small, grass)
    # Lines and blades divide the grass, specks of green in the stands are none.
    grass = _apply_morphology(grass, cv2.MORPH_OPEN, 3)
    grass = _apply_morphology(grass, cv2.MORPH_CLOSE, 5)
    count, labels, stats, _ = cv2.connectedComponentsWithStats(grass, connectivity=4)
    areas = stats[1:count, cv2.CC_STAT_AREA]
    if not len(areas) or areas.max() < LEAST_SHARE * grass.size:
        return np.zeros((height, width), np.bool_)
    kept = np.flatnonzero(np.append(False, areas >= PIECE_SHARE * areas.max()))
    chosen: Mask = np.isin(labels, kept).astype(np.uint8)
    # A near line is broader than the kernel above.
    chosen = _apply_morphology(chosen, cv2.MORPH_CLOSE, 9)
    outlines, _ = cv2.findContours(chosen, cv2.RETR_EXTERNAL, cv2.CHAIN_APPROX_SIMPLE)
    cv2.drawContours(chosen, outlines, -1, 1, cv2.FILLED)
    if chosen.shape != (height, width):
        size = (width, height)
        chosen = np.asarray(cv2.resize(chosen, size, interpolation=cv2.INTER_NEAREST), np.uint8)
    return chosen.astype(np.bool_)


def explain_missing_field(image: Image, field: BoolArray) -> str | None:
    """Why a picture has no field of play, as a sentence; None where it has one.

    Args:
        image: Red green blue, shape (H, W, 3).
        field: What ``find_field_of_play`` found in it, shape (H, W).
    """
    if field.any():
        return None
    small = _downscale(image).astype(np.float64)
    levels = small.mean(axis=2)
    if float(np.ptp(small, axis=2).mean()) < GREY_SPREAD:
        if levels.mean() > PALE_LEVEL:
            return "the picture is nearly white: no grass is seen"
        return "the picture has no colours: grass cannot be recognised"
    if float(levels.mean()) < DARK_LEVEL:
        return "the picture is too dark: no grass is seen"
    return "no field of play is seen: too little of the picture is grass"


def _apply_morphology(mask: Mask, operation: int, size: int) -> Mask:
    return np.asarray(cv2.morphologyEx(mask, operation, np.ones((size, size), np.uint8)), np.uint8)


def _downscale(image: Image) -> Image:
    height, width = image.shape[:2]
    if width <= WORK_WIDTH:
        return np.ascontiguousarray(image)
    rows = max(round(height * WORK_WIDTH / width), 1)
    # Of each block of a large picture a pixel is enough, and averaging is most of the time.
    step = max(width // (3 * WORK_WIDTH), 1)
    image = np.ascontiguousarray(image[::step, ::step])
    return np.asarray(cv2.resize(image, (WORK_WIDTH, rows), interpolation=cv2.INTER_AREA))
