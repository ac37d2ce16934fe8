"""Goal: posts and crossbars of a goal, read from a picture near where a camera shows them.

A goal is no paint on grass: behind it lie net, boards and people. It is read as a bright stripe
that follows its projection over most of its length.
"""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
import numpy.typing as npt

from app.geometry.arrays import FloatArray
from app.geometry.camera import Camera
from app.soccer.annotation import Lines, make_lines
from app.soccer.frames import ImagePoint
from app.soccer.pitch import GOAL_PARTS, Pitch, Segment

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
HEIGHTS = np.geomspace(0.5, 2.0, 36)
"""Of a goal as it may look, shares of what it is."""
LEAST_SQUARE, MOST_SQUARE = 0.88, 1.16
"""Between these a goal is as high as it is: the middle of its bar lies 1.025 times as high."""
BAR_PLACES, MOST_CONTRAST = 120, 60.0
SURE_SHARE, SURE_POST, SURE_CONTRAST, SURE_RATIO = 0.9, 0.85, 30.0, 2.0
"""A goal certainly looks too high where so much of bar and a post is seen, so bright in the mean, and so
many times brighter than where the bar should be."""


@dataclass(frozen=True)
class GoalHeight:
    """How high a goal looks.

    Attributes:
        share: Of its height.
        crossbar: Share of the bar's places that are seen there.
        contrast: How much brighter the bar is than what lies to both sides, grey levels.
        post: Share of the better seen post's places, up to there.
        planned: Contrast where the bar should be.
    """

    share: float
    crossbar: float
    contrast: float
    post: float
    planned: float

    @property
    def has_expected_height(self) -> bool:
        """Whether the goal is as high as it should be."""
        return LEAST_SQUARE < self.share < MOST_SQUARE

    @property
    def is_certain(self) -> bool:
        """Whether the height can be believed though it is another."""
        seen = self.crossbar >= SURE_SHARE and self.post >= SURE_POST
        return seen and self.contrast >= max(SURE_CONTRAST, SURE_RATIO * self.planned)


def find_goal_lines(image: Image, camera: Camera, pitch: Pitch) -> Lines:
    """Points on the parts of the goals that a picture shows, pixels of the picture.

    Args:
        image: Red green blue, shape (H, W, 3).
        camera: On the paint of the picture.
        pitch: The pitch; the middle of the frame of its goals is sought.
    """
    height, width = image.shape[:2]
    level, unit = _smooth_darkest_channel(image)
    found, frame = {}, pitch.with_goal_edge("middle")
    for name in GOAL_PARTS:
        places = frame.sample(name, 0.02, 0.02)
        pixels = camera.project(places, folded=True)
        inside = (pixels > 2.0).all(axis=1) & (pixels < [width - 3.0, height - 3.0]).all(axis=1)
        if np.count_nonzero(inside) < 2:
            continue
        thick = POST_M * camera.focal_length[0] / camera.pitch_to_camera(places[inside])[:, 2]
        points = _find_bright_stripe(level, pixels[inside], float(np.median(thick)), unit)
        if points is not None:
            found[name] = [ImagePoint(x, y) for x, y in points.tolist()]
    return make_lines(found)


def measure_goal_height(image: Image, camera: Camera, pitch: Pitch) -> GoalHeight | None:
    """How high a goal looks, as a share of what the camera shows; None where none is seen.

    Paint alone hardly tells a squeezed picture from one that was taken from farther up: both
    foreshorten the grass alike. A goal stands upright, and looks too high or too low.

    Args:
        image: Red green blue, shape (H, W, 3).
        camera: On the paint of the picture.
        pitch: The pitch.
    """
    level, unit = _smooth_darkest_channel(image)
    found = [
        height
        for side in ("left", "right")
        if (height := _measure_height_of_side(level, unit, camera, pitch, side)) is not None
    ]
    return max(found, key=lambda item: item.contrast, default=None)


def _measure_height_of_side(
    level: npt.NDArray[np.float32], unit: float, camera: Camera, pitch: Pitch, side: str
) -> GoalHeight | None:
    bar = pitch.with_goal_edge("middle").shapes[f"Goal {side} crossbar"]
    assert isinstance(bar, Segment)
    ends = np.array([bar.start, bar.end])
    bars = [
        _measure_bright_fraction(level, unit, camera, *(ends * (1.0, 1.0, share)))
        for share in HEIGHTS
    ]
    contrasts = np.array([0.0 if seen is None else seen[1] for seen in bars])
    best = int(contrasts.argmax())
    crossbar = bars[best]
    if crossbar is None or crossbar[0] < LEAST_SHARE:
        return None
    posts = [
        _measure_bright_fraction(
            level, unit, camera, end * (1.0, 1.0, HEIGHTS[best]), end * (1.0, 1.0, 0.0)
        )
        for end in ends
    ]
    near = np.abs(np.log(HEIGHTS)) < np.log(MOST_SQUARE)
    return GoalHeight(
        float(HEIGHTS[best]),
        crossbar[0],
        float(contrasts[best]),
        max((post[0] for post in posts if post is not None), default=0.0),
        float(contrasts[near].max()),
    )


