"""Kinds of shots, seen in a few frames of each: a camera that paint proposes tells the main one."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np
import numpy.typing as npt

from app.errors import GeometryError
from app.paint.grass import field_of_play
from app.paint.propose import propose

ShotKind = Literal["main", "replay", "closeup", "other"]

LOOKED_AT = (0.2, 0.5, 0.8)
"""Of a shot, where frames are looked at."""
LEAST_MAIN = 2
"""Frames with a proposed camera in a main shot; of a shot that is too short for three, one."""
SHORT_SECONDS = 1.0
GRASS_MAIN, GRASS_CLOSEUP = 0.45, 0.08
"""Share of grass in which a main camera is sought, and less than that is no pitch."""


@dataclass(frozen=True)
class LookedAt:
    """What a frame shows.

    Attributes:
        grass: Share of the picture.
        proposed: Whether the paint says where the camera stands.
    """

    grass: float
    proposed: bool


def frames_that_tell_kind(first: int, last: int, seconds: float) -> list[int]:
    """Numbers of the frames of a shot that tell its kind."""
    places = LOOKED_AT if seconds >= SHORT_SECONDS else (0.5,)
    return sorted({first + round(place * (last - first)) for place in places})


def look_at(image: npt.NDArray[np.uint8]) -> LookedAt:
    """What a frame shows.

    Args:
        image: Red green blue, shape (H, W, 3).
    """
    grass = float(field_of_play(image).mean())
    if grass < GRASS_MAIN:
        return LookedAt(grass, False)
    try:
        return LookedAt(grass, propose(image).outcome == "proposed")
    except (GeometryError, np.linalg.LinAlgError):
        return LookedAt(grass, False)


def kind_of(looks: Sequence[LookedAt]) -> ShotKind:
    """Kind of a shot by what its frames show; whether it is a replay is not told by that."""
    proposed = sum(look.proposed for look in looks)
    if proposed >= min(LEAST_MAIN, len(looks)):
        return "main"
    grass = float(np.median([look.grass for look in looks])) if looks else 0.0
    return "closeup" if grass >= GRASS_CLOSEUP else "other"
