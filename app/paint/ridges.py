"""Ridges: what looks like a painted line in the whole picture, without any camera, and its long straight pieces."""

from __future__ import annotations

import cv2
import numpy as np
import numpy.typing as npt
from numba import njit

from app.geometry.arrays import BoolArray, FloatArray
from app.paint.grass import is_grass

Image = npt.NDArray[np.uint8]
Strength = npt.NDArray[np.float32]

WORK_WIDTH = 960
"""Pixels: wider pictures are looked at in this width, where a line is a few pixels broad."""
BLUR_PX = 1.2
STRONGEST_PERCENT = 93.0
"""Percentile of the strength on the field above which a ridge counts."""
LEAST_STRENGTH = 1.0
"""Grey levels per square pixel below which nothing is a ridge."""
LEAST_LENGTH_PX = 22.0
BROADEST_PX = 8.0
"""Of what counts as a line, pixels of ``WORK_WIDTH``."""
SIDE_PX = 5.0
"""Where grass is looked for to both sides."""


def find_line_like_pixels(image: Image, field: BoolArray) -> BoolArray:
    """The thin pixels of everything on the field that looks like a painted line.

    Args:
        image: Red green blue, shape (H, W, 3).
        field: The field of play, shape (H, W).

    Returns:
        Shape (H, W). In a picture wider than ``WORK_WIDTH`` the pixels do not touch: there is
        one for each pixel of the smaller picture.
    """
    return np.asarray(measure_line_strength(image, field) > 0)


def measure_line_strength(image: Image, field: BoolArray) -> Strength:
    """The same with the strength of each pixel, grey levels per square pixel; 0 elsewhere."""
    height, width = field.shape
    full = np.zeros((height, width), np.float32)
    if not field.any():
        return full
    small, inside = _resize_to_work_size(image, field)
    thin = _measure_thin_lines(small, inside, small.shape[1] / WORK_WIDTH)
    if small.shape[:2] == (height, width):
        return thin
    rows, columns = np.nonzero(thin)
    to = (
        _to_full_size_pixels(rows, height, len(small)),
        _to_full_size_pixels(columns, width, small.shape[1]),
    )
    full[to] = thin[rows, columns]
    return full


def _resize_to_work_size(image: Image, field: BoolArray) -> tuple[Image, npt.NDArray[np.uint8]]:
    height, width = field.shape
    inside = field.astype(np.uint8)
    if width <= WORK_WIDTH:
        return np.ascontiguousarray(image), inside
    size = (WORK_WIDTH, max(round(height * WORK_WIDTH / width), 1))
    small = cv2.resize(image, size, interpolation=cv2.INTER_AREA)
    near = cv2.resize(inside, size, interpolation=cv2.INTER_NEAREST)
    return np.asarray(small, np.uint8), np.asarray(near, np.uint8)


def _to_full_size_pixels(
    places: npt.NDArray[np.int64], size: int, small: int
) -> npt.NDArray[np.int64]:
    """Pixels of the full picture at the centres of those of the small one."""
    return np.asarray(((places + 0.5) * size / small).astype(np.int64))


def _measure_thin_lines(image: Image, inside: npt.NDArray[np.uint8], unit: float) -> Strength:
    """As ``measure_line_strength``, for a picture in which lengths are ``unit`` times those above."""
    # Paint is bright in all channels; shirts and boards rarely are.
    red, green, blue = cv2.split(image)
    level = cv2.GaussianBlur(cv2.min(red, cv2.min(green, blue)).astype(np.float32), (0, 0), BLUR_PX)
    strength = np.empty(inside.shape, np.float32)
    across = np.empty(inside.shape, np.uint8)
    side = max(SIDE_PX * unit, 3.0)
    ridge_strength(level, image, inside, side, LEAST_STRENGTH, strength, across)
    limit = max(_strength_percentile(strength, inside), LEAST_STRENGTH)
    strong = strength > limit
    thin = np.empty(inside.shape, np.bool_)
    thin_ridges(strength, across, strong, thin)
    count, labels = cv2.connectedComponents(strong.view(np.uint8), connectivity=8)
    crest = np.flatnonzero(thin)
    pieces = labels.ravel()[crest]
    lengths = np.bincount(pieces, minlength=count)
    areas = np.bincount(labels.ravel()[np.flatnonzero(strong)], minlength=count)
    line = lengths >= LEAST_LENGTH_PX * unit
    line &= areas <= max(BROADEST_PX * unit, 3.5) * lengths
    kept = crest[line[pieces]]
    lines = np.zeros(inside.shape, np.float32)
    lines.flat[kept] = strength.flat[kept]
    return lines


