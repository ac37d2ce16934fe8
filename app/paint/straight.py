"""Straight: the long straight pieces of line-like paint."""

from __future__ import annotations

import cv2
import numpy as np
import numpy.typing as npt

from app.geometry.arrays import FloatArray

NEAR_PX = 2.5
"""Paint that lies so near a piece belongs to it, at 960 wide."""
SHORTEST_PX = 45.0
GAP_PX = 25
LEAST_PIXELS = 3
"""Fewer points have no direction."""


def straight_pieces(line_like: npt.NDArray[np.bool_], most: int) -> FloatArray:
    """The pieces with the most paint, longest first: their ends in pixels, shape (L, 4)."""
    unit = line_like.shape[1] / 960
    rest = line_like.astype(np.uint8)
    found = cv2.HoughLinesP(
        rest, 1, np.pi / 360, int(30 * unit), None, SHORTEST_PX * unit, GAP_PX * unit
    )
    if found is None:
        return np.empty((0, 4))
    rows, columns = np.nonzero(rest)
    paint = np.column_stack([columns, rows]).astype(np.float64)
    free = np.ones(len(paint), dtype=bool)
    ends = found.reshape(-1, 4).astype(np.float64)
    pieces: list[FloatArray] = []
    for _ in range(most):
        support = np.array([np.count_nonzero(free & _along(paint, end, unit)) for end in ends])
        best = int(np.argmax(support))
        if support[best] < LEAST_PIXELS or support[best] < 0.6 * SHORTEST_PX * unit:
            break
        taken = free & _along(paint, ends[best], unit)
        for _ in range(2):
            taken = free & _grown(paint, _fitted(paint[taken]), unit)
            if np.count_nonzero(taken) < LEAST_PIXELS:
                break
        if np.count_nonzero(taken) < LEAST_PIXELS:
            break
        pieces.append(_fitted(paint[taken]))
        free &= ~taken
        ends = ends[support >= 0.4 * SHORTEST_PX * unit]
        if len(ends) == 0:
            break
    return np.array(pieces).reshape(-1, 4)


def _along_and_off(paint: FloatArray, end: FloatArray) -> tuple[FloatArray, FloatArray, float]:
    """Where paint lies along a piece from its start, and how far from it, shapes (N,); its length."""
    start, stop = end[:2], end[2:]
    length = float(np.hypot(*(stop - start)))
    direction = (stop - start) / length
    offset = paint - start
    across = np.abs(offset[:, 0] * direction[1] - offset[:, 1] * direction[0])
    return offset @ direction, across, length


def _along(paint: FloatArray, end: FloatArray, unit: float) -> npt.NDArray[np.bool_]:
    """The paint beside a piece, between its ends."""
    along, across, length = _along_and_off(paint, end)
    near: npt.NDArray[np.bool_] = (across < NEAR_PX * unit) & (along > -2) & (along < length + 2)
    return near


def _grown(paint: FloatArray, end: FloatArray, unit: float) -> npt.NDArray[np.bool_]:
    """The paint along a piece and, on both sides, as far as it goes on without a long gap."""
    along, across, length = _along_and_off(paint, end)
    near = across < NEAR_PX * unit
    places = np.sort(along[near])
    gaps = np.flatnonzero(np.diff(places) > GAP_PX * unit)
    before = gaps[places[gaps] < 0]
    after = gaps[places[gaps + 1] > length]
    low = places[before[-1] + 1] if len(before) else -np.inf
    high = places[after[0]] if len(after) else np.inf
    grown: npt.NDArray[np.bool_] = near & (along >= low) & (along <= high)
    return grown


def _fitted(points: FloatArray) -> FloatArray:
    """Ends of the line through points, by its principal axis, shape (4,)."""
    middle = points.mean(axis=0)
    _, vectors = np.linalg.eigh(np.cov((points - middle).T))
    along = (points - middle) @ vectors[:, 1]
    return np.concatenate(
        [middle + along.min() * vectors[:, 1], middle + along.max() * vectors[:, 1]]
    )
