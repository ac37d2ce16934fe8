"""YOLO: pictures into the network's input, and its output into boxes of the picture.

The layout is that of Ultralytics' ONNX export: the input is RGB in [0, 1], letterboxed on grey;
the output is (1, 4 + classes, N) with cx, cy, w, h in input pixels and a score per class, or,
from an export with its own suppression, (1, N, 6) with x1, y1, x2, y2, score, class.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import cv2
import numpy as np
import numpy.typing as npt

from app.errors import InputError
from app.evaluation.frame import Detection
from app.formats.ball_names import is_ball
from app.geometry.arrays import FloatArray
from app.soccer.frames import Box, ImageSize

GRAY = 114
"""What Ultralytics fills the border with."""
SUPPRESS_IOU = 0.7
MAX_CANDIDATES = 3000
"""Of one picture, before suppression; the surest ones."""

Picture = Any


@dataclass(frozen=True)
class Letterbox:
    """How a picture lies in the network's input: scaled by ``scale``, then moved."""

    scale: float
    left: int
    top: int
    input: ImageSize
    picture: ImageSize

    @staticmethod
    def fit(picture: ImageSize, network: ImageSize) -> Letterbox:
        """The picture as large as it fits, in the middle."""
        scale = min(network.width / picture.width, network.height / picture.height)
        across, down = round(picture.width * scale), round(picture.height * scale)
        # Ultralytics' own rounding: of an odd border, the smaller half comes first.
        left = round((network.width - across) / 2 - 0.1)
        top = round((network.height - down) / 2 - 0.1)
        return Letterbox(scale, left, top, network, picture)

    def prepare(self, picture: Picture) -> npt.NDArray[np.float32]:
        """The network's input for a BGR picture of 8 bits, shape (1, 3, height, width)."""
        across = round(self.picture.width * self.scale)
        down = round(self.picture.height * self.scale)
        if (across, down) != (self.picture.width, self.picture.height):
            picture = cv2.resize(picture, (across, down), interpolation=cv2.INTER_LINEAR)
        filled = np.full((self.input.height, self.input.width, 3), GRAY, np.uint8)
        filled[self.top : self.top + down, self.left : self.left + across] = picture
        planes = filled[:, :, ::-1].transpose(2, 0, 1)[None]
        return np.ascontiguousarray(planes, dtype=np.float32) / np.float32(255)

    def restore(self, corners: FloatArray) -> FloatArray:
        """Corners x1, y1, x2, y2 of the input as corners of the picture, both shape (N, 4)."""
        moved = corners - np.array([self.left, self.top, self.left, self.top])
        width, height = self.picture.width, self.picture.height
        result: FloatArray = np.clip(moved / self.scale, 0, [width, height, width, height])
        return result


def decode_output(
    output: FloatArray, box: Letterbox, category: int, min_score: float, most: int
) -> list[Detection]:
    """The balls of one picture, the surest first.

    Args:
        output: Of the network, shape (1, 4 + classes, N) or (1, N, 6).
        box: How the picture was prepared.
        category: The class that is the ball.
        min_score: Less sure ones are left out.
        most: How many at most.

    Raises:
        InputError: The output has another shape, or not that many classes.
    """
    corners, scores = _candidate_boxes(np.asarray(output, dtype=float), category)
    order = np.argsort(-scores, kind="stable")
    order = order[scores[order] >= min_score][:MAX_CANDIDATES]
    kept = suppress_overlapping(corners[order], SUPPRESS_IOU, most)
    places = box.restore(corners[order][kept])
    found = []
    for (x1, y1, x2, y2), score in zip(places.tolist(), scores[order][kept].tolist(), strict=True):
        if x2 > x1 and y2 > y1:
            found.append(Detection(Box(x1, y1, x2 - x1, y2 - y1), min(max(score, 0.0), 1.0)))
    return found


def suppress_overlapping(corners: FloatArray, limit: float, most: int) -> list[int]:
    """Non-maximum suppression of boxes x1, y1, x2, y2, the surest first, shape (N, 4).

    Returns:
        Places of those that are kept, in order.
    """
    area = (corners[:, 2] - corners[:, 0]) * (corners[:, 3] - corners[:, 1])
    left = np.ones(len(corners), dtype=bool)
    kept: list[int] = []
    for place in range(len(corners)):
        if not left[place] or len(kept) >= most:
            continue
        kept.append(place)
        low = np.maximum(corners[place, :2], corners[:, :2])
        high = np.minimum(corners[place, 2:], corners[:, 2:])
        shared = np.clip(high - low, 0, None).prod(axis=1)
        with np.errstate(invalid="ignore", divide="ignore"):
            left &= ~(shared / (area[place] + area - shared) > limit)
    return kept


def ball_category(names: Sequence[str]) -> int | None:
    """The class that is a ball, by the names in a model; None where none or several could be.

    Example:
        >>> ball_category(["person", "bicycle", "sports ball"])
        2
    """
    if len(names) == 1:
        return 0
    balls = [place for place, name in enumerate(names) if is_ball(name)]
    return balls[0] if len(balls) == 1 else None


def _candidate_boxes(output: FloatArray, category: int) -> tuple[FloatArray, FloatArray]:
    if output.ndim != 3 or output.shape[0] != 1:
        raise InputError(
            f"the model's output has the shape {output.shape}, not (1, 4 + classes, N)"
        )
    rows = output[0]
    if rows.shape[1] == 6 and rows.shape[0] > 6:
        return rows[:, :4], np.where(rows[:, 5] == category, rows[:, 4], -1.0)
    if rows.shape[0] < 5 + category:
        raise InputError(
            f"the model has {max(rows.shape[0] - 4, 0)} classes, so the ball cannot be class {category}",
            pointer="/category",
        )
    center, half = rows[:2].T, rows[2:4].T / 2
    return np.hstack([center - half, center + half]), rows[4 + category]
