"""Evidence: paint that is seen along the projected markings of a camera.

Every few pixels along a marking its paint is looked for across it; what is found has a place to
a fraction of a pixel, a standard deviation and a strength (docs/paint.md).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import cv2
import numpy as np
import numpy.typing as npt

from app.geometry.arrays import BoolArray, FloatArray
from app.geometry.camera import Camera
from app.paint.grass import mark_grass_colour
from app.paint.profile_kernels import BEYOND_PX, SIDE_PX, drop_outlier_offsets, find_stripes
from app.paint.tracing import TracedPlaces, trace_places
from app.soccer.frames import Box
from app.soccer.paint_evidence import PaintEvidence, PaintPoint
from app.soccer.pitch import MARKINGS, Pitch

Image = npt.NDArray[np.uint8]
FloatImage = npt.NDArray[np.float32]

SPACING_PX = 4.0
MOST_PLACES = 4000
PLACES_WIDTH = 1920
"""In a broader picture places lie farther apart, so that no marking is left out."""
SMOOTH_PX = 0.7
LEAST_STRENGTH, LEAST_IN_NOISE = 6.0, 4.0
"""What stands out: grey levels, and standard deviations of the noise."""
LEAST_NOISE = 0.5
"""Grey levels, so that a drawn picture is not taken for free of error."""
THINNEST_PX = 0.25
"""Paint that is thinner in the picture is not seen; what is found there is something else."""
FULL_PX = 2.6
"""Paint of that width is as bright as paint is; thinner paint is mixed with the grass."""
PALER, BRIGHTER, BRIGHTER_BY = 0.3, 2.0, 8.0
"""How much paler than the paint of the picture a stripe may be for its width, and how much
brighter (times, and grey levels more)."""
AROUND, APART_PX, CONFIRMED = 5, 1.0, 0.5
"""Of the places around, this share must show paint within so many pixels of the same offset."""
UNSURE_PX = 0.2
"""Where noise alone makes sigma this large, blades of grass double it: they are no white noise."""
DIGITS = 4
"""Of a pixel, that are kept."""
SIGMA_FLOOR_PX = 0.04
"""No place is trusted to be better known: blades, wear and the picture's compression."""


@dataclass(frozen=True)
class PreparedPicture:
    """A picture as paint is read from it.

    Attributes:
        image: Red green blue, shape (H, W, 3).
        level: The least channel, smoothed, grey levels, shape (H, W).
        hidden: 1 where nothing is believed: off the field, people, overlays; shape (H, W).
        noise: Standard deviation of ``level`` on the grass, grey levels.
    """

    image: Image
    level: FloatImage
    hidden: npt.NDArray[np.uint8]
    noise: float

    @property
    def width(self) -> int:
        """Pixels."""
        return int(self.image.shape[1])

    @property
    def height(self) -> int:
        """Pixels."""
        return int(self.image.shape[0])

    @property
    def half_diagonal(self) -> float:
        """Pixels, as ``geometry.resection`` wants it."""
        return float(np.hypot(self.width, self.height)) / 2


@dataclass(frozen=True)
class DetectedPaint:
    """Paint at the places of ``traced`` where some was seen.

    Attributes:
        traced: The places, those without paint left out.
        offsets: From the expected place along the normal, pixels, shape (N,).
        sigmas: Standard deviations of the offsets, pixels, shape (N,).
        strengths: How much brighter than the grass beside it, grey levels, shape (N,).
    """

    traced: TracedPlaces
    offsets: FloatArray
    sigmas: FloatArray
    strengths: FloatArray

    @property
    def painted_fraction(self) -> float:
        """Of the visible places of markings, how many show paint."""
        return len(self.offsets) / max(self.traced.visible, 1)

    @property
    def pixels(self) -> FloatArray:
        """Where the paint is, pixels, shape (N, 2)."""
        return self.traced.pixels + self.offsets[:, None] * self.traced.normals

    def scaled(self, factor: float) -> DetectedPaint:
        """The same evidence for the picture resized by a factor."""
        traced = replace(
            self.traced,
            pixels=(self.traced.pixels + 0.5) * factor - 0.5,
            widths=self.traced.widths * factor,
            jacobian=self.traced.jacobian * factor,
        )
        offsets, sigmas = self.offsets * factor, self.sigmas * factor
        return replace(self, traced=traced, offsets=offsets, sigmas=sigmas)


def prepare_picture(image: Image, field: BoolArray, hidden: Sequence[Box] = ()) -> PreparedPicture:
    """A picture prepared for reading paint.

    Args:
        image: Red green blue, shape (H, W, 3).
        field: The field of play, shape (H, W).
        hidden: Boxes in which nothing is believed: people, the score, pixels.
    """
    image = np.ascontiguousarray(image)
    red, green, blue = cv2.split(image)
    least = cv2.min(red, cv2.min(green, blue)).astype(np.float32)
    level = np.asarray(cv2.GaussianBlur(least, (5, 5), SMOOTH_PX), np.float32)
    covered = np.logical_not(exclude_hidden_boxes(field, hidden)).astype(np.uint8)
    return PreparedPicture(image, level, covered, _estimate_noise(level, field))


def exclude_hidden_boxes(field: BoolArray, hidden: Sequence[Box]) -> BoolArray:
    """The field of play, shape (H, W), without boxes in which nothing is believed, pixels."""
    seen = field.copy()
    for box in hidden:
        left, top = max(int(np.floor(box.x)), 0), max(int(np.floor(box.y)), 0)
        right, bottom = int(np.ceil(box.x + box.width)), int(np.ceil(box.y + box.height))
        seen[top : max(bottom, 0), left : max(right, 0)] = False
    return seen


