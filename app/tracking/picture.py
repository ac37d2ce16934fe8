"""Picture: one frame read as far as it can be read without any camera, and a camera proposed from that."""

from __future__ import annotations

import dataclasses
from collections import deque
from collections.abc import Callable, Iterable, Iterator, Sequence
from concurrent.futures import Future
from dataclasses import dataclass

import cv2
import numpy as np

from app.geometry.arrays import BoolArray
from app.geometry.camera import Camera
from app.paint.candidates import CameraSearchSpace
from app.paint.evidence import Image, PreparedPicture, prepare_picture
from app.paint.grass import find_field_of_play
from app.paint.propose import (
    FrameProposal,
    line_strength,
    prepare_frame_to_search,
    propose_for_frame,
)
from app.paint.ridges import Strength
from app.paint.search import get_kernel_executor
from app.soccer.pitch import Pitch
from app.soccer.policy import CalibrationPolicy
from app.tracking.clip import ClipFrame
from app.tracking.motion import Grey

AHEAD = 4
"""Pictures that are read while another one is followed."""


@dataclass
class FramePicture:
    """A frame and what is seen in it, each part computed when it is asked for first.

    Attributes:
        number: From 0.
        time: When it is shown, seconds.
        image: Red green blue, work size, shape (H, W, 3).
    """

    number: int
    time: float
    image: Image
    # Not ``cached_property``: that has one lock for all pictures in Python 3.11.
    _grey: Grey | None = dataclasses.field(default=None, init=False, repr=False)
    _field: BoolArray | None = dataclasses.field(default=None, init=False, repr=False)
    _strength: Strength | None = dataclasses.field(default=None, init=False, repr=False)
    _reading: PreparedPicture | None = dataclasses.field(default=None, init=False, repr=False)

    @property
    def grey(self) -> Grey:
        """For its motion, shape (H, W)."""
        if self._grey is None:
            self._grey = np.asarray(cv2.cvtColor(self.image, cv2.COLOR_RGB2GRAY), np.uint8)
        return self._grey

    @property
    def field(self) -> BoolArray:
        """The field of play, shape (H, W)."""
        if self._field is None:
            self._field = find_field_of_play(self.image)
        return self._field

    @property
    def paint_strength(self) -> Strength:
        """Of what looks like painted lines, 0 elsewhere, shape (H, W)."""
        if self._strength is None:
            self._strength = line_strength(self.image, self.field)
        return self._strength

    @property
    def reading(self) -> PreparedPicture:
        """Ready for paint to be read along markings."""
        if self._reading is None:
            self._reading = prepare_picture(self.image, self.field)
        return self._reading

    @property
    def paint(self) -> BoolArray:
        """What looks like painted lines, shape (H, W)."""
        return np.asarray(self.paint_strength > 0)

    def compute_all(self) -> FramePicture:
        """The same with all parts computed."""
        _ = self.grey, self.paint_strength, self.reading
        return self


def make_frame_picture(frame: ClipFrame) -> FramePicture:
    """What a frame shows."""
    return FramePicture(frame.number, frame.time, frame.image)


def make_frame_pictures(
    frames: Iterable[ClipFrame], is_followed: Callable[[], bool] = lambda: True
) -> Iterator[FramePicture]:
    """Frames read in threads, in their order, a few ahead.

    Args:
        is_followed: Whether a camera is followed by now. Where none is, most frames are only looked
            at for their motion, and their paint is read when it is asked for.
    """
    waiting: deque[Future[FramePicture]] = deque()
    for frame in frames:
        picture = make_frame_picture(frame)
        work = FramePicture.compute_all if is_followed() else _compute_grey
        waiting.append(get_kernel_executor().submit(work, picture))
        if len(waiting) > AHEAD:
            yield waiting.popleft().result()
    while waiting:
        yield waiting.popleft().result()


def _compute_grey(picture: FramePicture) -> FramePicture:
    _ = picture.grey
    return picture


def propose_camera_in_picture(
    picture: FramePicture,
    pitch: Pitch,
    known: Sequence[Camera],
    policy: CalibrationPolicy,
    libraries: Sequence[CameraSearchSpace],
) -> FrameProposal:
    """As ``propose_for_frame``, for a picture of a clip."""
    frame = prepare_frame_to_search(
        picture.image, picture.field, picture.paint_strength, picture.reading
    )
    if isinstance(frame, str):
        return FrameProposal("nothing", frame)
    return propose_for_frame(frame, picture.image, pitch, known, policy, libraries)
