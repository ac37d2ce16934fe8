"""Frames of one camera by their numbers: those of its views, and those between them that are on disk.

Frames of a video are decoded together where they lie before each other, which costs as much as one of them.
"""

from __future__ import annotations

from collections import OrderedDict
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from pathlib import Path

import cv2
import numpy as np
import numpy.typing as npt

from app.config import Settings
from app.errors import ImageError, NotFoundError, StorageError, TooLargeError
from app.media.files import decode_frame, read_video_times, to_rgb_as_annotated
from app.media.frames import find_later_frame_file
from app.media.object_frames import is_in_object_store
from app.media.video import FrameReader
from app.soccer.frames import ImageSize
from app.soccer.group import Media

LONGEST_GAP = 250
"""Frames between two views beyond which those between are not looked for."""
BEHIND, KEPT, KEPT_BYTES = 16, 40, 256 * 2**20
"""How many frames of a video are decoded together where it goes backwards, how many are kept, and how large all may be:
1080p takes 6 MB a frame."""
Image = npt.NDArray[np.uint8]


@dataclass(frozen=True)
class ViewFrame:
    """The frame of a view of a camera that stands still.

    Attributes:
        number: Of its instant.
        group: Key of its group.
    """

    number: int
    group: str
    media: Media


def map_frames_by_number(views: Sequence[ViewFrame], settings: Settings) -> dict[int, Media]:
    """The frames of views, and those between them that are on disk, by number.

    Args:
        views: In the order of their numbers.
        settings: Where indices of videos are kept.
    """
    found = {view.number: view.media for view in views}
    for here, there in pairwise(views):
        gap = there.number - here.number
        if 1 < gap <= LONGEST_GAP:
            found |= dict(_find_frames_between(here, there, settings))
    return dict(sorted(found.items()))


def _find_frames_between(
    here: ViewFrame, there: ViewFrame, settings: Settings
) -> Iterator[tuple[int, Media]]:
    """Those between two views; none of a store, which would have to be asked for each."""
    media, gap = here.media, there.number - here.number
    if is_in_object_store(media):
        return
    if media.frame is not None:
        # Another rate of numbers than of frames leaves it open which frame is which.
        if there.media == replace(media, frame=media.frame + gap):
            for off in range(1, gap):
                yield here.number + off, replace(media, frame=media.frame + off)
        return
    for off in range(1, gap):
        between = find_later_frame_file(media, here.group, static=True, later=off)
        if between is not None:
            yield here.number + off, between


class CameraFrameReader:
    """Reads frames of a camera in the size that its annotations have.

    Args:
        media: Frames by number.
        flipped: Turn the mirrored pictures of this camera right.
        size: Of what is annotated.
        settings: Limits.
    """

    def __init__(
        self, media: Mapping[int, Media], flipped: bool, size: ImageSize, settings: Settings
    ):
        self._media, self._flipped, self._size, self._settings = media, flipped, size, settings
        self._kept: OrderedDict[int, Image] = OrderedDict()
        self._most = min(KEPT, max(KEPT_BYTES // (3 * size.width * size.height), 2))
        self._unreadable: set[int] = set()
        self._readers: dict[str, tuple[FrameReader, int]] = {}

    def read(self, number: int) -> Image:
        """A frame: red green blue, shape (H, W, 3).

        Raises:
            NotFoundError: There is none of this number, or its file is gone.
            ImageError, StorageError, TooLargeError: It cannot be read.
        """
        if number not in self._media:
            raise NotFoundError(f"there is no frame {number}")
        if number not in self._kept:
            # Backwards: those before it are on the way to it.
            back = number + 1 in self._kept and self._media[number].frame is not None
            behind = min(BEHIND, self._most)
            for each in range(number - behind + 1 if back else number, number):
                if each in self._media:
                    self._decode_and_cache(each)
            self._cache_frame(number, self._decode_by_number(number))
        return self._kept[number]

    def read_or_none(self, number: int) -> Image | None:
        """The same; None where there is none, and where it cannot be read, which ``unreadable`` names."""
        picture = self._call_or_none(self.read, number)
        if picture is None and number in self._media:
            self._unreadable.add(number)
        return picture

    @property
    def unreadable(self) -> tuple[int, ...]:
        """Numbers of the frames that ``read_or_none`` could not read although there are some."""
        return tuple(sorted(self._unreadable))

    def close(self) -> None:
        """Close the videos."""
        for reader, _ in self._readers.values():
            reader.close()

    def _decode_and_cache(self, number: int) -> None:
        picture = self._call_or_none(self._decode_by_number, number)
        if picture is not None:
            self._cache_frame(number, picture)

    @staticmethod
    def _call_or_none(read: Callable[[int], Image], number: int) -> Image | None:
        try:
            return read(number)
        except (NotFoundError, ImageError, StorageError, TooLargeError):
            return None

    def _cache_frame(self, number: int, picture: Image) -> None:
        self._kept[number] = picture
        while len(self._kept) > self._most:
            self._kept.popitem(last=False)

    def _decode_by_number(self, number: int) -> Image:
        media = self._media[number]
        if media.frame is None:
            picture = decode_frame(media, self._flipped, self._settings)
        else:
            found = self._get_video_reader(media).read(media.frame)
            if found is None:
                raise NotFoundError(
                    f"frame {media.frame} of {Path(media.path).name} cannot be decoded"
                )
            picture = to_rgb_as_annotated(found, self._flipped)
        size = self._size.width, self._size.height
        if picture.shape[1::-1] == size:
            return picture
        smaller = picture.shape[1] > size[0]
        how = cv2.INTER_AREA if smaller else cv2.INTER_LINEAR
        return np.asarray(cv2.resize(picture, size, interpolation=how), np.uint8)

    def _get_video_reader(self, media: Media) -> FrameReader:
        """What reads the frames of a video, which has this one."""
        if media.path not in self._readers:
            times = read_video_times(media, self._settings)
            self._readers[media.path] = FrameReader(Path(media.path), times), len(times)
        reader, count = self._readers[media.path]
        if not 0 <= (media.frame or 0) < count:
            raise NotFoundError(f"{Path(media.path).name} has no frame {media.frame}")
        return reader
