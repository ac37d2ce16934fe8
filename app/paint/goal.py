"""Goal: posts and crossbars of a goal, read from a picture near where a camera shows them.

A goal is no paint on grass: behind it lie net, boards and people. It is read as a bright stripe
that follows its projection over most of its length.
"""

from __future__ import annotations

import cv2
import numpy as np
import numpy.typing as npt

from app.geometry.arrays import FloatArray
from app.geometry.camera import Camera
from app.soccer.annotation import Lines, make_lines
from app.soccer.frames import ImagePoint
from app.soccer.pitch import GOAL_PARTS, Pitch

Image = npt.NDArray[np.uint8]

WORK_WIDTH = 960
WINDOW_PX = 5.0
"""To either side that a part is sought, at ``WORK_WIDTH``, like the next two."""
STEP_PX = 0.25
SPACING_PX = 2.0
SMOOTH_PX = 0.7
POST_M = 0.12
BESIDE_PX = 2.0
"""Beyond the edge of a part the background begins."""
LEAST_CONTRAST = 12.0
"""Grey levels that a part is brighter than what lies to both sides."""
LEAST_LENGTH_PX = 12.0
"""A shorter stub cannot be told from anything else, at ``WORK_WIDTH``."""
ON_LINE_PX = 1.0
"""Bright places that lie on one line, at ``WORK_WIDTH``."""
LEAST_SHARE = 0.6
"""Of the places of a part that have to show it."""
POINTS = 4


def goal_lines(image: Image, camera: Camera, pitch: Pitch) -> Lines:
    """Points on the parts of the goals that a picture shows, pixels of the picture.

    Args:
        image: Red green blue, shape (H, W, 3).
        camera: On the paint of the picture.
        pitch: The pitch; the middle of the frame of its goals is sought.
    """
    height, width = image.shape[:2]
    unit = max(width / WORK_WIDTH, 1.0)
    least = image.min(axis=2).astype(np.float32)
    level = np.asarray(cv2.GaussianBlur(least, (0, 0), SMOOTH_PX * unit), np.float32)
    found, frame = {}, pitch.with_goal("middle")
    for name in GOAL_PARTS:
        places = frame.sample(name, 0.02, 0.02)
        pixels = camera.project(places, folded=True)
        inside = (pixels > 2.0).all(axis=1) & (pixels < [width - 3.0, height - 3.0]).all(axis=1)
        if np.count_nonzero(inside) < 2:
            continue
        thick = POST_M * camera.focal_length[0] / camera.pitch_to_camera(places[inside])[:, 2]
        points = _stripe(level, pixels[inside], float(np.median(thick)), unit)
        if points is not None:
            found[name] = [ImagePoint(x, y) for x, y in points.tolist()]
    return make_lines(found)


def _stripe(
    level: npt.NDArray[np.float32], pixels: FloatArray, thick: float, unit: float
) -> FloatArray | None:
    """Points of a bright stripe near a projected part, shape (N, 2); None where none is seen."""
    start, end = pixels[0], pixels[-1]
    length = float(np.hypot(*(end - start)))
    if length < LEAST_LENGTH_PX * unit:
        return None
    along = (end - start) / length
    normal = np.array([-along[1], along[0]])
    count = int(length / (SPACING_PX * unit)) + 1
    shares = np.linspace(0.0, 1.0, count)
    middles = start + shares[:, None] * (end - start)
    side = 0.5 * thick + BESIDE_PX * unit
    offsets = np.arange(-WINDOW_PX, WINDOW_PX + STEP_PX, STEP_PX) * unit
    here, one, other = (
        _read(level, middles[:, None] + (offsets + shift)[:, None] * normal)
        for shift in (0.0, -side, side)
    )
    contrast = here - np.maximum(one, other)
    best = contrast.argmax(axis=1)
    bright = contrast[np.arange(count), best] >= LEAST_CONTRAST
    if np.count_nonzero(bright) < LEAST_SHARE * count:
        return None
    line = _line(shares[bright], offsets[best[bright]], ON_LINE_PX * unit)
    near = np.abs(offsets[best] - np.polyval(line, shares)) <= ON_LINE_PX * unit
    on = np.flatnonzero(bright & near)
    if len(on) < LEAST_SHARE * count:
        return None
    line = np.polyfit(shares[on], offsets[best[on]], 1)
    chosen = on[np.linspace(0, len(on) - 1, POINTS).round().astype(int)]
    points: FloatArray = middles[chosen] + np.polyval(line, shares[chosen])[:, None] * normal
    return points


def _line(shares: FloatArray, offsets: FloatArray, near: float) -> FloatArray:
    """The line, as of ``polyfit``, near which most offsets lie: through two of them."""
    first, second = np.triu_indices(len(shares), max(len(shares) // 3, 1))
    slopes = (offsets[second] - offsets[first]) / (shares[second] - shares[first])
    bases = offsets[first] - slopes * shares[first]
    apart = np.abs(offsets - (bases[:, None] + slopes[:, None] * shares))
    best = int((apart <= near).sum(axis=1).argmax())
    return np.array([slopes[best], bases[best]])


def _read(level: npt.NDArray[np.float32], places: FloatArray) -> FloatArray:
    """Grey levels between pixels, of places of shape (..., 2)."""
    x, y = places.astype(np.float32).transpose(2, 0, 1)
    read = cv2.remap(level, x.copy(), y.copy(), cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE)
    return np.asarray(read, np.float64)
