"""Frames of recordings, decoded in a worker process that stays warm between them."""

from __future__ import annotations

from collections import OrderedDict
from concurrent.futures import Future
from contextlib import suppress
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import cv2
import numpy as np

from app.config import Settings
from app.durable import replace_file
from app.errors import ConflictError, ImageError, OverloadedError, ReviewError
from app.features.recordings.index import read_index
from app.features.recordings.service import Recording
from app.json_text import digest_content
from app.media.files import JPEG_QUALITY
from app.media.frames import make_picture_error
from app.video.frames import Image, RecordingReader
from app.worker_pool import PoolTask, WorkerPool
from app.worker_process import COUNTS, WorkerEnded, WorkerLimits

LIMITS = WorkerLimits(memory=1536 * 2**20, processor=120.0, silence=120.0)
"""For one frame; where key frames are far apart, many are decoded on the way to it."""
WAITING = 64
"""Frames that may wait; one more is told to come back."""
BEHIND, MOST_BEHIND, AHEAD = 10, 64, 4
"""Frames that are decoded with one that is jumped to, so that steps back find them; those that are decoded together for
somebody who goes on backwards, as each of them is reached from its key frame; and frames that are decoded before somebody
asks, while one steps or plays."""
STEP = 6
"""Frames that are passed over at once on the way to one that nobody waits for: who asks meanwhile waits so long."""
THUMBNAIL = 320
"""Pixels of width up to which pictures are kept in the cache: a strip shows hundreds at once."""
MOST_OPEN = 2
"""Recordings that the process keeps open."""
KEPT_BYTES, READY_BYTES = 72 * 2**20, 24 * 2**20
"""Of the decoded frames of each, 27 of 720p and 12 of 1080p, and of the JPEGs that wait to be asked for. With all else the
process stays below 400 MB."""


class RecordingFrameDecoder:
    """Gives frames of recordings as JPEG."""

    def __init__(self, settings: Settings):
        self._settings = settings
        self._pool = WorkerPool(LIMITS, 1, WAITING, "frames", COUNTS["recordings"])

    def request_frame(self, recording: Recording, number: int, width: int | None) -> PoolTask:
        """Have a frame decoded; the future has a JPEG, or the errors of ``read_jpeg``.

        Args:
            recording: Of which recording.
            number: Of the frame, from 0.
            width: Wanted width in pixels; never enlarged. None: as it is.

        Raises:
            ConflictError: The recording cannot be read.
            OverloadedError: Too many wait.
        """
        sha256 = recording.require_readable()

        def explain(error: WorkerEnded) -> ReviewError:
            return make_picture_error(f"frame {number} of {recording.name}", error)

        asked = (recording.path, sha256, number, width, self._settings)
        return self._pool.submit(read_jpeg, *asked, explain=explain)

    def request_frames_beside(self, recording: Recording, number: int) -> None:
        """Have the frames beside one decoded, one after the other, as long as nobody waits for any."""
        if recording.sha256 is not None:
            self._continue_reading_ahead(recording.path, recording.sha256, number, self._settings)

    def _continue_reading_ahead(self, *asked: Any) -> None:
        def continue_when_done(done: Future[bool]) -> None:
            if not done.cancelled() and done.exception() is None and done.result():
                self._continue_reading_ahead(*asked)

        if self._pool.tasks == 0:
            with suppress(OverloadedError):
                self._pool.submit(read_ahead, *asked).future.add_done_callback(continue_when_done)

    def close(self) -> None:
        """End the process."""
        self._pool.close()


@dataclass
class _OpenRecording:
    """A recording that the process keeps open; the frame that was asked for last, its width, how many frames in a row it
    has gone that way (backwards: below 0), the frames that are decoded before somebody asks, in their order, and
    those that are, as JPEG."""

    reader: RecordingReader
    count: int
    last: int = -1
    width: int | None = None
    way: int = 1
    planned: list[int] = field(default_factory=list)
    ready: OrderedDict[tuple[int, int | None], bytes] = field(default_factory=OrderedDict)
    ready_bytes: int = 0

    def has_frame_ready(self, number: int) -> bool:
        """Whether a frame can be given at once."""
        return (number, self.width) in self.ready or self.reader.has(number)

    def cache_encoded_frame(self, number: int) -> None:
        """Keep a frame that is decoded as somebody will ask for it."""
        data = _encode_jpeg(self.reader.read(number), self.width)
        self.ready[number, self.width] = data
        self.ready_bytes += len(data)
        while self.ready_bytes > READY_BYTES:
            _, oldest = self.ready.popitem(last=False)
            self.ready_bytes -= len(oldest)


