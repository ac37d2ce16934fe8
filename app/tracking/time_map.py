"""Time map: which time of a live shot each time of a replay shows, and the map of instants that a person linked.

``t_live = offset + speed * t_replay``, in pieces where the speed of the replay changes.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np

from app.geometry.arrays import FloatArray

_SLOWEST, _FASTEST = 0.02, 1.4
"""Speeds of replays that people may mean."""
_UNSURE = 0.25
"""Standard deviation of a speed, of the live shot's, beyond which it is unknown."""
_MOST_UNSURE_FRAMES = 4.0
"""Standard deviation of the live time of the replay's first and last frames, live frames, beyond which it is unknown."""
_CHANGE = 15.0
"""Sum of squares of residuals, in frames, that a change of the speed has to explain."""


@dataclass(frozen=True)
class TimeMap:
    """What became of a link, or of a piece of one.

    Attributes:
        reason: Why there is no map, a sentence; None where there is one.
        offset, speed: ``t_live = offset + speed * t_replay``, seconds; the best there was where
            there is a reason.
        covariance: Of both, shape (2, 2).
        miss: Median distance of the rays that meet, metres.
        pairs: Rays of the replay with a live one beside them.
        overlap: Live seconds between the first and the last of those.
        by_hand: Whether a person's instants alone say it.
        first, last: Replay times of a piece.
        pieces: Where one map does not fit the whole replay: those that fit parts of it.
        turned: Whether the rays of the ball meet, but only once the replay's cameras are turned by half a turn of the
            pitch.
        too_close: Whether several instants are too close together to tell the speed.
    """

    reason: str | None
    offset: float | None = None
    speed: float | None = None
    covariance: FloatArray | None = None
    miss: float | None = None
    pairs: int = 0
    overlap: float = 0.0
    by_hand: bool = False
    first: float = 0.0
    last: float = 0.0
    pieces: tuple[TimeMap, ...] = ()
    turned: bool = False
    too_close: bool = False

    def sigma_at(self, time: float) -> float | None:
        """Standard deviation of the live time of a replay time, seconds; None where it is not known."""
        if self.covariance is None:
            return None
        row = np.array([1.0, time])
        return float(np.sqrt(max(float(row @ self.covariance @ row), 0.0)))

    def to_live_times(self, times: FloatArray) -> FloatArray:
        """Live times of replay times, each by the piece that it is in, or else the nearest one; shape (N,).

        There has to be an offset and a speed, or pieces.
        """
        if not self.pieces:
            assert self.offset is not None and self.speed is not None
            return np.asarray(self.offset + self.speed * times)
        ends = [(one.last + two.first) / 2 for one, two in pairwise(self.pieces)]
        which = np.searchsorted(ends, times)
        offsets = np.array([piece.offset for piece in self.pieces], dtype=float)
        speeds = np.array([piece.speed for piece in self.pieces], dtype=float)
        return np.asarray(offsets[which] + speeds[which] * times)