def _strength_percentile(strength: npt.NDArray[np.float32], inside: npt.NDArray[np.uint8]) -> float:
    """Of the strength on the field, from every third pixel."""
    values = strength[::3, ::3][inside[::3, ::3] > 0]
    return float(np.percentile(values, STRONGEST_PERCENT)) if len(values) else np.inf


NEAR_PX = 2.5
"""Paint that lies so near a piece belongs to it, at 960 wide."""
SHORTEST_PX = 45.0
GAP_PX = 25
LEAST_PIXELS = 3
"""Fewer points have no direction."""


def find_straight_pieces(line_like: npt.NDArray[np.bool_], most: int) -> FloatArray:
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
    beside = np.array([_find_paint_beside_piece(paint, end, unit) for end in ends])
    support = np.count_nonzero(beside, axis=1)
    pieces: list[FloatArray] = []
    for _ in range(most):
        best = int(np.argmax(support))
        if support[best] < LEAST_PIXELS or support[best] < 0.6 * SHORTEST_PX * unit:
            break
        taken = free & beside[best]
        for _ in range(2):
            taken = free & _extend_piece(paint, _fit_segment(paint[taken]), unit)
            if np.count_nonzero(taken) < LEAST_PIXELS:
                break
        if np.count_nonzero(taken) < LEAST_PIXELS:
            break
        pieces.append(_fit_segment(paint[taken]))
        free &= ~taken
        support = support - np.count_nonzero(beside[:, taken], axis=1)
    return np.array(pieces).reshape(-1, 4)


def measure_along_piece(paint: FloatArray, end: FloatArray) -> tuple[FloatArray, FloatArray, float]:
    """Where paint lies along a piece from its start, and how far from it, shapes (N,); its length."""
    start, stop = end[:2], end[2:]
    length = float(np.hypot(*(stop - start)))
    direction = (stop - start) / length
    offset = paint - start
    across = np.abs(offset[:, 0] * direction[1] - offset[:, 1] * direction[0])
    return offset @ direction, across, length


def _find_paint_beside_piece(
    paint: FloatArray, end: FloatArray, unit: float
) -> npt.NDArray[np.bool_]:
    """The paint beside a piece, between its ends."""
    along, across, length = measure_along_piece(paint, end)
    near: npt.NDArray[np.bool_] = (across < NEAR_PX * unit) & (along > -2) & (along < length + 2)
    return near


def _extend_piece(paint: FloatArray, end: FloatArray, unit: float) -> npt.NDArray[np.bool_]:
    """The paint along a piece and, on both sides, as far as it goes on without a long gap."""
    along, across, length = measure_along_piece(paint, end)
    near = across < NEAR_PX * unit
    places = np.sort(along[near])
    gaps = np.flatnonzero(np.diff(places) > GAP_PX * unit)
    before = gaps[places[gaps] < 0]
    after = gaps[places[gaps + 1] > length]
    low = places[before[-1] + 1] if len(before) else -np.inf
    high = places[after[0]] if len(after) else np.inf
    grown: npt.NDArray[np.bool_] = near & (along >= low) & (along <= high)
    return grown


def _fit_segment(points: FloatArray) -> FloatArray:
    """Ends of the line through points, by its principal axis, shape (4,)."""
    middle = points.mean(axis=0)
    _, vectors = np.linalg.eigh(np.cov((points - middle).T))
    along = (points - middle) @ vectors[:, 1]
    return np.concatenate(
        [middle + along.min() * vectors[:, 1], middle + along.max() * vectors[:, 1]]
    )


