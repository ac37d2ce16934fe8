"""Films with known shots: clips joined by cuts, dissolves, wipes, fades and flying logos.

The clips are pictures of real recordings or rendered ones; what happens in a clip (a whip pan, a
flash, a freeze) is added to its pictures before it is joined.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path

import cv2
import numpy as np

from app.sample.recording import draw_logo
from tests.videos import write_pictures

Clip = list[np.ndarray]
"""Pictures of one size, blue green red, one after the other."""


@dataclass(frozen=True)
class Join:
    """How a clip follows another.

    Attributes:
        kind: ``cut``, ``dissolve``, ``wipe``, ``fade`` (through black) or ``logo``.
        frames: Length of what lies between the two; of a cut 0.
        turn: Of a wipe: the direction in which its edge moves, degrees. Of a logo: which one.
    """

    kind: str
    frames: int = 0
    turn: int = 0


@dataclass(frozen=True)
class KnownShot:
    """A shot of a film: its first and last frame, and how it is entered."""

    first: int
    last: int
    entered_by: str


def join(clips: Sequence[Clip], joins: Sequence[Join]) -> tuple[Clip, list[KnownShot]]:
    """The pictures of a film, and its shots.

    What lies between two clips is made of their last and first pictures, so that they get shorter.
    """
    film: Clip = []
    shots = []
    first, entered_by = 0, "start"
    for number, clip in enumerate(clips):
        before = joins[number - 1].frames if number else 0
        after = joins[number].frames if number < len(joins) else 0
        film += clip[before : len(clip) - after]
        shots.append(KnownShot(first, len(film) - 1, entered_by))
        if number < len(joins):
            if after:
                film += _between(clip[-after:], clips[number + 1][:after], joins[number])
            first = len(film)
            entered_by = {"logo": "wipe"}.get(joins[number].kind, joins[number].kind)
    return film, shots


def _between(old: Clip, new: Clip, how: Join) -> Clip:
    make = {"dissolve": _dissolved, "wipe": _wiped, "fade": _faded, "logo": _under_logo}[how.kind]
    shares = [(number + 1) / (how.frames + 1) for number in range(how.frames)]
    return [make(a, b, share, how.turn) for a, b, share in zip(old, new, shares, strict=True)]


def _dissolved(old: np.ndarray, new: np.ndarray, share: float, _turn: int) -> np.ndarray:
    return cv2.addWeighted(old, 1 - share, new, share, 0)


def _faded(old: np.ndarray, new: np.ndarray, share: float, _turn: int) -> np.ndarray:
    picture, light = (old, 1 - 2 * share) if share < 0.5 else (new, 2 * share - 1)
    return (picture * max(light, 0.0)).astype(np.uint8)


def _wiped(old: np.ndarray, new: np.ndarray, share: float, turn: int) -> np.ndarray:
    height, width = old.shape[:2]
    columns, rows = np.meshgrid(np.linspace(-1, 1, width), np.linspace(-1, 1, height))
    along = columns * math.cos(math.radians(turn)) + rows * math.sin(math.radians(turn))
    reach = abs(math.cos(math.radians(turn))) + abs(math.sin(math.radians(turn)))
    return np.where((along < (2 * share - 1) * reach)[..., None], new, old)


def _under_logo(old: np.ndarray, new: np.ndarray, share: float, turn: int) -> np.ndarray:
    """A logo flies in, covers everything and flies on; behind it the picture changes."""
    return draw_logo((old if share < 0.5 else new).copy(), share, turn)


def flash(clip: Clip, at: int, frames: int = 2, light: float = 2.2) -> Clip:
    """The clip with a camera's flash in it."""
    lit = list(clip)
    for number in range(at, min(at + frames, len(clip))):
        brighter = clip[number].astype(np.float32) * light + 40
        lit[number] = np.clip(brighter, 0, 255).astype(np.uint8)
    return lit


