"""Repeated and blended frames, and freezes: what a slow replay and a standing picture are made of."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from app.geometry.arrays import BoolArray
from app.video.measures import Measured

REPEAT_CHANGE, REPEAT_SHARE = 0.6, 0.12
"""Mean change of a repeated frame, grey levels, and its share of what frames beside it change."""
LEAST_MOVING = 1.0
"""Mean change, grey levels, of frames that move enough for a repeat to be one."""
BESIDE = 12
"""Frames on each side by which it is judged how much a scene moves."""
FREEZE_SECONDS = 0.4
"""Shortest freeze."""
BLEND, BLEND_CHANGE = 0.22, 3.0
"""Of a blended frame: how far it is from the mean of its neighbours, by their distance; and how much
frames change there, for slow motion blends everything."""


@dataclass(frozen=True)
class Freeze:
    """A picture that stands: its frames show what ``first - 1`` shows."""

    first: int
    last: int


def find_repeated_frames(rows: Measured) -> BoolArray:
    """Which frames show the frame before once more, among others that move; shape (N,)."""
    change = rows["change"].astype(np.float64)
    still = np.zeros(len(rows), np.bool_)
    candidates = np.flatnonzero(change < REPEAT_CHANGE)
    for number in candidates[candidates > 0]:
        near = change[max(number - BESIDE, 1) : number + BESIDE + 1]
        moving = float(np.percentile(near, 90))
        still[number] = moving > LEAST_MOVING and change[number] < REPEAT_SHARE * moving
    return still


def find_blended_frames(rows: Measured) -> BoolArray:
    """Which frames are a mix of the frames beside them; shape (N,)."""
    after = np.append(rows["change"][1:], 0.0)
    moves = np.minimum(rows["change"], after) > BLEND_CHANGE
    return np.asarray(moves & (rows["blend"] < BLEND))


def find_freezes(rows: Measured, step: float) -> list[Freeze]:
    """Stretches that stand still, digitally: a camera that rests has more noise than that."""
    least = max(round(FREEZE_SECONDS / step), 3)
    still = rows["change"] < REPEAT_CHANGE
    still[0] = False
    edges = np.flatnonzero(np.diff(np.concatenate([[0], still.astype(np.int8), [0]])))
    found = []
    for first, stop in zip(edges[::2], edges[1::2], strict=True):
        beside = np.concatenate(
            [rows["change"][max(first - BESIDE, 1) : first], rows["change"][stop : stop + BESIDE]]
        )
        if stop - first >= least and len(beside) and np.median(beside) > LEAST_MOVING:
            found.append(Freeze(int(first), int(stop) - 1))
    return found
