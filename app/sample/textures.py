"""Textures: noise for grass and grain, and the advertising boards of a match."""

from __future__ import annotations

from functools import lru_cache
from typing import Any

import cv2
import numpy as np
import numpy.typing as npt

from app.sample.surface import BOARD_HEIGHT, TILE

Image = npt.NDArray[np.uint8]
Tile = npt.NDArray[np.float32]

BOARD_PIXELS = 76
PANEL_METRES = 7.6
PANELS = 10
SIZES = 5
# Brands that nobody owns, and their colours (blue, green, red): ground, letters.
BRANDS = (
    ("VELOMAR", (120, 28, 20), (245, 245, 245)),
    ("Nordkap Tea", (238, 238, 236), (40, 90, 20)),
    ("KILNWORKS", (24, 24, 26), (60, 200, 245)),
    ("Otterby Bank", (92, 60, 8), (250, 250, 250)),
    ("SOLENNE", (40, 40, 205), (250, 250, 250)),
    ("glimmr", (225, 120, 30), (255, 255, 255)),
    ("PELICORE", (245, 245, 245), (190, 60, 20)),
    ("Marrow & Finch", (50, 92, 20), (215, 240, 250)),
    ("TRANZEO AIR", (150, 40, 90), (255, 255, 255)),
    ("Hoppkorn", (30, 190, 245), (30, 30, 30)),
    ("ALPENSTROM", (235, 240, 240), (30, 30, 200)),
    ("quibit", (60, 20, 60), (235, 200, 90)),
)


@lru_cache(maxsize=1)
def noise_tiles() -> tuple[Tile, Tile]:
    """Wrapping noise with unit spread: broad patches, and blades of grass."""
    rng = np.random.default_rng(20_260_101)
    coarse = sum(
        weight * _smooth(rng, sigma) for sigma, weight in ((24.0, 0.6), (9.0, 0.5), (3.0, 0.6))
    )
    fine = 0.8 * _smooth(rng, 0.8) + 0.5 * _smooth(rng, 2.2)
    return _unit(np.asarray(coarse)), _unit(np.asarray(fine))


def _smooth(rng: np.random.Generator, sigma: float) -> Tile:
    noise = rng.standard_normal((TILE, TILE)).astype(np.float32)
    margin = int(4 * sigma) + 1
    wrapped = np.pad(noise, margin, mode="wrap")
    blurred = cv2.GaussianBlur(wrapped, (0, 0), sigma)[margin:-margin, margin:-margin]
    return _unit(blurred)


def _unit(tile: npt.NDArray[Any]) -> Tile:
    unit: Tile = ((tile - tile.mean()) / tile.std()).astype(np.float32)
    return unit


@lru_cache(maxsize=8)
def board_atlas(seed: int) -> tuple[Image, npt.NDArray[np.float64]]:
    """The boards of a match at five sizes, one below the other.

    Returns:
        The image, and a row (first row, height, width, length in metres) for each size.
    """
    rng = np.random.default_rng([seed, 0xB0])
    order = rng.permutation(len(BRANDS))[:PANELS]
    width = int(PANEL_METRES / BOARD_HEIGHT * BOARD_PIXELS)
    strip = np.hstack([_panel(*BRANDS[index], width) for index in order])
    sizes, rows, top = [], [], 0
    for level in range(SIZES):
        height, length = BOARD_PIXELS >> level, strip.shape[1] >> level
        small = cv2.resize(strip, (length, height), interpolation=cv2.INTER_AREA)
        padded = np.zeros((height, strip.shape[1], 3), np.uint8)
        padded[:, :length] = small
        sizes.append(padded)
        rows.append((top, height, length, PANEL_METRES * PANELS))
        top += height
    return np.vstack(sizes), np.array(rows, dtype=np.float64)


def _panel(
    text: str, ground: tuple[int, int, int], letters: tuple[int, int, int], width: int
) -> Image:
    panel = np.full((BOARD_PIXELS, width, 3), ground, np.uint8)
    font = cv2.FONT_HERSHEY_DUPLEX if text.isupper() else cv2.FONT_HERSHEY_TRIPLEX
    scale, thickness = 1.75, 5
    (length, height), _ = cv2.getTextSize(text, font, scale, thickness)
    if length > width - 50:
        scale *= (width - 50) / length
        (length, height), _ = cv2.getTextSize(text, font, scale, thickness)
    origin = ((width - length) // 2 + 18, (BOARD_PIXELS + height) // 2)
    cv2.putText(panel, text, origin, font, scale, letters, thickness, cv2.LINE_AA)
    cv2.circle(panel, (origin[0] - 34, BOARD_PIXELS // 2), 17, letters, 6, cv2.LINE_AA)
    cv2.line(panel, (0, 0), (0, BOARD_PIXELS), (20, 20, 20), 3)
    return panel