def fit_map_to_instants(
    instants: FloatArray,
    frame_s: float,
    assumed_speed: float | None = None,
    last_s: float | None = None,
    name_time: Callable[[float], str] = "{:.2f} s".format,
) -> TimeMap:
    """The map of instants that a person sees in both shots, each to about a live frame.

    One instant gives the offset at a speed that is assumed; two give both, more are fitted by least squares. Where one
    line leaves more than the person's accuracy explains, the speed changes at instants: the fewest pieces that fit.

    Args:
        instants: Live and replay time of each, seconds, shape (N, 2).
        frame_s: Time between two live frames, seconds: the standard deviation of an instant.
        assumed_speed: Speed of the replay while one instant is known; None: that of the live shot.
        last_s: Replay time of its last frame, seconds after its first one; the live times of both have to be known.
            None: nobody asks for them.
        name_time: How reasons name a time of the replay.
    """
    if not len(instants):
        return TimeMap("No instant is linked yet.", by_hand=True)
    rows = instants[np.argsort(instants[:, 1], kind="stable")]
    if np.ptp(rows[:, 1]) == 0:
        return _make_map_with_assumed_speed(
            rows, assumed_speed, "Instants of one frame of the replay do not tell its speed"
        )
    pieces = _fit_piecewise_maps(rows, frame_s)
    if any(piece.speed is None or piece.speed <= 0 for piece in pieces):
        return TimeMap(
            "The linked instants run backwards: what is later in the replay is earlier live.",
            by_hand=True,
        )
    for piece in pieces:
        speed, sigma = piece.speed or 0.0, _speed_sigma(piece)
        if sigma > _UNSURE:
            reason = (
                f"The instants near {name_time(piece.first)} are too close together to tell the speed "
                f"({speed:.2g} ± {sigma:.2g}); link one farther away"
            )
            if len(pieces) == 1:
                return replace(
                    _make_map_with_assumed_speed(rows, assumed_speed, reason), too_close=True
                )
            reason = f"{reason}."
        elif not _SLOWEST <= speed <= _FASTEST:
            reason = (
                f"The instants make the replay run at {speed:.2g} times the live speed, which is unlikely: check"
                " them."
            )
        else:
            continue
        return TimeMap(reason, by_hand=True)
    unsure = None if last_s is None else _explain_unsure_end(pieces, last_s, frame_s)
    if len(pieces) == 1:
        if unsure is None:
            return pieces[0]
        speed = round(pieces[0].speed or 1.0, 3) if assumed_speed is None else assumed_speed
        return replace(_make_map_with_assumed_speed(rows, speed, unsure), too_close=True)
    if unsure is not None:
        return TimeMap(f"{unsure}.", by_hand=True)
    changes = " and ".join(name_time(piece.first) for piece in pieces[1:])
    reason = f"One offset and speed do not fit the whole replay: they change near {changes}."
    return TimeMap(reason, by_hand=True, pieces=tuple(pieces))


def _explain_unsure_end(pieces: list[TimeMap], last_s: float, frame_s: float) -> str | None:
    """Why the live times of the first and last frames of a replay are not known; None where they are."""
    ends = (("start", pieces[0], 0.0), ("end", pieces[-1], last_s))
    sigma, name = max((piece.sigma_at(time) or 0.0, name) for name, piece, time in ends)
    if sigma <= _MOST_UNSURE_FRAMES * frame_s:
        return None
    return (
        f"The instants are too close together: the {name} of the replay is known to ± {sigma:.2g} s only; link one "
        f"farther away, near that {name}"
    )


def _make_map_with_assumed_speed(
    rows: FloatArray, assumed_speed: float | None, why: str
) -> TimeMap:
    """The map of instants at a speed that is assumed, with the reason why."""
    speed = 1.0 if assumed_speed is None else assumed_speed
    offset = float((rows[:, 0] - speed * rows[:, 1]).mean())
    return TimeMap(f"{why}; {speed:g} is assumed.", offset, speed, by_hand=True)


def _speed_sigma(piece: TimeMap) -> float:
    return 0.0 if piece.covariance is None else float(np.sqrt(piece.covariance[1, 1]))


def _fit_piecewise_maps(rows: FloatArray, frame_s: float) -> list[TimeMap]:
    """The maps of the fewest stretches of instants, by replay time, that lines fit; neighbours share one."""
    count = len(rows)
    cost, start = np.full(count, np.inf), np.zeros(count, dtype=int)
    cost[0] = -_CHANGE
    for last in range(1, count):
        for first in range(last):
            if rows[first, 1] == rows[last, 1]:
                continue
            total = cost[first] + _CHANGE + _fit_line(rows[first : last + 1], frame_s)[1]
            if total < cost[last]:
                cost[last], start[last] = total, first
    found: list[TimeMap] = []
    last = count - 1
    while last > 0:
        first = int(start[last])
        found.insert(0, _fit_line(rows[first : last + 1], frame_s)[0])
        last = first
    return found


def _fit_line(rows: FloatArray, frame_s: float) -> tuple[TimeMap, float]:
    """The line through instants, and the sum of squares of its residuals in frames."""
    design = np.column_stack([np.ones(len(rows)), rows[:, 1]])
    (offset, speed), *_ = np.linalg.lstsq(design, rows[:, 0], rcond=None)
    covariance = frame_s**2 * np.linalg.inv(design.T @ design)
    off = (design @ (offset, speed) - rows[:, 0]) / frame_s
    first, last = float(rows[0, 1]), float(rows[-1, 1])
    made = TimeMap(None, float(offset), float(speed), covariance, by_hand=True)
    return replace(made, first=first, last=last), float(off @ off)
