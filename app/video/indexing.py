"""Indexing: reads a recording once, frame after frame, and keeps what is small of each."""

from __future__ import annotations

import hashlib
import struct
from collections.abc import Callable
from contextlib import closing
from math import gcd
from pathlib import Path
from typing import Any, BinaryIO

import cv2
import numpy as np

from app.config import Settings
from app.errors import ImageError, TooLargeError
from app.geometry.arrays import FloatArray, IntArray
from app.media.images import ImageHeader, check_size
from app.media.video import (
    MAX_FRAMES,
    FrameReader,
    grab_next_frame_counting_damaged,
    make_undecodable_error,
    open_video,
    require_progressive,
    require_progressive_start,
)
from app.video.index import RecordingFacts, RecordingIndex, find_time_base
from app.video.measures import (
    COMB_EVERY,
    COMB_SHARE,
    COMBED,
    FrameMeasurer,
    GrowingMeasures,
    measure_combing,
)

_A_WORD = 100
"""Frames between two words of how far the decoding is."""
_BLOCK = 4 * 2**20
_MOST_ASPECT = 8
"""Pixels wider or higher than that are a mistake of the container."""
_BEFORE_END = 20
"""Frames between the end of a file and a jump into it."""
_LEAST_MOVING = 5
"""Frames that move, of those that are looked at for combs."""
_MOST_STILL = 0.2
"""Share of frames without any change from the one before, beyond which they may be interlaced ones that cannot
be read."""
_MOVING = 3.0
"""Mean change from the frame before, grey levels, of a frame that moves."""


def index_recording(
    path: Path, settings: Settings, tell: Callable[[int, int | None], object] | None = None
) -> RecordingIndex:
    """The index of a recording: decodes it all, in this process.

    Args:
        path: The file.
        settings: Limits on the size of pictures.
        tell: Called every now and then with how many frames are decoded and about how many there
            are (None: not known); what it raises ends it.

    Raises:
        ImageError: It is not a video that can be read, or a part of its file is missing.
        TooLargeError: Its frames are larger than the limits, or too many.
    """
    _require_complete_file(path)
    return _build_index(path, hash_file(path), settings, tell)


def index_without_measuring(path: Path) -> RecordingIndex:
    """The index of a video whose pictures are not measured and whose content has no digest: enough to read its
    frames exactly. Decodes it all, in this process.

    Raises:
        ImageError: It is not a video that can be read.
        TooLargeError: It has too many frames.
    """
    return _build_index(path, ("", path.stat().st_size if path.is_file() else 0), None, None)


