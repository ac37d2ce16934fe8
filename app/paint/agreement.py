"""Agreement: how well a camera and the paint of its picture agree, without anybody's labels.

*Supported*: the share of the visible markings that have paint. *Explained*: the share of the
line-like paint that has a marking. A camera from wrong labels has clicks that fit, and paint
that does not; which side is which, paint cannot tell.
"""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
import numpy.typing as npt

from app.geometry.arrays import BoolArray
from app.geometry.camera import Camera
from app.paint.ridges import line_like as find_line_like
from app.paint.tracing import trace_places
from app.soccer.pitch import Pitch

NEAR_PX = 2.0
"""A marking has paint, and paint has a marking, within so many pixels at 960 wide."""
SPACING_PX = 3.0
MOST_PLACES = 6000
REFERENCE_WIDTH = 960


@dataclass(frozen=True)
class PaintAgreement:
    """How well a camera and the paint agree.

    Attributes:
        supported: Share of the visible points of markings on the field that have paint.
        explained: Share of the line-like paint that lies near a marking.
        points: How many points of markings are visible on the field.
    """

    supported: float
    explained: float
    points: int

    @property
    def product(self) -> float:
        """Both in one number, 0 to 1."""
        return self.supported * self.explained


def agreement(
    camera: Camera,
    field: BoolArray,
    paint: npt.NDArray[np.bool_] | npt.NDArray[np.uint8],
    pitch: Pitch | None = None,
) -> PaintAgreement:
    """Agreement of a camera with a picture.

    Args:
        camera: In pixels of the picture.
        field: The field of play, shape (H, W).
        paint: What ``ridges.line_like`` found, shape (H, W), or the picture itself, red green
            blue, shape (H, W, 3).
        pitch: The pitch.
    """
    lines = find_line_like(np.asarray(paint, np.uint8), field) if paint.ndim == 3 else paint
    height, width = field.shape
    columns, rows = _marked(camera, field, pitch or Pitch())
    near = max(NEAR_PX * width / REFERENCE_WIDTH, 1.5)
    supported = _widened(lines.astype(np.uint8), near)[rows, columns] > 0
    model = np.zeros((height, width), np.uint8)
    model[rows, columns] = 1
    explained = _widened(model, near + SPACING_PX / 2)[lines.astype(np.bool_)] > 0
    return PaintAgreement(
        supported=float(supported.mean()) if len(supported) else 0.0,
        explained=float(explained.mean()) if len(explained) else 0.0,
        points=len(supported),
    )


def _widened(mask: npt.NDArray[np.uint8], radius: float) -> npt.NDArray[np.uint8]:
    """A mask (0 and 1) and all that lies within a radius of it, pixels."""
    size = 2 * round(radius) + 1
    disc = cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (size, size))
    return np.asarray(cv2.dilate(mask, disc))


def _marked(
    camera: Camera, field: BoolArray, pitch: Pitch
) -> tuple[npt.NDArray[np.int64], npt.NDArray[np.int64]]:
    """Columns and rows of points along the visible markings on the field."""
    height, width = field.shape
    spacing = SPACING_PX * max(width / REFERENCE_WIDTH, 1.0)
    pixels = trace_places(camera, pitch, width, height, spacing, MOST_PLACES).pixels
    columns, rows = (pixels + 0.5).astype(np.int64).T
    columns, rows = np.clip(columns, 0, width - 1), np.clip(rows, 0, height - 1)
    kept = field[rows, columns]
    return columns[kept], rows[kept]
