"""Picture: one frame read as far as it can be read without any camera."""

from __future__ import annotations

from collections import deque
from collections.abc import Iterable, Iterator
from concurrent.futures import Future
from dataclasses import dataclass

import cv2
import numpy as np

from app.geometry.arrays import BoolArray
from app.paint.evidence import Image, Reading, read_picture
from app.paint.grass import field_of_play
from app.paint.propose import BORDER_PX, kernel_threads
from app.paint.ridges import find_line_like
from app.tracking.clip import Frame
from app.tracking.motion import Grey

AHEAD = 4
"""Pictures that are read while another one is followed."""


@dataclass(frozen=True)
class Picture:
    """A frame and what is seen in it.

    Attributes:
        number: From 0.
        time: When it is shown, seconds.
        image: Red green blue, work size, shape (H, W, 3).
        grey: For its motion, shape (H, W).
        field: The field of play, shape (H, W).
        paint: What looks like painted lines, shape (H, W).
        reading: Ready for paint to be read along markings.
    """

    number: int
    time: float
    image: Image
    grey: Grey
    field: BoolArray
    paint: BoolArray
    reading: Reading


def read_frame(frame: Frame) -> Picture:
    """All that a frame shows."""
    image = frame.image
    field = field_of_play(image)
    paint = find_line_like(image, field)
    for border in (slice(0, BORDER_PX), slice(-BORDER_PX, None)):
        paint[border] = paint[:, border] = False
    reading = read_picture(image, field)
    return Picture(frame.number, frame.time, image, grey_of(frame), field, paint, reading)


def grey_of(frame: Frame) -> Grey:
    """A frame as its motion is seen, shape (H, W)."""
    return np.asarray(cv2.cvtColor(frame.image, cv2.COLOR_RGB2GRAY), np.uint8)


def read_frames(frames: Iterable[Frame]) -> Iterator[Picture]:
    """Frames read in threads, in their order, a few ahead."""
    waiting: deque[Future[Picture]] = deque()
    for frame in frames:
        waiting.append(kernel_threads().submit(read_frame, frame))
        if len(waiting) > AHEAD:
            yield waiting.popleft().result()
    while waiting:
        yield waiting.popleft().result()
