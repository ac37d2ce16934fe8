"""Ridges: what looks like a painted line, in the whole picture, without any camera.

A line is a ridge of brightness: strongly bent across, hardly along (the eigenvalues of the
Hessian), with grass to both sides, long and thin.

Source: Steger, "An unbiased detector of curvilinear structures".
"""

from __future__ import annotations

import cv2
import numpy as np
import numpy.typing as npt

from app.geometry.arrays import BoolArray
from app.paint.ridge_kernels import ridge_strength, thin_ridges

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
BROADEST_PX = 6.0
"""Of what counts as a line, pixels of ``WORK_WIDTH``."""
SIDE_PX = 5.0
"""Where grass is looked for to both sides."""


def line_like(image: Image, field: BoolArray) -> BoolArray:
    """The thin pixels of everything on the field that looks like a painted line.

    Args:
        image: Red green blue, shape (H, W, 3).
        field: The field of play, shape (H, W).

    Returns:
        Shape (H, W). In a picture wider than ``WORK_WIDTH`` the pixels do not touch: there is
        one for each pixel of the smaller picture.
    """
    return np.asarray(line_strength(image, field) > 0)


def line_strength(image: Image, field: BoolArray) -> Strength:
    """The same with the strength of each pixel, grey levels per square pixel; 0 elsewhere."""
    height, width = field.shape
    full = np.zeros((height, width), np.float32)
    if not field.any():
        return full
    small, inside = _work_size(image, field)
    thin = _thin_lines(small, inside, small.shape[1] / WORK_WIDTH)
    if small.shape[:2] == (height, width):
        return thin
    rows, columns = np.nonzero(thin)
    to = _scaled(rows, height, len(small)), _scaled(columns, width, small.shape[1])
    full[to] = thin[rows, columns]
    return full


def _work_size(image: Image, field: BoolArray) -> tuple[Image, npt.NDArray[np.uint8]]:
    height, width = field.shape
    inside = field.astype(np.uint8)
    if width <= WORK_WIDTH:
        return np.ascontiguousarray(image), inside
    size = (WORK_WIDTH, max(round(height * WORK_WIDTH / width), 1))
    small = cv2.resize(image, size, interpolation=cv2.INTER_AREA)
    near = cv2.resize(inside, size, interpolation=cv2.INTER_NEAREST)
    return np.asarray(small, np.uint8), np.asarray(near, np.uint8)


def _scaled(places: npt.NDArray[np.int64], size: int, small: int) -> npt.NDArray[np.int64]:
    """Pixels of the full picture at the centres of those of the small one."""
    return np.asarray(((places + 0.5) * size / small).astype(np.int64))


def _thin_lines(image: Image, inside: npt.NDArray[np.uint8], unit: float) -> Strength:
    """As ``line_strength``, for a picture in which lengths are ``unit`` times those above."""
    # Paint is bright in all channels; shirts and boards rarely are.
    red, green, blue = cv2.split(image)
    level = cv2.GaussianBlur(cv2.min(red, cv2.min(green, blue)).astype(np.float32), (0, 0), BLUR_PX)
    strength = np.empty(inside.shape, np.float32)
    across = np.empty(inside.shape, np.uint8)
    side = max(SIDE_PX * unit, 3.0)
    ridge_strength(level, image, inside, side, LEAST_STRENGTH, strength, across)
    limit = max(_percentile(strength, inside), LEAST_STRENGTH)
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


def _percentile(strength: npt.NDArray[np.float32], inside: npt.NDArray[np.uint8]) -> float:
    """Of the strength on the field, from every third pixel."""
    values = strength[::3, ::3][inside[::3, ::3] > 0]
    return float(np.percentile(values, STRONGEST_PERCENT)) if len(values) else np.inf
