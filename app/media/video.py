"""Videos: opened as files of known containers.

An index says when each frame is shown, so that a frame is found again exactly.
"""

from __future__ import annotations

import hashlib
import os
import resource
import shlex
import subprocess
import sys
from collections import OrderedDict
from collections.abc import Callable, Iterator, Sequence
from contextlib import ExitStack, closing, contextmanager, suppress
from io import BytesIO
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import numpy.typing as npt

from app.config import Settings
from app.durable import replace_file
from app.errors import ImageError, OverloadedError, TooLargeError
from app.worker_process import set_resource_limit

_CONTAINERS = "mov,mp4,m4a,3gp,3g2,mj2,matroska,webm,avi,mpegts,mpeg,asf,flv,ogg"
"""By FFmpeg's names. Those that are left out include playlists (concat, hls): their files could
be anywhere."""
# What is wrong with a file is said in our words: the libraries' own would stand between them.
os.environ.setdefault("OPENCV_FFMPEG_LOGLEVEL", "-8")
cv2.utils.logging.setLogLevel(cv2.utils.logging.LOG_LEVEL_ERROR)
_OPTIONS = f"format_whitelist;{_CONTAINERS}|protocol_whitelist;file"


@contextmanager
def open_video(path: Path, options: Sequence[int] = ()) -> Iterator[cv2.VideoCapture]:
    """A video, opened or not (``isOpened``), and closed again.

    Args:
        path: The file.
        options: Properties of OpenCV and their values, one after the other.
    """
    # Read by OpenCV at each opening. No other backend: one of them takes "%d" in a name for a
    # row of files.
    os.environ["OPENCV_FFMPEG_CAPTURE_OPTIONS"] = _OPTIONS
    video = cv2.VideoCapture(str(path), cv2.CAP_FFMPEG, list(options))
    try:
        yield video
    finally:
        video.release()


_PROBED, _PROBE_SECONDS, _PROBE_BYTES = 50, 45, 1024 * 2**20
"""Frames that a probe decodes, and what it may use at most."""
_PROBE = (
    "import sys; from app.media.video import decode_some_frames; decode_some_frames(*sys.argv[1:])"
)
_TWO_FIELDS = b"Cannot convert interlaced"


def require_progressive_start(path: Path) -> None:
    """``require_progressive`` where the first two pictures of a video are the same one.

    Raises:
        ImageError, OverloadedError: As it does; ``ImageError`` too where it is not a video that can be read.
    """
    with _open_video(path) as video:
        first = [_retrieve_frame(video) for _ in range(2) if video.grab()]
    if len(first) == 2 and np.array_equal(*first):
        require_progressive(path)


def require_progressive(path: Path, start: float = 0.0) -> None:
    """Raise where OpenCV cannot convert the pictures of a video, as they are interlaced: it then returns the picture
    before once more, and only FFmpeg's log says so. A process of its own writes that log.

    Args:
        path: The video.
        start: Where to look at it, milliseconds.

    Raises:
        ImageError: They are.
        OverloadedError: The process did not end in time.
    """
    more = {"OPENCV_FFMPEG_LOGLEVEL": "16", "PYTHONPATH": os.pathsep.join(sys.path)}
    command = [sys.executable, "-c", _PROBE, str(path), str(start)]
    try:
        log = subprocess.run(
            command,
            env=os.environ | more,
            stdin=subprocess.DEVNULL,
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            timeout=_PROBE_SECONDS,
            check=False,
        ).stdout
    except (OSError, subprocess.TimeoutExpired) as error:
        raise OverloadedError(
            f"the frames of {path.name} could not be checked", hint="Try again in a moment."
        ) from error
    if _TWO_FIELDS in log:
        raise ImageError(
            f"{path.name} is interlaced (two fields a frame), and its pictures cannot be read",
            hint="Make it progressive, then import the result:"
            f" ffmpeg -i {shlex.quote(path.name)} -vf bwdif {_describe_conversion(path)}",
        )


def decode_some_frames(path: str, start: str) -> None:
    """The work of that process, which has limits and inherits those of its parent."""
    set_resource_limit(resource.RLIMIT_CPU, _PROBE_SECONDS)
    set_resource_limit(resource.RLIMIT_DATA, _PROBE_BYTES)
    with open_video(Path(path)) as video:
        if float(start) > 0:
            video.set(cv2.CAP_PROP_POS_MSEC, float(start))
        for _ in range(_PROBED):
            if video.grab():
                video.retrieve()


def _describe_conversion(path: Path) -> str:
    """How FFmpeg is told to write a video that every decoder reads."""
    return f"-c:v libx264 -crf 16 {shlex.quote(f'{path.stem}-converted.mp4')}"


