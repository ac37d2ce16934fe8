"""Pictures of balls on grass, drawn with as little as possible: soft discs, noise, and whatever lies about."""

from __future__ import annotations

from collections.abc import Iterable
from itertools import pairwise
from pathlib import Path

import cv2
import numpy as np

from app.video.frames import Image
from tests.videos import write_pictures

FINE = 8
"""Parts of a pixel that are drawn."""
FRAMES, SIZE = 30, (320, 180)
"""Of the film."""
WALL = range(12, 15)
"""Frames of the film in which nobody sees the ball."""


def place(frame: int) -> tuple[float, float]:
    """Where the ball of the film is, pixels."""
    return 60 + 6.0 * frame, 50 + 2.0 * frame


def write_film(path: Path) -> Path:
    """A ball on its way over grass, hidden for three frames."""
    ground, pictures = grass(*SIZE), []
    for frame in range(FRAMES):
        picture = drawn([(*place(frame), 9.0)], size=SIZE, ground=ground, noise=2, seed=frame)
        if frame in WALL:
            picture[30:130, 115:160] = (130, 40, 50)
        pictures.append(np.ascontiguousarray(picture[:, :, ::-1]))
    return write_pictures(path, "MJPG", pictures)


def grass(width: int, height: int, seed: int = 3) -> Image:
    """Grass with marks that a camera's motion can be told by, shape (H, W, 3)."""
    dice = np.random.default_rng(seed)
    coarse = dice.normal(0, 1, (height // 6 + 1, width // 6 + 1)).astype(np.float32)
    tone = cv2.resize(coarse, (width, height), interpolation=cv2.INTER_CUBIC)
    picture = np.array([60.0, 120.0, 55.0]) + 9.0 * tone[..., None]
    return np.clip(picture, 0, 255).astype(np.uint8)


def drawn(
    balls: Iterable[tuple[float, float, float]],
    *,
    size: tuple[int, int] = (120, 100),
    ground: Image | None = None,
    noise: float = 3.0,
    seed: int = 0,
) -> Image:
    """A picture with white balls.

    Args:
        balls: Centre and diameter of each, pixels; several share the light, as one that moves does.
        size: Width and height.
        ground: What is behind them.
        noise: Standard deviation of each pixel.
        seed: Of the noise.
    """
    width, height = size
    picture = np.tile(np.array([60.0, 120.0, 55.0]), (height, width, 1))
    if ground is not None:
        picture = ground.astype(float)
    together = list(balls)
    places = {(round(x), round(y)) for x, y, _ in together}
    share = 1 / len(together) if len(places) > 1 and _touch(together) else 1.0
    cover = np.zeros((height, width))
    for x, y, diameter in together:
        cover += share * _disc(width, height, x, y, diameter)
    cover = np.clip(cover, 0, 1)[..., None]
    picture = picture * (1 - cover) + cover * (235, 236, 230)
    picture += np.random.default_rng(seed).normal(0, noise, picture.shape)
    return np.clip(picture, 0, 255).round().astype(np.uint8)


def _touch(balls: list[tuple[float, float, float]]) -> bool:
    """Whether balls are one that moved: each begins within the one before."""
    return all(np.hypot(a[0] - b[0], a[1] - b[1]) < 1 for a, b in pairwise(balls))


def _disc(width: int, height: int, x: float, y: float, diameter: float) -> np.ndarray:
    reach = int(diameter) + 2
    left, top = int(x) - reach, int(y) - reach
    steps = (np.arange(2 * reach * FINE) + 0.5) / FINE - 0.5
    inside = np.hypot(left + steps[None] - x, top + steps[:, None] - y) <= diameter / 2
    small = inside.reshape(2 * reach, FINE, 2 * reach, FINE).mean(axis=(1, 3))
    whole = np.zeros((height + 4 * reach, width + 4 * reach))
    whole[top + 2 * reach : top + 4 * reach, left + 2 * reach : left + 4 * reach] = small
    return whole[2 * reach : 2 * reach + height, 2 * reach : 2 * reach + width]
