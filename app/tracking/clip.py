"""Clip: the frames of a video one after the other, in the width in which paint is followed."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import cv2
import numpy as np

from app.errors import ImageError
from app.geometry.camera import Camera
from app.media.video import open_video
from app.paint.evidence import Image
from app.paint.propose import ENLARGED_WIDTH, WORK_WIDTH, enlarged, why_too_small
from app.soccer.frames import ImageSize
from app.video.indexing import pixel_aspect

_MOST_UNEQUAL = 0.01
"""By how much width and height of a pixel may differ: containers round."""


@dataclass(frozen=True)
class Frame:
    """One frame.

    Attributes:
        number: From 0, as the decoder returns them.
        time: When it is shown, seconds.
        image: Red green blue, work size, shape (H, W, 3).
    """

    number: int
    time: float
    image: Image


@dataclass(frozen=True)
class Clip:
    """A video that can be read.

    Attributes:
        path: The file.
        size: Its own, pixels.
        work: The size in which its paint is followed, pixels.
    """

    path: Path
    size: ImageSize
    work: ImageSize

    @staticmethod
    def open(path: Path) -> Clip:
        """The clip of a file.

        Raises:
            ImageError: It is no video that can be read, its pixels are not square, or it is too small to
                follow a line in.
        """
        with open_video(path) as video:
            over, under = pixel_aspect(video, 0)
        if abs(over / under - 1) > _MOST_UNEQUAL:
            raise ImageError(
                f"{path.name}: its pixels are not square ({over}:{under})",
                hint="Convert it first: ffmpeg -i IN -vf scale=iw*sar:ih,setsar=1 OUT",
            )
        first = next(_decoded(path, 0, 1), None)
        if first is None:
            raise ImageError(f"{path.name} is no video that can be read, or has no frame")
        image = first[2]
        if (small := why_too_small(image)) is not None:
            raise ImageError(f"{path.name}: {small}")
        shapes = [(each.shape[1], each.shape[0]) for each in (image, _work_size(image))]
        own, work = (ImageSize(*shape) for shape in shapes)
        return Clip(path, own, work)

    def frames(self, first: int = 0, end: int | None = None) -> Iterator[Frame]:
        """Frames from ``first`` to before ``end``; all are decoded, jumping may land beside one.

        Raises:
            ImageError: A frame has another size than the first one.
        """
        for number, time, image in _decoded(self.path, first, end):
            if (image.shape[1], image.shape[0]) != (self.size.width, self.size.height):
                raise ImageError(
                    f"{self.path.name}: frame {number} has another size than the first"
                )
            small = _work_size(image)
            yield Frame(number, time, np.ascontiguousarray(small[:, :, ::-1]))

    def as_shown(self, camera: Camera) -> Camera:
        """A camera of the work size in pixels of the video."""
        return camera.scaled(*self._factors)

    def as_read(self, camera: Camera) -> Camera:
        """A camera of the video in pixels of the work size."""
        across, down = self._factors
        return camera.scaled(1 / across, 1 / down)

    @property
    def _factors(self) -> tuple[float, float]:
        return self.size.width / self.work.width, self.size.height / self.work.height


def _decoded(path: Path, first: int, end: int | None) -> Iterator[tuple[int, float, Image]]:
    with open_video(path) as video:
        if not video.isOpened():
            raise ImageError(f"{path.name} is no video that can be read")
        number = 0
        while (end is None or number < end) and video.grab():
            if number >= first:
                time = video.get(cv2.CAP_PROP_POS_MSEC) / 1000
                done, image = video.retrieve()
                if not done:
                    raise ImageError(f"frame {number} of {path.name} cannot be decoded")
                yield number, time, np.asarray(image, np.uint8)
            number += 1


def _work_size(image: Image) -> Image:
    height, width = image.shape[:2]
    if width < ENLARGED_WIDTH:
        return enlarged(image)
    if width <= WORK_WIDTH:
        return image
    size = (WORK_WIDTH, max(round(height * WORK_WIDTH / width), 1))
    return np.asarray(cv2.resize(image, size, interpolation=cv2.INTER_AREA), np.uint8)