def freeze(clip: Clip, at: int, frames: int, skip: bool = False) -> Clip:
    """The clip with a picture that stands; ``skip``: what it showed meanwhile is missing."""
    return clip[:at] + [clip[at]] * frames + clip[at + (frames if skip else 0) :]


def slow(clip: Clip, times: int, blend: bool = False) -> Clip:
    """The clip in slow motion: each picture so many times, or blended with the next one."""
    made = []
    for one, other in zip(clip, [*clip[1:], clip[-1]], strict=True):
        for step in range(times):
            share = step / times if blend else 0.0
            made.append(cv2.addWeighted(one, 1 - share, other, share, 0))
    return made


def whip(still: np.ndarray, size: tuple[int, int], frames: int, speed: float) -> Clip:
    """A camera that looks at a wide picture, whips to the other side within a few frames, and rests.

    Args:
        still: The picture; wider than ``size``.
        size: Width and height of the clip.
        frames: Of the clip.
        speed: Widths of ``size`` that go by in a frame where it is quickest.
    """
    width, height = size
    scale = height / still.shape[0]
    wide = cv2.resize(still, None, fx=scale * 2.4, fy=scale * 2.4, interpolation=cv2.INTER_AREA)
    top, reach = (wide.shape[0] - height) // 2, wide.shape[1] - width - 1
    steepness = 4 * speed * width / reach
    places = reach / (1 + np.exp(-steepness * (np.arange(frames + 1) - frames / 2)))
    made = []
    for one, other in pairwise(places):
        shutter = np.linspace(one, one + (other - one) / 2, 8)
        shown = [wide[top : top + height, int(left) : int(left) + width] for left in shutter]
        made.append(np.mean(shown, axis=0).astype(np.uint8))
    return made


def rendered(seed: int, frames: int, size: tuple[int, int] = (320, 180)) -> Clip:
    """A scene of its own: a pitch or a stand, people in two colours that run, a camera that pans."""
    dice = np.random.default_rng(seed)
    width, height = size
    wide = 2 * width
    horizon = int(height * dice.uniform(0.1, 0.6))
    scene = np.empty((height, wide, 3), np.uint8)
    crowd = dice.integers(30, 200, (height // 6 + 1, wide // 6 + 1, 3), np.uint8)
    scene[:] = cv2.resize(crowd, (wide, height), interpolation=cv2.INTER_NEAREST)
    grass = np.array([dice.uniform(30, 70), dice.uniform(110, 160), dice.uniform(40, 90)])
    stripes = 1 + 0.12 * (np.arange(wide) // int(dice.integers(30, 70)) % 2)
    scene[horizon:] = np.clip(grass * stripes[:, None], 0, 255)
    cv2.line(scene, (0, horizon + 12), (wide, horizon + 30), (235, 235, 235), 2)
    cv2.line(scene, (wide // 2, horizon), (wide // 3, height), (235, 235, 235), 2)
    colours = dice.integers(0, 255, (2, 3)).tolist()
    tall = int(height * dice.choice([0.08, 0.12, 0.35, 0.6]))
    places = dice.uniform((0, horizon), (wide, height), (14, 2))
    speeds = dice.uniform(-2, 2, (14, 2)) * tall / 20
    pan = dice.uniform(-1.5, 1.5)
    made = []
    for number in range(frames):
        picture = scene.copy()
        for who, (x, y) in enumerate(places + number * speeds):
            top_left = (int(x) % wide, int(y) - tall)
            cv2.rectangle(
                picture, top_left, (top_left[0] + tall // 3, int(y)), colours[who % 2], -1
            )
        left = int(np.clip(width / 2 + number * pan, 0, width))
        made.append(np.ascontiguousarray(picture[:, left : left + width]))
    return made


def write_film(path: Path, film: Clip, codec: str = "mp4v", rate: float = 25) -> Path:
    """The film as a file."""
    return write_pictures(path, codec, film, rate)
