"""View paint: what the picture of a view says of its camera, in pixels of its annotations."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import Literal

import numpy as np

from app.config import Settings
from app.errors import GeometryError
from app.geometry.lens import BROWN_CONRADY
from app.geometry.resection import PARAMETERS
from app.media.files import decode_frame
from app.paint.agreement import agreement
from app.paint.evidence import Image, seen_field
from app.paint.grass import field_of_play, why_no_field
from app.paint.picture_scale import SHAPES_APART, PictureScale, why_unreadable
from app.paint.ridges import line_like
from app.paint.snap import snap
from app.soccer.frames import Box, ImagePoint, ImageSize
from app.soccer.media import Media
from app.soccer.paint_evidence import NO_PAINT, PAINT_DISAGREES, PaintEvidence
from app.soccer.pitch import Pitch
from app.soccer.policy import CalibrationPolicy
from app.soccer.solution import Calibration

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
    """``paint_of`` for a frame where it lies; raises what ``decode_frame`` does."""
    return paint_of(decode_frame(media, flipped, settings), size, start, pitch, policy, people)


def paint_of(
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
    pitch = policy.fitted(pitch)
    why = why_unreadable(image, size)
    if why is not None:
        return ViewPaint("nothing", sentence=why)
    grass = field_of_play(image)
    why = why_no_field(image, grass)
    if why is not None:
        return ViewPaint("nothing", sentence=f"There is nothing to read: {why}.")
    scale = PictureScale.of(image, size)
    hidden = [scale.box(box) for box in hiding_boxes(people, size)]
    seen_grass = seen_field(grass, hidden)
    paint = line_like(image, grass) & seen_grass
    nothing = ViewPaint("nothing", line_like=scale.line_like(paint))
    why = _unusable(start)
    if why is not None:
        return replace(nothing, sentence=why)
    assert start.camera is not None
    camera = start.camera.scaled(scale.x, scale.y)
    spread = None
    if start.covariance is not None and start.source == "lines":
        spread = np.reshape(start.covariance, (PARAMETERS, PARAMETERS))
    try:
        snapped = snap(
            image, grass, camera, pitch, hidden=hidden, policy=policy, start_covariance=spread
        )
    except (GeometryError, np.linalg.LinAlgError):
        return replace(nothing, sentence="The camera of the lines cannot be drawn onto the paint.")
    seen = agreement(snapped.camera, seen_grass, paint, pitch)
    return replace(
        nothing,
        outcome="kept" if snapped.reason else "snapped",
        reason=snapped.reason,
        sentence=SENTENCES[snapped.reason] if snapped.reason else "",
        evidence=scale.evidence(snapped),
        supported=seen.supported,
        explained=seen.explained,
        error_px=None if snapped.error_px is None else snapped.error_px / scale.x,
        moved_px=snapped.moved_px / scale.x,
    )


def hiding_boxes(people: Sequence[Box], size: ImageSize) -> list[Box]:
    """Those that can be of somebody on the field, and not of the field or a goal."""
    largest = LARGEST_PERSON * size.width * size.height
    return [box for box in people if box.width * box.height <= largest]


def _unusable(start: Calibration) -> str | None:
    """Why paint cannot be sought with a calibration; None: it can."""
    camera = start.camera
    if camera is None:
        return "The lines make no camera yet, so nothing says where paint should be."
    across, down = camera.focal_length
    if camera.lens != BROWN_CONRADY or abs(across / down - 1) > SHAPES_APART or camera.skew:
        return "Paint is read with square pixels and lenses of one radial term; this one differs."
    return None
