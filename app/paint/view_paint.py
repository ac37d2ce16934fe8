"""View paint: what the picture of a view says of its camera, in pixels of its annotations."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import Literal

import numpy as np

from app.config import Settings
from app.errors import GeometryError
from app.geometry.arrays import BoolArray
from app.geometry.lens import BROWN_CONRADY
from app.geometry.resection import PARAMETERS
from app.media.files import decode_frame
from app.paint.agreement import measure_agreement
from app.paint.evidence import Image, exclude_hidden_boxes, to_paint_evidence
from app.paint.grass import explain_missing_field, find_field_of_play
from app.paint.propose import LEAST_SIDE
from app.paint.ridges import find_line_like_pixels
from app.paint.snap import SnappedCamera, snap_camera
from app.soccer.frames import Box, ImagePoint, ImageSize
from app.soccer.group import Media
from app.soccer.paint_evidence import NO_PAINT, PAINT_DISAGREES, PaintEvidence, PaintPoint
from app.soccer.pitch import Pitch
from app.soccer.policy import CalibrationPolicy
from app.soccer.solution import Calibration

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

    def to_annotation_point(self, x: float, y: float) -> ImagePoint:
        """A place of the picture in pixels of the annotations; centres of pixels are whole."""
        return ImagePoint((x + 0.5) / self.x - 0.5, (y + 0.5) / self.y - 0.5)

    def to_picture_box(self, box: Box) -> Box:
        """A box of the annotations in pixels of the picture."""
        x, y = ((box.x + 0.5) * self.x - 0.5, (box.y + 0.5) * self.y - 0.5)
        return Box(x, y, box.width * self.x, box.height * self.y)

    def to_annotation_evidence(self, snapped: SnappedCamera) -> PaintEvidence:
        """The paint that was found, in pixels of the annotations."""
        found = to_paint_evidence(snapped.evidence, snapped.camera)
        points = {
            name: tuple(
                PaintPoint(*self.to_annotation_point(x, y), sigma / self.x)
                for x, y, sigma in places
            )
            for name, places in found.points.items()
        }
        return replace(found, points=points)

    def to_annotation_line_points(self, paint: BoolArray) -> tuple[ImagePoint, ...]:
        """Some of the pixels of a mask, shape (H, W), in pixels of the annotations."""
        rows, columns = np.nonzero(paint)
        step = -(-len(rows) // MOST_LINE_LIKE) or 1
        places = zip(columns[::step].tolist(), rows[::step].tolist(), strict=True)
        return tuple(self.to_annotation_point(x, y) for x, y in places)


def explain_unreadable_picture(image: Image, size: ImageSize) -> str | None:
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


SENTENCES = {
    NO_PAINT: "Too little paint is seen near the lines.",
    PAINT_DISAGREES: "The paint lies elsewhere than the lines: check their labels.",
}

LARGEST_PERSON = 0.1
"""Of the picture; a box that covers more hides no line from a camera that shows any."""


@dataclass(frozen=True)
class ViewPaint:
    """What was read near the camera of a view.

    Attributes:
        outcome: ``snapped``: the paint places the camera; ``kept``: it does not, and the camera
            of the lines stays; ``nothing``: nothing could be read.
        reason: ``no_paint`` or ``paint_disagrees`` where the camera is kept, else None.
        sentence: The same for people, and why there is nothing; empty where it is snapped.
        evidence: Paint along the markings, in their order along each.
        line_like: Places of everything that looks like painted lines.
        supported: Share of the visible markings that has paint, with the camera that is left.
        explained: Share of the line-like paint that has a marking, likewise.
        error_px: Median distance of the paint to its marking.
        moved_px: How far the markings moved, or would have, in the median.
    """

    outcome: Literal["snapped", "kept", "nothing"]
    reason: str | None = None
    sentence: str = ""
    evidence: PaintEvidence = field(default_factory=lambda: PaintEvidence({}))
    line_like: tuple[ImagePoint, ...] = ()
    supported: float | None = None
    explained: float | None = None
    error_px: float | None = None
    moved_px: float | None = None


def read_paint(
    media: Media,
    flipped: bool,
    settings: Settings,
    size: ImageSize,
    start: Calibration,
    pitch: Pitch,
    policy: CalibrationPolicy,
    people: Sequence[Box] = (),
) -> ViewPaint:
    """``read_paint_of_image`` for a frame where it lies; raises what ``decode_frame`` does."""
    return read_paint_of_image(
        decode_frame(media, flipped, settings), size, start, pitch, policy, people
    )


def read_paint_of_image(
    image: Image,
    size: ImageSize,
    start: Calibration,
    pitch: Pitch,
    policy: CalibrationPolicy,
    people: Sequence[Box] = (),
) -> ViewPaint:
    """What a picture shows of the markings that a camera projects into it.

    Args:
        image: Red green blue, shape (H, W, 3).
        size: Annotated size; results are in its pixels.
        start: Calibration of the view, pixels of ``size``.
        pitch: The pitch.
        policy: Prior of the distortion.
        people: Boxes in which nothing is believed, pixels of ``size``; what is larger than people
            are is looked into all the same.
    """
    pitch = policy.pitch_for_fitted_lines(pitch)
    why = explain_unreadable_picture(image, size)
    if why is not None:
        return ViewPaint("nothing", sentence=why)
    grass = find_field_of_play(image)
    why = explain_missing_field(image, grass)
    if why is not None:
        return ViewPaint("nothing", sentence=f"There is nothing to read: {why}.")
    scale = PictureScale.of(image, size)
    hidden = [scale.to_picture_box(box) for box in drop_boxes_larger_than_a_person(people, size)]
    seen_grass = exclude_hidden_boxes(grass, hidden)
    paint = find_line_like_pixels(image, grass) & seen_grass
    nothing = ViewPaint("nothing", line_like=scale.to_annotation_line_points(paint))
    why = _explain_unusable_calibration(start)
    if why is not None:
        return replace(nothing, sentence=why)
    assert start.camera is not None
    camera = start.camera.scaled(scale.x, scale.y)
    spread = None
    if start.covariance is not None and start.source == "lines":
        spread = np.reshape(start.covariance, (PARAMETERS, PARAMETERS))
    try:
        snapped = snap_camera(
            image, grass, camera, pitch, hidden=hidden, policy=policy, start_covariance=spread
        )
    except (GeometryError, np.linalg.LinAlgError):
        return replace(
            nothing, sentence="The camera from the lines cannot be moved onto the paint."
        )
    seen = measure_agreement(snapped.camera, seen_grass, paint, pitch)
    return replace(
        nothing,
        outcome="kept" if snapped.reason else "snapped",
        reason=snapped.reason,
        sentence=SENTENCES[snapped.reason] if snapped.reason else "",
        evidence=scale.to_annotation_evidence(snapped),
        supported=seen.supported,
        explained=seen.explained,
        error_px=None if snapped.error_px is None else snapped.error_px / scale.x,
        moved_px=snapped.moved_px / scale.x,
    )


def drop_boxes_larger_than_a_person(people: Sequence[Box], size: ImageSize) -> list[Box]:
    """The boxes that can be of a person on the field, and not of the field or a goal."""
    largest = LARGEST_PERSON * size.width * size.height
    return [box for box in people if box.width * box.height <= largest]


def _explain_unusable_calibration(start: Calibration) -> str | None:
    """Why paint cannot be sought with a calibration; None: it can."""
    camera = start.camera
    if camera is None:
        return "The lines do not determine a camera yet, so it is not known where paint should be."
    across, down = camera.focal_length
    if camera.lens != BROWN_CONRADY or abs(across / down - 1) > SHAPES_APART or camera.skew:
        return "Paint is read only for square pixels and one radial distortion term; this camera differs."
    return None
