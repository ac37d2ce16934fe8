"""Time of the match in frames of a recording, from frames in which somebody read the clock."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Literal

from app.errors import InputError
from app.geometry.arrays import FloatArray

MAX_CLOCKS = 50
"""Of a recording: it is read anew where the recording leaves play out."""
Half = Literal[1, 2, 3, 4]


@dataclass(frozen=True)
class MatchClockReading:
    """What the clock of the match shows in one frame; later frames go on from there.

    Attributes:
        frame: Number of the frame.
        half: 1 or 2; 3 and 4 are those of extra time.
        seconds: What the clock shows; the second half begins at 2,700.
    """

    frame: int
    half: Half
    seconds: float


def validate_clock_readings(
    clocks: Sequence[MatchClockReading], frames: int
) -> list[MatchClockReading]:
    """The readings by their frames.

    Raises:
        InputError: A frame is outside of the recording or read twice, or halves go backwards.
    """
    found = sorted(clocks, key=lambda one: one.frame)
    for clock in found:
        if clock.frame >= frames:
            raise InputError(
                f"the recording has no frame {clock.frame}; its last one is {frames - 1}",
                pointer="/clocks",
            )
    for one, other in pairwise(found):
        if one.frame == other.frame or one.half > other.half:
            raise InputError(
                f"the match clocks of frame {one.frame} (half {one.half}) and frame {other.frame}"
                f" (half {other.half}) contradict each other: a frame has one clock, and a later"
                " frame cannot be in an earlier half",
                hint="Correct one of the two.",
                pointer="/clocks",
            )
    return found


def compute_match_time(
    clocks: Sequence[MatchClockReading], seconds: FloatArray, frame: int
) -> tuple[int, float] | None:
    """Half and time of the match in a frame; None where nobody has read the clock.

    Readings in frames that the recording does not have are left out.

    Args:
        clocks: Readings by their frames.
        seconds: When each frame of the recording is shown, shape (N,).
        frame: Number of the frame.
    """
    clock = find_clock_at_frame([one for one in clocks if one.frame < len(seconds)], frame)
    if clock is None:
        return None
    return clock.half, clock.seconds + float(seconds[frame] - seconds[clock.frame])


def find_clock_at_frame(
    clocks: Sequence[MatchClockReading], frame: int
) -> MatchClockReading | None:
    """The reading of the clock that holds in a frame; None where nobody has read it."""
    before = [clock for clock in clocks if clock.frame <= frame]
    return before[-1] if before else next(iter(clocks), None)
