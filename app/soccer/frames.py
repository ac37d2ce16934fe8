"""The image frame and its units; docs/coordinates.md has the whole story."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import NamedTuple

MAX_PIXEL = 1e6
"""No annotated coordinate is further than this from the image's origin, pixels."""
MAX_SIDE = 16_384
"""No annotated image is wider or higher, pixels."""


class ImagePoint(NamedTuple):
    """A point in an image, pixels, origin at the centre of the top-left pixel."""

    x: float
    y: float


@dataclass(frozen=True)
class ImageSize:
    """Width and height of the annotated image, pixels; never inferred, always explicit."""

    width: int
    height: int

    @property
    def diagonal(self) -> float:
        """Length of the diagonal in pixels, the yardstick of every threshold in per cent."""
        return math.hypot(self.width, self.height)

    def unit_to_pixel(self, x: float, y: float) -> ImagePoint:
        """Pixel of a normalised file coordinate, which scales by (width - 1, height - 1)."""
        return ImagePoint(x * (self.width - 1), y * (self.height - 1))


@dataclass(frozen=True)
class Box:
    """An axis-aligned box: top-left corner, width and height, pixels."""

    x: float
    y: float
    width: float
    height: float

    @property
    def center(self) -> ImagePoint:
        """Centre of the box."""
        return ImagePoint(self.x + self.width / 2, self.y + self.height / 2)

    @property
    def diameter(self) -> float:
        """The d of a ball's box, (w + h) / 2, pixels."""
        return (self.width + self.height) / 2

    @staticmethod
    def square(center: ImagePoint, diameter: float) -> Box:
        """The square of side ``diameter`` (pixels) around ``center``."""
        return Box(center.x - diameter / 2, center.y - diameter / 2, diameter, diameter)


def height_above_grass(z: float) -> float:
    """Height in metres of a pitch-frame z, which points down."""
    return -z


HALF = 0.5
"""What a coordinate of theirs is larger than ours, in pixels, along x and y alike."""


def box_from_corner_origin(box: Box) -> Box:
    """A box of COCO or YOLO in our pixel frame.

    Args:
        box: Upper left corner and size in pixels, the corner of the image's first pixel at (0, 0).

    Returns:
        The same box with the centre of the first pixel at (0, 0): half a pixel less, as large.
    """
    return Box(box.x - HALF, box.y - HALF, box.width, box.height)


def box_to_corner_origin(box: Box) -> Box:
    """The inverse of ``box_from_corner_origin``."""
    return Box(box.x + HALF, box.y + HALF, box.width, box.height)


def clip_box(box: Box, size: ImageSize) -> tuple[float, float, float, float] | None:
    """Left, top, right and bottom of the part of a box in the image, pixels; None where there is none.

    Both are measured from the corner of the first pixel.
    """
    left, right = max(box.x, 0.0), min(box.x + box.width, float(size.width))
    top, bottom = max(box.y, 0.0), min(box.y + box.height, float(size.height))
    if not all(map(math.isfinite, (left, right, top, bottom))) or right <= left or bottom <= top:
        return None
    return left, top, right, bottom
