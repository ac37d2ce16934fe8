"""Frames of a recording by their numbers, exactly those that the index counts."""

from __future__ import annotations

from collections import OrderedDict
from collections.abc import Iterable, Iterator
from contextlib import closing
from pathlib import Path

import cv2
import numpy as np
import numpy.typing as npt

from app.errors import ImageError, NotFoundError
from app.media.video import FrameReader
from app.video.index import RecordingIndex
from app.wording import plural

Image = npt.NDArray[np.uint8]

KEPT_BYTES = 96 * 2**20
"""Of decoded frames that a reader keeps: 23 of 1280 x 720 and red green blue, with 35 of 720p."""


def read_frames(
    path: Path, index: RecordingIndex, numbers: Iterable[int]
) -> Iterator[tuple[int, Image]]:
    """Frames of a recording, decoded in this process; quickest in ascending order.

    Args:
        path: The file.
        index: Its index.
        numbers: Of the frames wanted.

    Yields:
        The number and the frame: red green blue, upright, square pixels, shape (H, W, 3).

    Raises:
        NotFoundError: There is no frame of such a number.
        ImageError: The file is not a video that can be read any more, or another one by now.
    """
    with closing(RecordingReader(path, index, kept_bytes=0)) as reader:
        for number in numbers:
            yield number, reader.read(number)


class RecordingReader:
    """Reads frames of one recording, and keeps those that were decoded last.

    Args:
        path: The file.
        index: Its index.
        kept_bytes: How much of decoded frames is kept.
    """

    def __init__(self, path: Path, index: RecordingIndex, kept_bytes: int = KEPT_BYTES):
        self._path, self._index, self._most = path, index, kept_bytes
        facts = index.facts
        keys = None if facts.has_seek_table else index.keys
        self._reader = FrameReader(path, index.times, keys)
        self._kept: OrderedDict[int, Image] = OrderedDict()
        self._bytes = 0

    def close(self) -> None:
        """Close the file, and forget the frames."""
        self._reader.close()
        self._kept.clear()
        self._bytes = 0

    def read(self, number: int) -> Image:
        """A frame: red green blue, upright, square pixels, shape (H, W, 3).

        Raises:
            NotFoundError, ImageError: As ``read_frames`` does.
        """
        kept = self._kept.get(number)
        if kept is not None:
            self._kept.move_to_end(number)
            return kept
        image = self._decode_frame(number)
        self._cache_frame(number, image)
        return image

    def has(self, number: int) -> bool:
        """Whether a frame is among those that are kept."""
        return number in self._kept

    def step_towards_frame(self, number: int, most: int) -> bool:
        """Come nearer to a frame by so many frames at most, and decode it once it is the next; whether it is kept now.

        Raises:
            NotFoundError, ImageError: As ``read_frames`` does.
        """
        if not self.has(number):
            if not self._reader.approach_frame(number, most):
                return False
            self.read(number)
        return True

    def _decode_frame(self, number: int) -> Image:
        index = self._index
        if not 0 <= number < len(index):
            raise NotFoundError(
                f"{self._path.name} has no frame {number}; it has {plural(len(index), 'frame')}"
            )
        picture = self._reader.read(number)
        facts = index.facts
        if picture is None or picture.shape[:2] != (facts.coded_height, facts.coded_width):
            raise ImageError(
                f"frame {number} of {self._path.name} cannot be decoded",
                hint="Is the file still the one that was indexed?",
            )
        if (facts.width, facts.height) != (facts.coded_width, facts.coded_height):
            size = (facts.width, facts.height)
            picture = cv2.resize(picture, size, interpolation=cv2.INTER_CUBIC)
        return np.asarray(cv2.cvtColor(picture, cv2.COLOR_BGR2RGB), np.uint8)

    def _cache_frame(self, number: int, image: Image) -> None:
        self._kept[number] = image
        self._bytes += image.nbytes
        while self._bytes > self._most and self._kept:
            _, dropped = self._kept.popitem(last=False)
            self._bytes -= dropped.nbytes