def _measure_bright_fraction(
    level: npt.NDArray[np.float32], unit: float, camera: Camera, start: FloatArray, end: FloatArray
) -> tuple[float, float] | None:
    """Share of a straight part's places that are brighter than both sides, and by how much in the
    mean, grey levels; None where less than half of it is in the picture."""
    height, width = level.shape
    places = start + np.linspace(0.0, 1.0, BAR_PLACES)[:, None] * (end - start)
    pixels = camera.project(places, folded=True)
    inside = (pixels > 2.0).all(axis=1) & (pixels < [width - 3.0, height - 3.0]).all(axis=1)
    pixels = pixels[inside]
    if len(pixels) < BAR_PLACES / 2:
        return None
    along = pixels[-1] - pixels[0]
    length = float(np.hypot(*along))
    if length < LEAST_LENGTH_PX * unit:
        return None
    normal = np.array([-along[1], along[0]]) / length
    count = max(int(length / (SPACING_PX * unit)), 6)
    middles = pixels[0] + np.linspace(0.0, 1.0, count)[:, None] * along
    depth = camera.pitch_to_camera(places[inside])[:, 2]
    thick = float(np.median(POST_M * camera.focal_length[0] / depth))
    offsets = np.arange(-ON_LINE_PX, ON_LINE_PX + STEP_PX, STEP_PX) * unit
    contrast = _measure_stripe_contrast(level, middles, offsets, normal, thick, unit).max(axis=1)
    mean = float(np.clip(contrast, 0.0, MOST_CONTRAST).mean())
    return float((contrast >= LEAST_CONTRAST).mean()), mean


def _measure_stripe_contrast(
    level: npt.NDArray[np.float32],
    middles: FloatArray,
    offsets: FloatArray,
    normal: FloatArray,
    thick: float,
    unit: float,
) -> FloatArray:
    """How much brighter than both its sides each place is, grey levels, shape (N, offsets)."""
    side = 0.5 * thick + BESIDE_PX * unit
    here, one, other = (
        _interpolate_levels(level, middles[:, None] + (offsets + shift)[:, None] * normal)
        for shift in (0.0, -side, side)
    )
    contrast: FloatArray = here - np.maximum(one, other)
    return contrast


def _smooth_darkest_channel(image: Image) -> tuple[npt.NDArray[np.float32], float]:
    """The smallest channel, smoothed, grey levels, shape (H, W); pixels for one at ``WORK_WIDTH``."""
    unit = max(image.shape[1] / WORK_WIDTH, 1.0)
    least = image.min(axis=2).astype(np.float32)
    return np.asarray(cv2.GaussianBlur(least, (0, 0), SMOOTH_PX * unit), np.float32), unit


def _find_bright_stripe(
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
    offsets = np.arange(-WINDOW_PX, WINDOW_PX + STEP_PX, STEP_PX) * unit
    contrast = _measure_stripe_contrast(level, middles, offsets, normal, thick, unit)
    best = contrast.argmax(axis=1)
    bright = contrast[np.arange(count), best] >= LEAST_CONTRAST
    if np.count_nonzero(bright) < LEAST_SHARE * count:
        return None
    line = _fit_line(shares[bright], offsets[best[bright]], ON_LINE_PX * unit)
    near = np.abs(offsets[best] - np.polyval(line, shares)) <= ON_LINE_PX * unit
    on = np.flatnonzero(bright & near)
    if len(on) < LEAST_SHARE * count:
        return None
    line = np.polyfit(shares[on], offsets[best[on]], 1)
    chosen = on[np.linspace(0, len(on) - 1, POINTS).round().astype(int)]
    points: FloatArray = middles[chosen] + np.polyval(line, shares[chosen])[:, None] * normal
    return points


def _fit_line(shares: FloatArray, offsets: FloatArray, near: float) -> FloatArray:
    """The line, as of ``polyfit``, near which most offsets lie: through two of them."""
    first, second = np.triu_indices(len(shares), max(len(shares) // 3, 1))
    slopes = (offsets[second] - offsets[first]) / (shares[second] - shares[first])
    bases = offsets[first] - slopes * shares[first]
    apart = np.abs(offsets - (bases[:, None] + slopes[:, None] * shares))
    best = int((apart <= near).sum(axis=1).argmax())
    return np.array([slopes[best], bases[best]])


def _interpolate_levels(level: npt.NDArray[np.float32], places: FloatArray) -> FloatArray:
    """Grey levels between pixels, of places of shape (..., 2)."""
    x, y = places.astype(np.float32).transpose(2, 0, 1)
    read = cv2.remap(level, x.copy(), y.copy(), cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE)
    return np.asarray(read, np.float64)