def make_undecodable_error(path: Path, video: cv2.VideoCapture) -> ImageError:
    """What is said of an open video of which no frame can be decoded."""
    four = (int(video.get(cv2.CAP_PROP_FOURCC)) & 0xFFFFFFFF).to_bytes(4, "little")
    codec = four.decode("ascii", "replace").strip("\0 ").upper()
    known = f" (codec {'AV1' if codec == 'AV01' else codec})" if codec.isalnum() else ""
    return ImageError(
        f"{path.name} has no frame that can be decoded{known}",
        hint="Convert it, then import the result:"
        f" ffmpeg -i {shlex.quote(path.name)} {_describe_conversion(path)}",
    )


MOST_DAMAGED = 500
"""Pictures in a row that may be damaged; the end of a video is where no more come than that."""


def grab_next_frame_counting_damaged(video: cv2.VideoCapture) -> int | None:
    """Grab the next frame that can be decoded.

    Returns:
        How many damaged ones were passed over on the way; None: there is no frame any more.
    """
    return next((count for count in range(MOST_DAMAGED + 1) if video.grab()), None)


MAX_FRAMES = 2_000_000
"""Frames of one video; eleven hours at 50 a second."""
_A_WORD = 250
"""Frames between two words of how far the decoding is: about a second of 1080p."""
_VERSION = 2
_MARGINS = (32, 256)
"""Frames before the one that is sought from which decoding starts: behind a jump some decoders return
frames whose references they have not seen."""
_SAME_TIME = 1e-5
"""Milliseconds; the finest time bases of containers tick a hundred times as slowly."""

Times = npt.NDArray[np.float64]
"""Presentation time of each frame as the decoder returns them, milliseconds, shape (N,)."""
_MOST_REMEMBERED = 8
"""Videos; each takes 16 MiB at most."""
_REMEMBERED: OrderedDict[str, Times] = OrderedDict()
"""Indices that the disk refused, by the stamps of their videos."""


def make_index(
    path: Path, stamp: str, settings: Settings, tell: Callable[[int], None] | None = None
) -> Times:
    """When each frame of a video is shown: decodes it all, and keeps the index in the cache.

    Where the disk refuses it, it is remembered by this process.

    Args:
        path: The video.
        stamp: Name of its content: another video under the same path has another one.
        settings: The folder of the cache.
        tell: Called every now and then with how many frames are decoded; what it raises ends it.

    Raises:
        ImageError: It is not a video that can be read.
        TooLargeError: It has more frames than ``MAX_FRAMES``.
    """
    times = _decode_times(path, tell)
    content = BytesIO()
    np.save(content, times, allow_pickle=False)
    place = _index_path(stamp, settings)
    # A full disk costs the cache and no frame.
    try:
        place.parent.mkdir(mode=0o700, parents=True, exist_ok=True)
        replace_file(place, content.getvalue())
    except OSError:
        remember_index(stamp, times)
    return times


def remember_index(stamp: str, times: Times) -> None:
    """Keep an index in this process, which the disk refuses."""
    _REMEMBERED[stamp] = times
    while len(_REMEMBERED) > _MOST_REMEMBERED:
        _REMEMBERED.popitem(last=False)


def get_remembered_index(stamp: str) -> Times | None:
    """The index of a video that this process remembers."""
    return _REMEMBERED.get(stamp)


def read_cached_index(stamp: str, settings: Settings) -> Times | None:
    """The index of a video that was decoded before; None where there is none."""
    if (remembered := get_remembered_index(stamp)) is not None:
        return remembered
    with suppress(OSError, ValueError, EOFError):
        times: Times = np.load(_index_path(stamp, settings), allow_pickle=False)
        if times.dtype == np.float64 and times.ndim == 1:
            return times
    return None


def read_frame_at(path: Path, number: int, times: Times) -> Any:
    """The frame of that number, or None where it cannot be decoded.

    Args:
        path: The video.
        number: From 0, below ``len(times)``.
        times: Index of the video.

    Raises:
        ImageError: It is not a video that can be read.
    """
    with closing(FrameReader(path, times)) as reader:
        return reader.read(number)


