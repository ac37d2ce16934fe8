"""Videos whose frames carry their number in their pixels, with the times that a test wants."""

from __future__ import annotations

import struct
from collections.abc import Iterator, Sequence
from pathlib import Path

import cv2
import numpy as np

WIDTH, HEIGHT = 160, 96
_BITS = 10
_TIMES = (b"moov", b"trak", b"mdia", b"minf", b"stbl", b"stts")
_EDITS = (b"moov", b"trak", b"edts")


def write_video(path: Path, codec: str, count: int = 200, rate: float = 25) -> Path:
    """A video of numbered frames at a constant rate.

    Args:
        path: Its ending says the container.
        codec: Four letters; ``MPG2`` has B-frames and a key frame every twelve.
    """
    video = cv2.VideoWriter(str(path), cv2.VideoWriter_fourcc(*codec), rate, (WIDTH, HEIGHT))
    assert video.isOpened()
    for number in range(count):
        video.write(numbered(number))
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
