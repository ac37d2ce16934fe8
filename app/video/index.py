"""Index of a recording: what is known of each of its frames without decoding it again."""

from __future__ import annotations

import json
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import asdict, dataclass
from fractions import Fraction
from functools import cached_property
from io import BytesIO
from math import lcm
from pathlib import Path
from typing import Any, BinaryIO

import numpy as np
import numpy.typing as npt

from app.errors import InputError
from app.geometry.arrays import BoolArray, FloatArray, IntArray
from app.json_text import json_text
from app.video.measures import MEASURES, Measured

VERSION = 3
"""Of the index and of what is measured; an index of another one is made again."""
_FINEST = 200_000
"""Ticks a second; MPEG counts 90,000, and 48,000 and 30,000 are common in MP4."""
_NANOSECONDS = 10**9
_MOST_TICKS = 2_000_000
_RESTART = 1000.0
"""Milliseconds; where times fall by more, the clock of the stream has started again."""
_MOST_UNEVEN = 0.02
"""By how much the time between two frames may differ from the usual one at a constant rate: containers
that count in milliseconds round."""


@dataclass(frozen=True)
class RecordingFacts:
    """What holds of a whole recording.

    Attributes:
        sha256: Of the file, 64 hexadecimal digits.
        bytes: Size of the file.
        width, height: Of a frame as people see it: upright, with square pixels.
        coded_width, coded_height: Of a frame as it is decoded: upright, with its own pixels.
        rotation: Degrees, clockwise, by which the container turns the stored frames: 0, 90, 180, 270.
        pixel_aspect: Width of a decoded pixel by its height, numerator and denominator.
        interlaced: Whether its moving frames show two fields; None where too few move.
        time_base: Seconds of one tick of ``RecordingIndex.pts``, numerator and denominator.
        has_seek_table: Whether the container says where key frames are.
        decoder: What decoded it; another one may return other frames.
        damaged: Pictures that cannot be decoded; they are no frames, and have no number.
    """

    sha256: str
    bytes: int
    width: int
    height: int
    coded_width: int
    coded_height: int
    rotation: int
    pixel_aspect: tuple[int, int]
    interlaced: bool | None
    time_base: tuple[int, int]
    has_seek_table: bool
    decoder: str
    damaged: int = 0


@dataclass(frozen=True)
class RecordingIndex:
    """Frames of a recording, numbered from 0 in the order in which the decoder returns them.

    Attributes:
        facts: What holds of all.
        pts: Presentation time of each frame, ticks of ``facts.time_base`` after the start of the stream,
            shape (N,). As the container says it: two may be equal, or come in the wrong order, and where
            a stream was cut between key frames the first one that can be decoded comes later than 0.
        keys: Numbers of the key frames, ascending, shape (K,).
        measured: What is kept of each frame's picture, shape (N,).
    """

    facts: RecordingFacts
    pts: IntArray
    keys: IntArray
    measured: Measured

    def __len__(self) -> int:
        return len(self.pts)

    @cached_property
    def times(self) -> FloatArray:
        """Presentation time of each frame after the start of the stream, by which a reader finds it, milliseconds,
        shape (N,)."""
        over, under = self.facts.time_base
        return np.asarray(self.pts * (1000.0 * over) / under)

    @cached_property
    def seconds(self) -> FloatArray:
        """When each frame is shown, seconds after the first one, never falling, shape (N,)."""
        rising = np.maximum.accumulate(self._continued_times)
        return np.asarray((rising - rising[:1]) / 1000.0)

    @cached_property
    def _continued_times(self) -> FloatArray:
        """``times`` of one clock: where that of the stream starts again, the next frame comes a usual step later."""
        steps = np.diff(self.times)
        restarted = steps < -_RESTART
        if not restarted.any():
            return self.times
        usual = float(np.median(steps[steps > 0])) if (steps > 0).any() else 0.0
        return np.append(
            self.times[:1], self.times[0] + np.cumsum(np.where(restarted, usual, steps))
        )

    @cached_property
    def step(self) -> float:
        """Usual time between two frames, seconds; of a single frame 0.04."""
        steps = np.diff(self.seconds)
        return float(np.median(steps[steps > 0])) if (steps > 0).any() else 0.04

    @property
    def end(self) -> float:
        """When the last frame is over, seconds after the first one is shown."""
        return float(self.seconds[-1]) + self.step

    @property
    def fps(self) -> float:
        """Frames a second: of a constant rate that rate, of a variable one the mean."""
        if not self.is_variable or len(self) < 2:
            return float(1 / Fraction(self.mean_step).limit_denominator(10**6))
        return len(self) / self.end

    @property
    def mean_step(self) -> float:
        """Mean time between two frames, seconds."""
        if len(self) < 2 or self.seconds[-1] <= 0:
            return self.step
        return float(self.seconds[-1]) / (len(self) - 1)

    @property
    def is_variable(self) -> bool:
        """Whether some frame is shown for another time than others, beyond what rounding does."""
        return bool(self.uneven_step_mask.any())

    @property
    def uneven_step_mask(self) -> BoolArray:
        """Whether the time to the next frame is another one than usual, shape (N - 1,)."""
        steps = np.diff(self._continued_times) / 1000.0
        # A container may count in milliseconds, or coarser.
        tick = self.facts.time_base[0] / self.facts.time_base[1]
        slack = max(_MOST_UNEVEN * self.step, tick if tick < self.step / 4 else 0.0)
        return np.asarray(np.abs(steps - self.step) > slack + 1e-9)