class FrameReader:
    """Reads frames of one video by their numbers; frames that follow each other are not sought anew.

    Args:
        path: The video.
        times: Index of the video.
        keys: Numbers of the key frames, ascending, of a container that has no table of them: a jump
            is then believed only where a key frame lies between it and the frame. None: it has one.
    """

    def __init__(self, path: Path, times: Times, keys: npt.NDArray[np.int64] | None = None):
        self._path, self._times, self._keys = path, times, keys
        self._video: cv2.VideoCapture | None = None
        self._next = 0
        self._sought: int | None = None
        self._opening: ExitStack | None = None

    def close(self) -> None:
        """Close the video."""
        if self._opening is not None:
            self._opening.close()
        self._opening = self._video = None

    def read(self, number: int) -> Any:
        """The frame of that number, blue green red, or None where it cannot be decoded.

        Args:
            number: From 0, below ``len(times)``.

        Raises:
            ImageError: It is not a video that can be read.
        """
        self._sought = None
        if self._video is not None and self._next <= number <= self._next + _MARGINS[0]:
            if self._decode_up_to(number):
                return _retrieve_frame(self._video)
        elif number > _MARGINS[0]:
            for start in self._list_seek_starts(number):
                if self._seek_to_frame(start, number):
                    return _retrieve_frame(self._video)
        # Opened anew: sent back to its start, a decoder may land behind the first frame.
        self.close()
        video = self._ensure_open()
        while self._next <= number:
            if grab_next_frame_counting_damaged(video) is None:
                self.close()
                return None
            self._next += 1
        return _retrieve_frame(video)

    def approach_frame(self, number: int, most: int) -> bool:
        """Come nearer to a frame, by a jump or by so many frames at most: between two steps others may be asked for.

        Returns:
            Whether ``read`` finds it at once now, or has to open the video anew.

        Raises:
            ImageError: It is not a video that can be read.
        """
        near = self._video is not None and self._next <= number <= self._next + _MARGINS[0]
        if self._sought != number and not near:
            if number <= _MARGINS[0]:
                return True
            if not any(
                self._seek_near_frame(start, number) for start in self._list_seek_starts(number)
            ):
                self.close()
                return True
        self._sought = number
        # That frame itself is left to ``read``.
        if self._next + most < number:
            if self._decode_up_to(self._next + most - 1):
                return False
            self.close()
        elif self._next < number and not self._decode_up_to(number - 1):
            self.close()
        self._sought = None
        return True

    def skip(self) -> bool:
        """Pass over the frame that follows the one read last; whether there is one."""
        if self._video is None or grab_next_frame_counting_damaged(self._video) is None:
            return False
        self._next += 1
        return True

    def _ensure_open(self) -> cv2.VideoCapture:
        if self._video is None:
            self._opening = ExitStack()
            self._video = self._opening.enter_context(_open_video(self._path))
            self._next = 0
        return self._video

    def _find_key_frame_before(self, number: int, keys: npt.NDArray[np.int64]) -> int:
        return int(keys[max(int(np.searchsorted(keys, number, "right")) - 1, 0)])

    def _list_seek_starts(self, number: int) -> list[int]:
        """Frames to jump to on the way to another one, the nearest first."""
        nearest = number if self._keys is None else self._find_key_frame_before(number, self._keys)
        starts = [nearest - margin for margin in _MARGINS if nearest > margin]
        return starts if self._keys is None or nearest == number else [nearest, *starts]

    def _seek_to_frame(self, start: int, number: int) -> bool:
        """Go to a frame from about another one; whether every frame on the way came when it should."""
        return self._seek_near_frame(start, number) and self._decode_up_to(number)

    def _seek_near_frame(self, start: int, number: int) -> bool:
        """Go to about a frame on the way to another one; whether it is known which one this is."""
        video = self._ensure_open()
        video.set(cv2.CAP_PROP_POS_MSEC, self._times[start])
        if grab_next_frame_counting_damaged(video) is None:
            return False
        places = np.flatnonzero(_is_same_time(self._times, video.get(cv2.CAP_PROP_POS_MSEC)))
        # Where the jump led too far, or two frames have one time, nothing says which one this is.
        if len(places) != 1:
            return False
        place, latest = int(places[0]), number - _MARGINS[0] // 2
        if self._keys is not None:
            latest = self._find_key_frame_before(number, self._keys)
        if place > latest:
            return False
        self._next = place + 1
        return True

    def _decode_up_to(self, number: int) -> bool:
        """Decode on to a frame; whether every frame on the way came when it should."""
        video = self._ensure_open()
        while self._next <= number:
            gone = grab_next_frame_counting_damaged(video) is None
            if gone or not _is_same_time(self._times[self._next], video.get(cv2.CAP_PROP_POS_MSEC)):
                return False
            self._next += 1
        return True


@contextmanager
def _open_video(path: Path) -> Iterator[cv2.VideoCapture]:
    with open_video(path) as video:
        if not video.isOpened():
            raise ImageError(f"{path.name} is not a video that can be read")
        yield video


def _is_same_time(time: Any, other: float) -> Any:
    """Whether times are the same, in milliseconds; an index may keep them as fractions."""
    return np.abs(time - other) < _SAME_TIME


def _retrieve_frame(video: Any) -> Any:
    done, picture = video.retrieve()
    return picture if done else None


def _decode_times(path: Path, tell: Callable[[int], None] | None) -> Times:
    times: list[float] = []
    require_progressive_start(path)
    with _open_video(path) as video:
        while grab_next_frame_counting_damaged(video) is not None:
            times.append(video.get(cv2.CAP_PROP_POS_MSEC))
            if len(times) > MAX_FRAMES:
                raise TooLargeError(f"{path.name} has more than {MAX_FRAMES:,} frames")
            if tell is not None and len(times) % _A_WORD == 0:
                tell(len(times))
        if not times:
            raise make_undecodable_error(path, video)
    return np.array(times)


def _index_path(stamp: str, settings: Settings) -> Path:
    """Where the index of a video is kept."""
    # Another decoder may return other frames.
    key = repr((stamp, _VERSION, cv2.__version__))
    return settings.cache / "videos" / f"{hashlib.sha256(key.encode()).hexdigest()[:32]}.npy"
