"""Hard cuts: frames that show nothing of the frame before, told from flashes and fast motion.

A frame behind a cut is no moved picture of the frame before (``residual``) and has other colours
(``histogram``). Both at once, and in no frame beside it, is a cut; fast motion and whip pans last
longer, and after a flash the picture is what it was. Where a frame or two of a foreign picture lie
between two shots, both its ends are cuts.
"""

from __future__ import annotations

from itertools import pairwise
from typing import Any

import numpy as np

from app.geometry.arrays import BoolArray, FloatArray, IntArray
from app.video.measures import Measured, convert_lags_to_frames

LEAST_CHANGE, LEAST_RESIDUAL = 0.12, 0.45
"""Of a cut: product of residual and histogram, and residual alone."""
MOST_BESIDE, BESIDE = 0.4, 2
"""Share of a cut's change that a frame so many frames beside it may have."""
DARK = 20.0
"""Mean grey level: what comes out of the dark, or goes into it, is a fade."""
FLASH_SECONDS = 0.28
"""Longest flash."""
MOST_RETURN = 0.6
"""Share of a change that is left once a flash is over."""
FLASHED = 0.1
"""Share of a change that is left behind a flash in which nothing moves far."""
LEAST_FADING = 0.1
"""Share of that change by which a flash fades from frame to frame at its end."""


def combine_change_measures(rows: Measured) -> FloatArray:
    """How much each frame is another picture than the one before, shape (N,)."""
    return np.asarray(rows["residual"] * rows["histogram"], np.float64)


def find_hard_cuts(rows: Measured, step: float) -> tuple[IntArray, BoolArray]:
    """First frames behind hard cuts, and which frames are lit by a flash.

    Args:
        rows: Measures of the frames.
        step: Usual time between two frames, seconds.

    Returns:
        Numbers of frames, ascending; shape (N,).
    """
    change, cells = combine_change_measures(rows), rows["cells"]
    reach = max(round(FLASH_SECONDS / step), 2)
    flashed = np.zeros(len(rows), np.bool_)
    found = []
    candidates = np.flatnonzero((change > LEAST_CHANGE) & (rows["residual"] > LEAST_RESIDUAL))
    for number in candidates.tolist():
        if cells[number - 1 : number + 1].mean(axis=(1, 2, 3)).min() < DARK:
            continue
        if (until := _find_flash_end(cells, number, reach)) is not None:
            # A picture that goes dark and comes back is no flash, and no cut either.
            flashed[number:until] = cells[number].mean() > cells[number - 1].mean()
            continue
        if _has_flash_ended(cells, number, reach) or flashed[number - 1]:
            continue
        near = slice(max(number - BESIDE, 0), number + BESIDE + 1)
        beside = np.where(flashed[near], 0.0, change[near])
        beside[number - near.start] = 0.0
        if beside.max() < MOST_BESIDE * change[number]:
            found.append(number)
    for first, last in pairwise(candidates.tolist()):
        if last - first <= BESIDE and _has_foreign_frames(rows, change, first, last, step):
            found += [first, last]
    return np.unique(np.array(found, np.int64)), flashed


def _has_foreign_frames(
    rows: Measured, change: FloatArray, first: int, last: int, step: float
) -> bool:
    """Whether two changes are the ends of a foreign picture between two shots, which show nothing of each other."""
    before = first - 1
    away = _mean_cell_difference(rows["cells"], before, np.array([first, last]))
    if away[1] < FLASHED * away[0]:
        return False
    lags = convert_lags_to_frames(1 / step)
    at, lag = next((at, lag) for at, lag in enumerate(lags) if before + lag >= last)
    after = before + lag
    if after >= len(rows) or rows["cells"][[before, last]].mean(axis=(1, 2, 3)).min() < DARK:
        return False
    beside = change[max(first - BESIDE, 0) : after + 1].copy()
    beside[[first - after - 1, last - after - 1]] = 0.0
    if beside.max() >= MOST_BESIDE * change[[first, last]].min():
        return False
    apart = float(rows["apart"][after, at])
    return apart > LEAST_RESIDUAL and apart * rows["recoloured"][after, at] > LEAST_CHANGE


def _mean_cell_difference(cells: Any, one: Any, others: Any) -> FloatArray:
    """Mean difference of the cells of a frame from those of others, grey levels."""
    # Of a few frames at a time: those of a whole match would take 120 MB.
    return np.asarray(np.abs(cells[others].astype(np.int16) - cells[one]).mean(axis=(1, 2, 3)))


def _find_flash_end(cells: Any, number: int, reach: int) -> int | None:
    """First frame after a flash that begins with a frame; None: it begins none."""
    after = np.arange(number, min(number + reach + 1, len(cells)))
    away = _mean_cell_difference(cells, number - 1, after)
    back = np.flatnonzero(away < MOST_RETURN * away[0])
    if not len(back):
        return None
    fading = away[back[0] : -1] - away[back[0] + 1 :] > LEAST_FADING * away[0]
    return int(after[back[0]] + np.argmin([*fading, False]))


def _has_flash_ended(cells: Any, number: int, reach: int) -> bool:
    """Whether a frame is like one shortly before the frame before it: a flash has ended."""
    before = np.arange(number - 1, max(number - 2 - reach, -1), -1)
    away = _mean_cell_difference(cells, number, before)
    return bool((away < MOST_RETURN * away[0]).any())