def _build_index(
    path: Path,
    content: tuple[str, int],
    settings: Settings | None,
    tell: Callable[[int, int | None], object] | None,
) -> RecordingIndex:
    """The index of a video of a content (sha256, bytes); without settings nothing is measured."""
    sha256, size = content
    rows, combs = GrowingMeasures(), list[float]()
    times, intra, damaged = list[float](), list[bool](), 0
    with open_video(path) as video:
        if not video.isOpened():
            raise ImageError(f"{path.name} is not a video that can be read")
        coded = _read_coded_size(video)
        if settings is not None:
            check_size(ImageHeader("video", *coded), settings, path.name)
        require_progressive_start(path)
        rotation = int(video.get(cv2.CAP_PROP_ORIENTATION_META)) % 360
        aspect = read_pixel_aspect(video, rotation)
        measurer = FrameMeasurer(video.get(cv2.CAP_PROP_FPS))
        total = int(video.get(cv2.CAP_PROP_FRAME_COUNT))
        while (skipped := grab_next_frame_counting_damaged(video)) is not None:
            damaged += skipped
            row, before = rows.append_row()
            if settings is not None:
                done, picture = video.retrieve()
                if not done:
                    raise ImageError(f"frame {len(times)} of {path.name} cannot be decoded")
                _require_constant_size(picture, coded, len(times), path)
                measurer.measure(np.asarray(picture, np.uint8), row, before)
                if len(times) % COMB_EVERY == COMB_EVERY - 1 and row["change"] > _MOVING:
                    combs.append(measure_combing(np.asarray(picture, np.uint8)))
            times.append(video.get(cv2.CAP_PROP_POS_MSEC))
            intra.append(video.get(cv2.CAP_PROP_FRAME_TYPE) == ord("I"))
            if len(times) > MAX_FRAMES:
                raise TooLargeError(f"{path.name} has more than {MAX_FRAMES:,} frames")
            if tell is not None and len(times) % _A_WORD == 0:
                tell(len(times), max(total, len(times)) if total > 0 else None)
        if not times:
            raise make_undecodable_error(path, video)
    still = np.flatnonzero(rows.get_measured_rows()["change"][1:] == 0)
    if settings is not None and len(still) > _MOST_STILL * len(times):
        require_progressive(path, times[still[len(still) // 2]])
    shown = _repair_last_time(np.array(times))
    _require_consistent_seek(path, shown)
    base, pts = find_time_base(shown)
    width, height = _compute_square_pixel_size(coded, aspect)
    facts = RecordingFacts(
        sha256=sha256,
        bytes=size,
        width=width,
        height=height,
        coded_width=coded[0],
        coded_height=coded[1],
        rotation=rotation,
        pixel_aspect=aspect,
        interlaced=_is_interlaced(combs),
        time_base=base,
        has_seek_table=_has_seek_table(path),
        decoder=f"OpenCV {cv2.__version__}",
        damaged=damaged,
    )
    return RecordingIndex(
        facts,
        pts,
        _find_key_frames(shown, _read_key_frame_times(path), np.array(intra)),
        rows.get_measured_rows(),
    )


def hash_file(path: Path, stop: Callable[[], object] = lambda: None) -> tuple[str, int]:
    """SHA-256 and size of a file; ``stop`` is called every now and then, what it raises ends it."""
    digest, size = hashlib.sha256(), 0
    with path.open("rb") as file:
        while block := file.read(_BLOCK):
            stop()
            digest.update(block)
            size += len(block)
    return digest.hexdigest(), size


def _read_coded_size(video: cv2.VideoCapture) -> tuple[int, int]:
    return int(video.get(cv2.CAP_PROP_FRAME_WIDTH)), int(video.get(cv2.CAP_PROP_FRAME_HEIGHT))


def _require_constant_size(picture: Any, coded: tuple[int, int], number: int, path: Path) -> None:
    height, width = picture.shape[:2]
    if (width, height) != coded:
        raise ImageError(
            f"frame {number} of {path.name} has {width} x {height} pixels, but the frames"
            f" before it have {coded[0]} x {coded[1]}",
            hint="Split the recording there: all frames of a recording must have one size.",
        )


def read_pixel_aspect(video: cv2.VideoCapture, rotation: int) -> tuple[int, int]:
    """Width of a pixel by its height, as decoded and turned upright."""
    over, under = (int(video.get(name)) for name in (cv2.CAP_PROP_SAR_NUM, cv2.CAP_PROP_SAR_DEN))
    if over <= 0 or under <= 0 or not 1 / _MOST_ASPECT <= over / under <= _MOST_ASPECT:
        return 1, 1
    if rotation in (90, 270):
        over, under = under, over
    common = gcd(over, under)
    return over // common, under // common


def _compute_square_pixel_size(coded: tuple[int, int], aspect: tuple[int, int]) -> tuple[int, int]:
    """Size with square pixels; nothing becomes smaller."""
    width, height = coded
    over, under = aspect
    if over >= under:
        return round(width * over / under), height
    return width, round(height * under / over)


def _read_key_frame_times(path: Path) -> FloatArray:
    """Times of the key frames in milliseconds, without decoding anything."""
    found = []
    with open_video(path, [cv2.CAP_PROP_FORMAT, -1]) as packets:
        while packets.grab():
            if packets.get(cv2.CAP_PROP_LRF_HAS_KEY_FRAME):
                found.append(packets.get(cv2.CAP_PROP_POS_MSEC))
    return np.array(found)


def _find_key_frames(times: FloatArray, key_times: FloatArray, intra: Any) -> IntArray:
    """Numbers of the key frames: those that the container marks, and that are coded by themselves.

    Where an edit leaves the first packets out, times of packets begin earlier than those of frames;
    then what is coded by itself decides.
    """
    marked = np.isin(np.rint(times * 1000), np.rint(key_times * 1000)) & intra
    return np.flatnonzero(marked if marked.sum() * 2 > len(key_times) else intra).astype(np.int64)


def _repair_last_time(times: FloatArray) -> FloatArray:
    """Times where the last frame of a stream may have none, which then reads as 0."""
    if len(times) > 2 and times[-1] == 0 and times[-2] > 0:
        times[-1] = 2 * times[-2] - times[-3]
    return times


def _require_consistent_seek(path: Path, times: FloatArray) -> None:
    """Raise where a jump leads to other frames: times of an AVI are counted, before damage and behind it
    not alike."""
    with path.open("rb") as file:
        if file.read(4) != b"RIFF":
            return
    with closing(FrameReader(path, times)) as reader:
        reader.read(max(len(times) - _BEFORE_END, 0))
        follow = sum(reader.skip() for _ in range(2 * _BEFORE_END))
    if follow != min(len(times), _BEFORE_END) - 1:
        raise ImageError(
            f"{path.name} is damaged: its frame table lists other frames than the file contains",
            hint="Repair the file with a tool of your recorder, or convert it to MP4 or MKV.",
        )


def _is_interlaced(combs: list[float]) -> bool | None:
    if len(combs) < _LEAST_MOVING:
        return None
    return bool(np.mean(np.array(combs) > COMB_SHARE) > COMBED)


_UNINDEXED = (b"\x47", b"\x00\x00\x01\xba")
"""How MPEG transport and program streams begin: they have no table of key frames."""


def _has_seek_table(path: Path) -> bool:
    with path.open("rb") as file:
        return not file.read(4).startswith(_UNINDEXED)


def _require_complete_file(path: Path) -> None:
    """Raise where a file ends before its own headers say: the rest of a copy is missing.

    Raises:
        ImageError: It does, is empty, or cannot be read.
    """
    try:
        size = path.stat().st_size
        if not size:
            raise ImageError(f"{path.name} is empty")
        with path.open("rb") as file:
            declared = _read_declared_size(file, size)
    except OSError as error:
        raise ImageError(f"{path.name} cannot be read ({error.strerror})") from error
    if declared > size:
        raise ImageError(
            f"{path.name} is cut off: {size:,} of its {declared:,} bytes are there",
            hint="Copy the file again, or repair it with a tool of your recorder.",
        )


def _read_declared_size(file: BinaryIO, size: int) -> int:
    """Size that MP4, AVI and Matroska files declare, bytes; of others, and where they say none, 0."""
    head = file.read(12)
    if head[:4] == b"RIFF" and head[8:] == b"AVI ":
        return 8 + int.from_bytes(head[4:8], "little")
    if head[:4] == b"\x1a\x45\xdf\xa3":
        return _read_matroska_size(file)
    place = 0
    if head[4:8] not in _FIRST_BOXES:
        return 0
    while head[4:8].isalnum() and place < size:
        file.seek(place)
        head = file.read(16)
        if len(head) < 8:
            return place + 8
        (length,) = struct.unpack(">I", head[:4])
        if length == 1 and len(head) == 16:
            (length,) = struct.unpack(">Q", head[8:])
        if length < 8:
            return place
        place += length
    return place


_FIRST_BOXES = (b"ftyp", b"moov", b"mdat", b"free", b"skip", b"wide", b"styp")
"""With which MP4 and QuickTime files begin."""


def _read_matroska_size(file: BinaryIO) -> int:
    file.seek(4)
    place = 4
    for identity in (b"", b"\x18\x53\x80\x67"):
        file.seek(place)
        if file.read(len(identity)) != identity:
            return 0
        first = file.read(1)
        if not first or not first[0]:
            return 0
        length = 9 - first[0].bit_length()
        value = int.from_bytes(bytes([first[0] & (0xFF >> length)]) + file.read(length - 1), "big")
        place += len(identity) + length + value
        # All ones: the size is not known.
        if value == (1 << 7 * length) - 1:
            return 0
    return place
