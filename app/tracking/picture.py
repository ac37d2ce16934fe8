"""Picture: one frame read as far as it can be read without any camera, and a camera proposed from that."""

from __future__ import annotations

from collections import deque
from collections.abc import Iterable, Iterator, Sequence
from concurrent.futures import Future
from dataclasses import dataclass

import cv2
import numpy as np

from app.geometry.arrays import BoolArray
from app.geometry.camera import Camera
from app.paint.candidates import Library
from app.paint.evidence import Image, Reading, read_picture
from app.paint.grass import find_field_of_play
from app.paint.propose import (
    FrameProposal,
    get_kernel_executor,
    line_strength,
    prepare_frame_to_search,
    propose_for_frame,
)
from app.paint.ridges import Strength
from app.soccer.pitch import Pitch
from app.soccer.policy import CalibrationPolicy
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
        strength: Of what looks like painted lines, 0 elsewhere, shape (H, W).
        reading: Ready for paint to be read along markings.
    """

    number: int
    time: float
    image: Image
    grey: Grey
    field: BoolArray
    strength: Strength
    reading: Reading

    @property
    def paint(self) -> BoolArray:
        """What looks like painted lines, shape (H, W)."""
        return np.asarray(self.strength > 0)


def read_frame(frame: Frame) -> Picture:
    """All that a frame shows."""
    image = frame.image
    field = find_field_of_play(image)
    strength, reading = line_strength(image, field), read_picture(image, field)
    return Picture(frame.number, frame.time, image, grey_of(frame), field, strength, reading)


def grey_of(frame: Frame) -> Grey:
    """A frame as its motion is seen, shape (H, W)."""
    return np.asarray(cv2.cvtColor(frame.image, cv2.COLOR_RGB2GRAY), np.uint8)


def read_frames(frames: Iterable[Frame]) -> Iterator[Picture]:
    """Frames read in threads, in their order, a few ahead."""
    waiting: deque[Future[Picture]] = deque()
    for frame in frames:
        waiting.append(get_kernel_executor().submit(read_frame, frame))
        if len(waiting) > AHEAD:
            yield waiting.popleft().result()
    while waiting:
        yield waiting.popleft().result()


def propose_in_picture(
    picture: Picture,
    pitch: Pitch,
    known: Sequence[Camera],
    policy: CalibrationPolicy,
    libraries: Sequence[Library],
) -> FrameProposal:
    """As ``propose_for_frame``, for a picture of a clip."""
    frame = prepare_frame_to_search(picture.image, picture.field, picture.strength, picture.reading)
    if isinstance(frame, str):
        return FrameProposal("nothing", frame)
    return propose_for_frame(frame, picture.image, pitch, known, policy, libraries)
