"""Picture scale: from the pixels of a picture to those for which it was annotated.

A picture may be smaller or larger than the size for which it was annotated; its paint is read
as it is, and told in the pixels of the annotations.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from app.geometry.arrays import BoolArray
from app.paint.evidence import Image, to_paint_evidence
from app.paint.propose import LEAST_SIDE
from app.paint.snap import SnappedCamera
from app.soccer.frames import Box, ImagePoint, ImageSize
from app.soccer.paint_evidence import PaintEvidence, PaintPoint

SHAPES_APART = 0.005
"""Of its shape (width over height) a picture may differ from what was annotated."""
MOST_LINE_LIKE = 3000
"""Places of line-like paint that are told: enough to see where it lies."""


@dataclass(frozen=True)
class PictureScale:
    """Factors from pixels of the annotations to those of a picture."""

    x: float
    y: float

    @staticmethod
    def of(image: Image, size: ImageSize) -> PictureScale:
        """Of a picture, shape (H, W, 3), and its annotated size."""
        return PictureScale(image.shape[1] / size.width, image.shape[0] / size.height)

    def sentence(self, x: float, y: float) -> ImagePoint:
        """A place of the picture in pixels of the annotations; centres of pixels are whole."""
        return ImagePoint((x + 0.5) / self.x - 0.5, (y + 0.5) / self.y - 0.5)

    def box(self, box: Box) -> Box:
        """A box of the annotations in pixels of the picture."""
        x, y = ((box.x + 0.5) * self.x - 0.5, (box.y + 0.5) * self.y - 0.5)
        return Box(x, y, box.width * self.x, box.height * self.y)

    def evidence(self, snapped: SnappedCamera) -> PaintEvidence:
        """The paint that was found, in pixels of the annotations."""
        found = to_paint_evidence(snapped.evidence, snapped.camera)
        points = {
            name: tuple(PaintPoint(*self.sentence(x, y), sigma / self.x) for x, y, sigma in places)
            for name, places in found.points.items()
        }
        return replace(found, points=points)

    def line_like(self, paint: BoolArray) -> tuple[ImagePoint, ...]:
        """Some of the pixels of a mask, shape (H, W), in pixels of the annotations."""
        rows, columns = np.nonzero(paint)
        step = -(-len(rows) // MOST_LINE_LIKE) or 1
        places = zip(columns[::step].tolist(), rows[::step].tolist(), strict=True)
        return tuple(self.sentence(x, y) for x, y in places)


def why_unreadable(image: Image, size: ImageSize) -> str | None:
    """Why nothing can be read from a picture at all; None: something may."""
    height, width = image.shape[:2]
    if min(height, width) < LEAST_SIDE:
        return f"The frame is too small to follow its lines ({width} x {height} pixels)."
    if abs(width / height / (size.width / size.height) - 1) > SHAPES_APART:
        annotated = f"{size.width} x {size.height}"
        return (
            f"The frame is {width} x {height} pixels, another shape than annotated ({annotated})."
        )
    return None
