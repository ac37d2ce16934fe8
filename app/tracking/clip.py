"""Clip: a stretch of a video, its frames in the width in which paint is followed."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import cv2
import numpy as np

from app.errors import ImageError
from app.geometry.camera import Camera
from app.paint.evidence import Image
from app.paint.propose import ENLARGED_WIDTH, enlarge_small_picture, explain_too_small_picture
from app.paint.ranking import WORK_WIDTH
from app.soccer.frames import ImageSize
from app.video.frames import read_frames
from app.video.index import RecordingIndex
from app.video.indexing import index_without_measuring


@dataclass(frozen=True)
class ClipFrame:
    """One frame.

    Attributes:
        number: From 0, the first one of the clip.
        time: When it is shown, seconds after the first frame of the video.
        image: Red green blue, work size, shape (H, W, 3).
    """

    number: int
    time: float
    image: Image


@dataclass(frozen=True)
class Clip:
    """A stretch of a video that can be read.

    Attributes:
        path: The file.
        index: Of the whole file.
        start: Number in the file of the clip's first frame.
        count: How many frames it has.
        size: Of a frame as people see it, upright with square pixels.
        work: The size in which its paint is followed, pixels.
    """

    path: Path
    index: RecordingIndex
    start: int
    count: int
    size: ImageSize
    work: ImageSize

    @staticmethod
    def open(
        path: Path, index: RecordingIndex | None = None, first: int = 0, last: int | None = None
    ) -> Clip:
        """The clip of a file, from its frame ``first`` to ``last``.

        Args:
            index: Of the file; None: it is decoded for its times.

        Raises:
            ImageError: It is not a video that can be read, or it is too small to follow a line in.
        """
        index = index or index_without_measuring(path)
        _, image = next(read_frames(path, index, [first]))
        if (small := explain_too_small_picture(image)) is not None:
            raise ImageError(f"{path.name}: {small}")
        shapes = [(each.shape[1], each.shape[0]) for each in (image, _resize_to_work_size(image))]
        own, work = (ImageSize(*shape) for shape in shapes)
        end = len(index) if last is None else last + 1
        return Clip(path, index, first, end - first, own, work)

    def frames(self, first: int = 0, end: int | None = None) -> Iterator[ClipFrame]:
        """Frames of the clip from ``first`` to before ``end``.

        Raises:
            ImageError: A frame cannot be decoded.
        """
        start, end = self.start, self.count if end is None else min(end, self.count)
        for number, image in read_frames(self.path, self.index, range(start + first, start + end)):
            time = float(self.index.seconds[number])
            yield ClipFrame(number - start, time, np.ascontiguousarray(_resize_to_work_size(image)))

    def scale_to_video(self, camera: Camera) -> Camera:
        """A camera of the work size in pixels of the video."""
        return camera.scaled(*self._scale_factors)

    def scale_to_work_size(self, camera: Camera) -> Camera:
        """A camera of the video in pixels of the work size."""
        across, down = self._scale_factors
        return camera.scaled(1 / across, 1 / down)

    @property
    def _scale_factors(self) -> tuple[float, float]:
        return self.size.width / self.work.width, self.size.height / self.work.height


def _resize_to_work_size(image: Image) -> Image:
    height, width = image.shape[:2]
    if width < ENLARGED_WIDTH:
        return enlarge_small_picture(image)
    if width <= WORK_WIDTH:
        return image
    size = (WORK_WIDTH, max(round(height * WORK_WIDTH / width), 1))
    return np.asarray(cv2.resize(image, size, interpolation=cv2.INTER_AREA), np.uint8)
