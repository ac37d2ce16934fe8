"""Videos whose frames carry their number in their pixels, with the times that a test wants."""

from __future__ import annotations

import re
import struct
from collections.abc import Callable, Iterable, Iterator, Sequence
from pathlib import Path

import cv2
import numpy as np

WIDTH, HEIGHT = 160, 96
_BITS = 10
_TIMES = (b"moov", b"trak", b"mdia", b"minf", b"stbl", b"stts")
_DESCRIPTIONS = (b"moov", b"trak", b"mdia", b"minf", b"stbl", b"stsd")
_EDITS = (b"moov", b"trak", b"edts")


def write_video(path: Path, codec: str, count: int = 200, rate: float = 25) -> Path:
    """A video of numbered frames at a constant rate.

    Args:
        path: Its ending says the container.
        codec: Four letters; ``MPG2`` has B-frames and a key frame every twelve.
    """
    return write_pictures(path, codec, map(numbered, range(count)), rate)


def write_pictures(
    path: Path, codec: str, pictures: Iterable[np.ndarray], rate: float = 25
) -> Path:
    """A video of these pictures, blue green red and of one size, at a constant rate."""
    video = None
    for picture in pictures:
        if video is None:
            height, width = picture.shape[:2]
            four = cv2.VideoWriter_fourcc(*codec)
            video = cv2.VideoWriter(str(path), four, rate, (width, height))
            assert video.isOpened()
        video.write(picture)
    assert video is not None
    video.release()
    return path


def numbered(number: int) -> np.ndarray:
    """A picture that shows a number below 1024 as bright blocks, and something that moves."""
    picture = np.full((HEIGHT, WIDTH, 3), 40, np.uint8)
    for bit in range(_BITS):
        if number >> bit & 1:
            picture[8:40, 8 + bit * 14 : 20 + bit * 14] = 220
    picture[60:80, number * 3 % WIDTH : number * 3 % WIDTH + 10] = (200, 60, 90)
    return picture


def number_of(picture: np.ndarray) -> int:
    """The number that a picture shows."""
    blocks = [picture[14:34, 10 + bit * 14 : 16 + bit * 14, 1].mean() for bit in range(_BITS)]
    return sum((block > 130) << bit for bit, block in enumerate(blocks))


def vary_times(path: Path, ticks: Sequence[int]) -> Path:
    """Give every frame of an MP4 a duration of its own, in its time scale (512 was each at 25 Hz)."""
    data = path.read_bytes()
    table = b"".join(struct.pack(">II", 1, tick) for tick in ticks)
    data = _replaced(data, _TIMES, _box(b"stts", struct.pack(">II", 0, len(ticks)) + table))
    start, end = _place(data, _EDITS)
    edits = data[start:end]
    # The only edit ended with the last frame; now that is later.
    data = _replaced(data, _EDITS, edits[:24] + struct.pack(">I", 10**6) + edits[28:])
    path.write_bytes(data)
    return path


def delay_start(path: Path, milliseconds: int) -> Path:
    """Let an MP4 begin with an empty edit: its first frame is shown later."""
    data = path.read_bytes()
    start, _ = _place(data, _EDITS)
    (media_time,) = struct.unpack(">i", data[start + 28 : start + 32])
    entries = struct.pack(">IiI", milliseconds, -1, 0x10000)
    entries += struct.pack(">IiI", 10**6, media_time, 0x10000)
    edits = _box(b"edts", _box(b"elst", struct.pack(">II", 0, 2) + entries))
    path.write_bytes(_replaced(data, _EDITS, edits))
    return path


def turn(path: Path, degrees: int) -> Path:
    """Let an MP4 say that its frames are to be turned clockwise: 90, 180 or 270."""
    data = bytearray(path.read_bytes())
    start, _ = _place(bytes(data), (b"moov", b"trak", b"tkhd"))
    cosine, sine = {90: (0, 1), 180: (-1, 0), 270: (0, -1)}[degrees]
    one = 0x10000
    matrix = (cosine * one, sine * one, 0, -sine * one, cosine * one, 0, 0, 0, 0x40000000)
    data[start + 48 : start + 84] = struct.pack(">9i", *matrix)
    path.write_bytes(data)
    return path