_OPEN: OrderedDict[tuple[str, str], _OpenRecording] = OrderedDict()
"""By path and sha256."""


def read_jpeg(path: Path, sha256: str, number: int, width: int | None, settings: Settings) -> bytes:
    """A frame as JPEG, in a worker process.

    Raises:
        ConflictError: The index of the recording is gone.
        ImageError: The frame cannot be decoded.
        NotFoundError: There is no frame of that number.
    """
    key = digest_content(repr((sha256, number, width, JPEG_QUALITY)).encode())
    place = settings.cache / "frames" / key[:2] / f"{key[2:]}.jpg"
    is_small = width is not None and width <= THUMBNAIL
    if is_small:
        with suppress(OSError):
            return place.read_bytes()
    data = _read_frame_jpeg(path, sha256, number, width, settings)
    if is_small:
        # A full disk costs the cache and no picture.
        with suppress(OSError):
            place.parent.mkdir(mode=0o700, parents=True, exist_ok=True)
            replace_file(place, data, durable=False)
    return data


def read_ahead(path: Path, sha256: str, number: int, settings: Settings) -> bool:
    """Come one step nearer to what is asked for next, if it goes on as it did; whether there is more to do."""
    with suppress(ConflictError, ImageError):
        found = _open_recording(path, sha256, settings)
        if found.way > 0:
            following = range(number + 1, min(number + 1 + AHEAD, found.count))
            found.planned = [one for one in following if not found.has_frame_ready(one)]
        elif not found.planned:
            together = min(max(BEHIND, -found.way), MOST_BEHIND)
            before = max(number - together // 2, 0)
            if not found.has_frame_ready(before):
                asked_next = range(max(before - together, 0), max(number, 1))
                found.planned = [one for one in asked_next if not found.has_frame_ready(one)]
        if found.planned and found.reader.step_towards_frame(found.planned[0], STEP):
            found.cache_encoded_frame(found.planned.pop(0))
        return bool(found.planned)
    return False


def _read_frame_jpeg(
    path: Path, sha256: str, number: int, width: int | None, settings: Settings
) -> bytes:
    found = _open_recording(path, sha256, settings)
    follows = 0 < number - found.last <= 2 * AHEAD
    found.width = width
    is_kept = found.has_frame_ready(number)
    way = 1 if number >= found.last else -1
    if way * found.way < 0 or not (follows or is_kept):
        found.planned.clear()
        found.way = 0
    if not follows and not is_kept:
        _decode_up_to_frame(found.reader, number)
    found.way, found.last = found.way + way, number
    ready = found.ready.get((number, width))
    return _encode_jpeg(found.reader.read(number), width) if ready is None else ready


def _decode_up_to_frame(reader: RecordingReader, number: int) -> None:
    """Decode a frame with those before it, which costs little more than to find that one."""
    for before in range(max(number - BEHIND, 0), number + 1):
        reader.read(before)


def _open_recording(path: Path, sha256: str, settings: Settings) -> _OpenRecording:
    key = (str(path), sha256)
    if key not in _OPEN:
        index = read_index(settings, sha256)
        _OPEN[key] = _OpenRecording(RecordingReader(path, index, KEPT_BYTES), len(index))
        while len(_OPEN) > MOST_OPEN:
            _, oldest = _OPEN.popitem(last=False)
            oldest.reader.close()
    _OPEN.move_to_end(key)
    return _OPEN[key]


def _encode_jpeg(image: Image, width: int | None) -> bytes:
    height, present = image.shape[:2]
    if width is not None and width < present:
        size = (max(width, 1), max(round(height * width / present), 1))
        image = np.asarray(cv2.resize(image, size, interpolation=cv2.INTER_AREA), np.uint8)
    done, data = cv2.imencode(".jpg", image[:, :, ::-1], [cv2.IMWRITE_JPEG_QUALITY, JPEG_QUALITY])
    if not done:
        raise ImageError("the frame cannot be encoded as JPEG")
    return bytes(data)
