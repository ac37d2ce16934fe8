"""Agreement: how well a camera and the paint of its picture agree, without anybody's labels.

*Supported*: the share of the visible markings that have paint. *Explained*: the share of the
line-like paint that has a marking. A camera from wrong labels has clicks that fit, and paint
that does not; which side is which, paint cannot tell.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import cv2
import numpy as np
import numpy.typing as npt

from app.geometry.arrays import BoolArray
from app.geometry.camera import Camera
from app.paint.ridges import Strength, find_line_like_pixels
from app.paint.tracing import trace_places
from app.soccer.pitch import Pitch

NEAR_PX = 2.0
"""A marking has paint, and paint has a marking, within so many pixels at 960 wide."""
SPACING_PX = 3.0
MOST_PLACES = 6000
FAINT_SHARE, MARGIN_M = 0.5, 6.0
"""Of the paint's strength, below which a ridge is no paint; and how far beyond the pitch there is none, metres."""
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
    def combined_score(self) -> float:
        """Both in one number, 0 to 1."""
        return self.supported * self.explained


def measure_agreement(
    camera: Camera,
    field: BoolArray,
    paint: npt.NDArray[np.bool_] | npt.NDArray[np.uint8],
    pitch: Pitch | None = None,
) -> PaintAgreement:
    """Agreement of a camera with a picture.

    Args:
        camera: In pixels of the picture.
        field: The field of play, shape (H, W).
        paint: What ``ridges.find_line_like_pixels`` found, shape (H, W), or the picture itself, red green
            blue, shape (H, W, 3).
        pitch: The pitch.
    """
    lines = find_line_like_pixels(np.asarray(paint, np.uint8), field) if paint.ndim == 3 else paint
    width = field.shape[1]
    (columns, rows), model = _find_pixels_near_markings(camera, field, pitch or Pitch())
    supported = _dilate_mask(lines.astype(np.uint8), _near_distance_px(width))[rows, columns] > 0
    explained = model[lines.astype(np.bool_)]
    return PaintAgreement(
        supported=float(supported.mean()) if len(supported) else 0.0,
        explained=float(explained.mean()) if len(explained) else 0.0,
        points=len(supported),
    )


def measure_agreement_with_clear_paint(
    camera: Camera, field: BoolArray, strength: Strength, pitch: Pitch, paint_strength: float
) -> PaintAgreement:
    """As ``measure_agreement``, with what is no paint of a pitch left out of *explained*.

    Noise of a compressed picture and mowing stripes are fainter than the paint that is followed;
    seats that are as green as grass lie beyond the pitch.

    Args:
        camera: In pixels of the picture.
        field: The field of play, shape (H, W).
        strength: Of ``ridges.measure_line_strength``, shape (H, W).
        pitch: The pitch.
        paint_strength: Of paint (``measure_strength_near_markings``); less than half of it is none.
    """
    strong = strength >= FAINT_SHARE * paint_strength
    rows, columns = np.nonzero(strong & (strength > 0))
    ground = camera.project_to_ground(np.column_stack([columns, rows]).astype(np.float64))[:, :2]
    beyond = np.abs(ground) - np.array([pitch.length, pitch.width]) / 2
    on_pitch = np.isfinite(ground).all(axis=1) & (beyond < MARGIN_M).all(axis=1)
    clear = np.zeros(field.shape, np.bool_)
    clear[rows[on_pitch], columns[on_pitch]] = True
    explained = measure_agreement(camera, field, clear, pitch).explained
    return replace(measure_agreement(camera, field, strength > 0, pitch), explained=explained)


def measure_strength_near_markings(
    camera: Camera, field: BoolArray, strength: Strength, pitch: Pitch
) -> float:
    """Median strength of the line-like paint that lies near a camera's markings; 0 without any."""
    lines = strength > 0
    near = _find_pixels_near_markings(camera, field, pitch)[1] & lines
    return float(np.median(strength[near])) if near.any() else 0.0


def _dilate_mask(mask: npt.NDArray[np.uint8], radius: float) -> npt.NDArray[np.uint8]:
    """A mask (0 and 1) and all that lies within a radius of it, pixels."""
    size = 2 * round(radius) + 1
    disc = cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (size, size))
    return np.asarray(cv2.dilate(mask, disc))


def _near_distance_px(width: int) -> float:
    return max(NEAR_PX * width / REFERENCE_WIDTH, 1.5)


def _find_pixels_near_markings(
    camera: Camera, field: BoolArray, pitch: Pitch
) -> tuple[tuple[npt.NDArray[np.int64], npt.NDArray[np.int64]], BoolArray]:
    """``_sample_marking_pixels``, and which pixels lie near a marking, shape (H, W)."""
    columns, rows = _sample_marking_pixels(camera, field, pitch)
    model = np.zeros(field.shape, np.uint8)
    model[rows, columns] = 1
    near = _dilate_mask(model, _near_distance_px(field.shape[1]) + SPACING_PX / 2)
    return (columns, rows), np.asarray(near > 0)


def _sample_marking_pixels(
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
