"""Frame: one image of a dataset as evaluation sees it, what was predicted for it, and how boxes overlap."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

from app.geometry.camera import Camera
from app.soccer.annotation import Lines
from app.soccer.frames import Box, ImageSize
from app.soccer.pitch import Pitch


def iou(a: Box, b: Box) -> float:
    """Intersection over union of two boxes; 0 when they only touch.

    Example:
        >>> iou(Box(0, 0, 2, 2), Box(1, 0, 2, 2))
        0.3333333333333333
    """
    width = min(a.x + a.width, b.x + b.width) - max(a.x, b.x)
    height = min(a.y + a.height, b.y + b.height) - max(a.y, b.y)
    shared = max(width, 0.0) * max(height, 0.0)
    return shared / (a.width * a.height + b.width * b.height - shared)


def size_error_percent(box: Box, careful: Box) -> float:
    """|d - d_careful| in per cent of the reference box's diagonal, d = (width + height) / 2.

    Example:
        >>> size_error_percent(Box(0, 0, 6, 8), Box(0, 0, 3, 4))
        70.0
    """
    return 100.0 * abs(box.diameter - careful.diameter) / math.hypot(careful.width, careful.height)


@dataclass(frozen=True)
class Frame:
    """One view of one group: the truth that a prediction is measured with.

    Attributes:
        id: Of the view, opaque; predictions refer to it.
        boxes: The ball's boxes by kind, those of ``ball_boxes.BOX_KINDS`` that exist.
        absent: Somebody said that the ball is out of view: whatever is found here is wrong.
        camera: The dataset's own camera, the oracle; None when it is not calibrated.
        point: The triangulated ball, pitch frame, metres; only where this view is in a valid
            pair.
        lines: Annotated markings, pixels of ``size``.
        station: Key of the camera station, which lines and camera belong to.
        predicted_by: Set of predictions that the ball was accepted from; empty: somebody drew it.
    """

    id: int
    group_id: int
    group: str
    view: str
    match: str
    size: ImageSize
    split: str = ""
    boxes: Mapping[str, Box] = field(default_factory=dict)
    absent: bool = False
    camera: Camera | None = None
    point: tuple[float, float, float] | None = None
    parallax_degrees: float | None = None
    lines: Lines = field(default_factory=dict)
    pitch: Pitch = field(default_factory=Pitch)
    station: str = ""
    predicted_by: str = ""


@dataclass(frozen=True)
class Detection:
    """A ball that a detector found: pixels of the annotated size, and how sure it was."""

    box: Box
    score: float = 1.0


@dataclass(frozen=True)
class JudgedFrame:
    """A frame whose truth about the ball is known, with its detections, the surest first.

    ``truth`` is None where the ball is out of view.
    """

    frame: Frame
    truth: Box | None
    detections: tuple[Detection, ...]


def judge_detections(
    frames: Sequence[Frame], detections: Mapping[int, Sequence[Detection]], boxes: str
) -> list[JudgedFrame]:
    """The frames that have the box to compare with, or no ball at all.

    Detections of other frames cannot be judged and take no part.

    Args:
        frames: Of the dataset.
        detections: By id of the frame; frames without any were looked at in vain.
        boxes: One of ``ball_boxes.BOX_KINDS``.
    """
    judged = []
    for frame in frames:
        truth = frame.boxes.get(boxes)
        if truth is None and not frame.absent:
            continue
        # The sort is stable: of equal scores, the one that stands first in the file comes first.
        found = sorted(detections.get(frame.id, ()), key=lambda item: -item.score)
        judged.append(JudgedFrame(frame, None if frame.absent else truth, tuple(found)))
    return judged