def find_time_base(times: FloatArray) -> tuple[tuple[int, int], IntArray]:
    """The coarsest time base in which times are whole numbers of ticks, and those numbers.

    The decoder gives times as floating point numbers; as fractions of few ticks a second they are
    exact again. Where there is no such time base, ticks are nanoseconds.

    Args:
        times: Milliseconds, shape (N,).

    Returns:
        Seconds of a tick (numerator, denominator), and ticks, shape (N,).

    Example:
        >>> find_time_base(np.array([0.0, 1001 / 24, 1001 / 12]))
        ((1001, 24000), array([0, 1, 2]))
    """
    seconds = times / 1000.0
    under = 1
    for value in np.unique(seconds):
        if abs(value * under - round(value * under)) < 1e-9 * max(under, 1):
            continue
        under = lcm(under, Fraction(float(value)).limit_denominator(_FINEST).denominator)
        if under > _MOST_TICKS:
            break
    ticks = np.rint(seconds * under)
    if under > _MOST_TICKS or np.abs(ticks / under - seconds).max(initial=0.0) > 2e-9:
        return (1, _NANOSECONDS), np.rint(seconds * _NANOSECONDS).astype(np.int64)
    over = int(np.gcd.reduce(ticks.astype(np.int64), initial=0)) or 1
    whole = Fraction(over, under)
    return (whole.numerator, whole.denominator), ticks.astype(np.int64) // over


def index_to_bytes(index: RecordingIndex) -> bytes:
    """An index as bytes, compressed."""
    content = BytesIO()
    head = json_text({"version": VERSION, **asdict(index.facts)}).encode()
    np.savez_compressed(
        content,
        allow_pickle=False,
        head=np.frombuffer(head, np.uint8),
        pts=index.pts,
        keys=index.keys,
        measured=index.measured.view(np.uint8).reshape(len(index), -1),
    )
    return content.getvalue()


def index_from_bytes(data: bytes, name: str = "the index") -> RecordingIndex:
    """The index that ``index_to_bytes`` wrote.

    Args:
        data: The bytes.
        name: How a complaint calls them.

    Raises:
        InputError: They are no index, or one of another version.
    """
    with _open_arrays(BytesIO(data), name) as arrays:
        rows: npt.NDArray[Any] = arrays["measured"]
        if rows.shape != (len(arrays["pts"]), MEASURES.itemsize):
            raise ValueError("the measurements have a wrong shape")
        return _index_from_arrays(
            arrays, name, np.ascontiguousarray(rows).reshape(-1).view(MEASURES)
        )


def read_index_seconds(path: Path) -> FloatArray:
    """``RecordingIndex.seconds`` of an index in a file, of which the rest is checked and not kept in memory.

    Raises:
        InputError: It is no index, or one of another version.
        OSError: It cannot be read.
    """
    with path.open("rb") as file, _open_arrays(file, "the index") as arrays:
        if arrays.zip.testzip() is not None:
            raise ValueError("damaged")
        return _index_from_arrays(arrays, "the index", np.empty(0, MEASURES)).seconds


@contextmanager
def _open_arrays(file: BinaryIO, name: str) -> Iterator[Any]:
    try:
        with np.load(file, allow_pickle=False) as arrays:
            yield arrays
    except InputError:
        raise
    except Exception as error:
        raise InputError(
            f"{name} is not the index of a recording, or is damaged; index the recording again"
        ) from error


def _index_from_arrays(arrays: Any, name: str, measured: Measured) -> RecordingIndex:
    head = json.loads(arrays["head"].tobytes())
    pts: npt.NDArray[Any] = arrays["pts"]
    keys: npt.NDArray[Any] = arrays["keys"]
    if head.pop("version") != VERSION:
        raise InputError(f"{name} is an index of another version; index the recording again")
    if not pts.dtype == keys.dtype == np.int64:
        raise ValueError("the frame times and key frames have a wrong data type")
    for pair in ("pixel_aspect", "time_base"):
        head[pair] = tuple(head[pair])
    return RecordingIndex(RecordingFacts(**head), pts, keys, measured)