def trace_visible_markings(
    reading: PreparedPicture, camera: Camera, pitch: Pitch, spacing_px: float = SPACING_PX
) -> TracedPlaces:
    """Places along the markings as the camera shows them, on the field of play.

    Args:
        camera: Pixels of the picture; one focal length and one radial term count.
    """
    spacing = spacing_px * max(reading.width / PLACES_WIDTH, 1.0)
    traced = trace_places(camera, pitch, reading.width, reading.height, spacing, MOST_PLACES)
    on_field = _is_unhidden(reading.hidden, traced.pixels)
    found = np.flatnonzero(on_field & (traced.widths >= THINNEST_PX))
    return traced.only(found, int(on_field.sum()))


def find_paint(
    reading: PreparedPicture, traced: TracedPlaces, window_px: float | FloatArray
) -> DetectedPaint:
    """The painted line near each place, searched across the marking up to a distance.

    Args:
        window_px: To either side, for all places or for each, shape (N,).
    """
    count = len(traced.pixels)
    offsets, sigmas, strengths = np.empty(count), np.empty(count), np.empty(count)
    windows = np.ascontiguousarray(np.broadcast_to(np.asarray(window_px, np.float64), count))
    least = max(LEAST_STRENGTH, LEAST_IN_NOISE * reading.noise)
    find_stripes(
        reading.level, reading.image, reading.hidden, traced.pixels, traced.normals,
        traced.widths, windows, reading.noise, least, offsets, sigmas, strengths,
    )  # fmt: skip
    offsets[~_is_bright_as_paint(strengths, traced.widths)] = np.nan
    drop_outlier_offsets(offsets, traced.marking, AROUND, APART_PX, CONFIRMED)
    kept = np.flatnonzero(np.isfinite(offsets))
    seen = TracedPlaces(
        traced.places[kept],
        traced.pixels[kept],
        traced.normals[kept],
        traced.widths[kept],
        traced.marking[kept],
        traced.jacobian[kept],
        traced.visible,
    )
    sigma = np.hypot(sigmas[kept], SIGMA_FLOOR_PX)
    sigma *= 1 + (sigma / UNSURE_PX) ** 2
    return DetectedPaint(seen, offsets[kept], sigma, strengths[kept])


def has_grass_beside(reading: PreparedPicture, traced: TracedPlaces, window_px: float) -> BoolArray:
    """Where paint would be seen if it was there: in the picture, with grass to both sides.

    Args:
        window_px: How far to either side paint is sought.

    Returns:
        Shape (N,).
    """
    side = np.maximum(SIDE_PX, 0.5 * traced.widths + BEYOND_PX)
    reach = (window_px + side + 1.0)[:, None] * traced.normals
    last = np.array([reading.width, reading.height]) - 3.0
    seen: BoolArray = np.ones(len(side), np.bool_)
    for sign in (-1.0, 1.0):
        end = traced.pixels + sign * reach
        seen &= ((end >= 2.0) & (end <= last)).all(axis=1)
    rows = np.flatnonzero(seen)
    for sign in (-1.0, 1.0):
        beside = traced.pixels[rows] + sign * side[rows, None] * traced.normals[rows]
        x, y = (beside + 0.5).astype(np.int64).T
        grass = np.empty((1, len(rows)), np.uint8)
        mark_grass_colour(np.ascontiguousarray(reading.image[y, x][None]), grass)
        seen[rows] &= (grass[0] > 0) & (reading.hidden[y, x] == 0)
    return seen


def _is_bright_as_paint(strengths: FloatArray, widths: FloatArray) -> BoolArray:
    """Which stripes are about as bright as the paint of this picture is at their width."""
    full = np.minimum(widths / FULL_PX, 1.0)
    found = strengths > 0
    if not found.any():
        return found
    paint = float(np.median(strengths[found] / full[found]))
    bright: BoolArray = strengths <= BRIGHTER * paint * full + BRIGHTER_BY
    return bright & (strengths >= PALER * paint * full)


def _is_unhidden(hidden: npt.NDArray[np.uint8], pixels: FloatArray) -> BoolArray:
    columns, rows = (pixels + 0.5).astype(np.int64).T
    height, width = hidden.shape
    seen: BoolArray = hidden[np.clip(rows, 0, height - 1), np.clip(columns, 0, width - 1)] == 0
    return seen


def _estimate_noise(level: FloatImage, field: BoolArray) -> float:
    """From the median difference of pixels that are two apart."""
    here, beside = level[::3, :-2:3], level[::3, 2::3]
    both = field[::3, :-2:3] & field[::3, 2::3]
    apart = np.abs(here - beside)[both]
    if not len(apart):
        return LEAST_NOISE
    return max(float(np.median(apart) / (0.6745 * np.sqrt(2))), LEAST_NOISE)


def to_paint_evidence(evidence: DetectedPaint, camera: Camera | None = None) -> PaintEvidence:
    """The evidence as a value that is kept, to a ten-thousandth of a pixel.

    Args:
        evidence: What was seen.
        camera: It was sought with this one: then each place is that of the middle line of the
            marking, of which the middle of its paint as seen is not quite the image.
    """
    traced, marking = evidence.traced, evidence.traced.marking
    middle = traced.pixels if camera is None else camera.project(traced.places)
    pixels = middle + evidence.offsets[:, None] * traced.normals
    rows = np.column_stack([pixels, np.maximum(evidence.sigmas, 10.0**-DIGITS)]).round(DIGITS)
    points = {
        MARKINGS[index]: tuple(PaintPoint(*row) for row in rows[marking == index].tolist())
        for index in np.unique(marking)
    }
    return PaintEvidence({name: points[name] for name in sorted(points)})