compiled = njit(cache=True, nogil=True, error_model="numpy")

FLAT = 0.6
"""Largest share that the bend along a ridge may have in the bend across it."""
STEPS = ((0, 1), (1, 1), (1, 0), (1, -1))
"""Row and column to the neighbour across a ridge: across the columns, diagonal, ..."""


@compiled
def ridge_strength(level, image, inside, side, least, strength, across):
    """Strength of the bright ridge at each pixel, and the direction across it.

    Args:
        level: Smoothed brightness, float32, shape (H, W).
        image: Red green blue, shape (H, W, 3).
        inside: 1 on the field of play, shape (H, W).
        side: Where grass is looked for to both sides, pixels.
        least: Strength from which on a ridge is looked at.
        strength: Result: the bend across, grey levels per square pixel; 0 where there is no ridge.
        across: Result: index into ``STEPS``.
    """
    height, width = level.shape
    strength[:] = 0.0
    across[:] = 0
    # A bend across of b is with one along of FLAT b at most, either way.
    bent, folded, flattest = FLAT / (1.0 + FLAT) ** 2, -FLAT / (1.0 - FLAT) ** 2, FLAT - 1.0
    bends = np.empty(width)
    for y in range(1, height - 1):
        # Nothing branches here, so that several pixels are worked out at once.
        for x in range(1, width - 1):
            here = 2.0 * level[y, x]
            xx = level[y, x + 1] + level[y, x - 1] - here
            bends[x] = xx + (level[y + 1, x] + level[y - 1, x] - here)
        for x in range(1, width - 1):
            both = bends[x]
            if both > flattest * least or inside[y, x] == 0:
                continue
            here = 2.0 * level[y, x]
            xx = level[y, x + 1] + level[y, x - 1] - here
            yy = level[y + 1, x] + level[y - 1, x] - here
            xy = 0.25 * (
                level[y + 1, x + 1]
                + level[y - 1, x - 1]
                - level[y + 1, x - 1]
                - level[y - 1, x + 1]
            )
            product, square = xx * yy - xy * xy, both * both
            if (product > bent * square) | (product < folded * square):
                continue
            half = 0.5 * (xx - yy)
            root = np.sqrt(half * half + xy * xy)
            bend = root - 0.5 * both
            if bend < least:
                continue
            # Eigenvector of the lower eigenvalue, from the better conditioned of two forms.
            if half < 0:
                vx, vy = half - root, xy
            else:
                vx, vy = xy, -half - root
            length = np.sqrt(vx * vx + vy * vy)
            if length == 0.0:
                continue
            vx, vy = vx / length, vy / length
            if not (
                _is_grass_at(image, x + side * vx, y + side * vy)
                and _is_grass_at(image, x - side * vx, y - side * vy)
            ):
                continue
            strength[y, x] = bend
            if abs(vy) < 0.4142 * abs(vx):
                across[y, x] = 0
            elif abs(vx) < 0.4142 * abs(vy):
                across[y, x] = 2
            else:
                across[y, x] = 1 if vx * vy > 0 else 3


@compiled
def _is_grass_at(image, x, y):
    column, row = int(x + 0.5), int(y + 0.5)
    if column < 0 or row < 0 or column >= image.shape[1] or row >= image.shape[0]:
        return False
    return is_grass(image[row, column, 0], image[row, column, 1], image[row, column, 2])


@compiled
def thin_ridges(strength, across, strong, thin):
    """Writes 1 where a strong ridge is strongest across itself, else 0."""
    height, width = strength.shape
    thin[:] = 0
    for y in range(1, height - 1):
        for x in range(1, width - 1):
            if strong[y, x] == 0:
                continue
            dy, dx = STEPS[across[y, x]]
            here = strength[y, x]
            if here > strength[y + dy, x + dx] and here >= strength[y - dy, x - dx]:
                thin[y, x] = 1
