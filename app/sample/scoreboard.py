"""Scoreboard: the small caption that tells a broadcast still from a photograph."""

from __future__ import annotations

import cv2
import numpy as np
import numpy.typing as npt

from app.sample.fixture import Fixture
from app.sample.look import Colour

Image = npt.NDArray[np.uint8]
LEFT, TOP, HEIGHT = 36, 30, 30
FONT = cv2.FONT_HERSHEY_DUPLEX
DARK = (44, 34, 28)
LIGHT = (240, 240, 240)


def draw_scoreboard(image: Image, fixture: Fixture, game_time: str, is_main: bool) -> None:
    """Teams, score and time on the main camera; a small mark on replays."""
    if not is_main:
        _draw_text_cell(image, LEFT, 84, "REPLAY", (36, 36, 190), LIGHT)
        return
    look = fixture.look
    clock = game_time.split(" - ")[-1]
    home, away = fixture.score
    x = LEFT
    x = _draw_text_cell(image, x, 66, clock, LIGHT, DARK)
    x = _draw_team(image, x, fixture.home, look.home.shirt)
    x = _draw_text_cell(image, x, 62, f"{home} - {away}", (96, 60, 24), LIGHT)
    _draw_team(image, x, fixture.away, look.away.shirt)


def _draw_team(image: Image, x: int, name: str, colour: Colour) -> int:
    cv2.rectangle(image, (x, TOP), (x + 5, TOP + HEIGHT), colour, -1)
    return _draw_text_cell(image, x + 6, 58, name[:3].upper(), DARK, LIGHT)


def _draw_text_cell(
    image: Image, x: int, width: int, text: str,
    ground: tuple[int, int, int], ink: tuple[int, int, int],
) -> int:  # fmt: skip
    cv2.rectangle(image, (x, TOP), (x + width - 1, TOP + HEIGHT), ground, -1)
    (length, height), _ = cv2.getTextSize(text, FONT, 0.55, 1)
    origin = (x + (width - length) // 2, TOP + (HEIGHT + height) // 2)
    cv2.putText(image, text, origin, FONT, 0.55, ink, 1, cv2.LINE_AA)
    return x + width