def stretch_pixels(path: Path, over: int, under: int) -> Path:
    """Let an MP4 say how wide its pixels are by their height."""
    data = path.read_bytes()
    start, end = _place(data, _DESCRIPTIONS)
    (kind, _, _), *_ = _boxes(data, start + 16, end)
    described = data[start + 24 : end] + _box(b"pasp", struct.pack(">II", over, under))
    descriptions = _box(b"stsd", data[start + 8 : start + 16] + _box(kind, described))
    path.write_bytes(_replaced(data, _DESCRIPTIONS, descriptions))
    return path


def mark_interlaced(path: Path, since: int = 0) -> Path:
    """Let an MPEG-2 video say that its frames hold two fields, from the picture on that is coded as that number."""
    data = bytearray(path.read_bytes())
    for one in re.finditer(rb"\x00\x00\x01\xb5[\x10-\x1f]", data):
        data[one.end()] &= 0xF7
    for one in [*re.finditer(rb"\x00\x00\x01\xb5[\x80-\x8f]", data)][since:]:
        data[one.end() + 3] &= 0x7F
    path.write_bytes(data)
    return path


def unmark_key_frames(path: Path) -> Path:
    """Let an MP4 say that its first frame alone is a key frame."""
    data = path.read_bytes()
    table = struct.pack(">III", 0, 1, 1)
    path.write_bytes(_replaced(data, (*_TIMES[:-1], b"stss"), _box(b"stss", table)))
    return path


def replace_boxes(path: Path, make: Callable[[bytes, bytes], bytes]) -> Path:
    """Give an MP4 other tables of its samples; it lasts as long as they say.

    Args:
        path: The file, whose tables come behind its pictures.
        make: From the kind of a table (``stts``, ``stss``, ``stsc``, ``stsz``, ``stco``) and what it
            holds to what it shall hold.
    """
    data = path.read_bytes()
    for kind in (b"stsc", b"stss", b"stsz", b"stts", b"stco"):
        start, end = _place(data, (*_TIMES[:-1], kind))
        table = _box(kind, make(kind, data[start + 8 : end]))
        data = _replaced(data, (*_TIMES[:-1], kind), table)
    start, end = _place(data, _EDITS)
    edits = data[start:end]
    data = _replaced(data, _EDITS, edits[:24] + struct.pack(">I", 10**8) + edits[28:])
    path.write_bytes(data)
    return path


def _box(kind: bytes, body: bytes) -> bytes:
    return struct.pack(">I", len(body) + 8) + kind + body


def _boxes(data: bytes, start: int, end: int) -> Iterator[tuple[bytes, int, int]]:
    while start + 8 <= end:
        size, kind = struct.unpack(">I4s", data[start : start + 8])
        yield kind, start, start + size
        start += size


def _path(data: bytes, names: Sequence[bytes]) -> list[tuple[int, int]]:
    places, start, end = [], 0, len(data)
    for name in names:
        place = next(item for item in _boxes(data, start, end) if item[0] == name)
        places.append(place[1:])
        start, end = place[1] + 8, place[2]
    return places


def _place(data: bytes, names: Sequence[bytes]) -> tuple[int, int]:
    return _path(data, names)[-1]


def _replaced(data: bytes, names: Sequence[bytes], box: bytes) -> bytes:
    """Another box in the place of one, and the sizes of those around it."""
    *around, (start, end) = _path(data, names)
    data = data[:start] + box + data[end:]
    for place, _ in around:
        (size,) = struct.unpack(">I", data[place : place + 4])
        grown = struct.pack(">I", size + len(box) - (end - start))
        data = data[:place] + grown + data[place + 4 :]
    return data
