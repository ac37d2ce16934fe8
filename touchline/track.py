"""Track: the ball in 3D over time, with its uncertainty and its events."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from itertools import groupby
from typing import Any

import numpy as np
import numpy.typing as npt

FloatArray = npt.NDArray[np.float64]
IntArray = npt.NDArray[np.int64]


@dataclass(frozen=True)
class TrackEvent:
    """What happened to the ball.

    Attributes:
        frame: The nearest one of its stretch.
        time_s: Seconds, as the track's times count.
        kind: ``kick`` (or whatever else touched it), ``bounce``, or ``out``: wholly over a line.
        position: Pitch frame, metres, z down.
        sigma_s: Standard deviation of the time, seconds.
    """

    frame: int
    time_s: float
    kind: str
    position: tuple[float, float, float]
    sigma_s: float


@dataclass(frozen=True, eq=False)
class Track:
    """The ball over a stretch, in the pitch frame (metres, z down); frames without a ball are NaN.

    Attributes:
        stretch: The match of a static rig, or a recording with the frames of its shot.
        frames: Numbers, one after the other, shape (N,).
        times: Seconds, shape (N,).
        position: Shape (N, 3).
        velocity: Metres per second, shape (N, 3).
        covariance: Of position and velocity, shape (N, 6, 6).
        sigma: Major axis of the position's covariance, metres, shape (N,).
        state: How each frame is known: ``measured``, ``one_view``, ``bridged``, ``predicted`` or ``gap``.
        mode: What the ball does: ``flight``, ``roll``, ``held``, ``out``, or empty in gaps.
        cameras: Names of the views that saw it and agree.
        events: By time.
    """

    stretch: str
    frames: IntArray
    times: FloatArray
    position: FloatArray
    velocity: FloatArray
    covariance: FloatArray
    sigma: FloatArray
    state: tuple[str, ...]
    mode: tuple[str, ...]
    cameras: tuple[tuple[str, ...], ...]
    events: tuple[TrackEvent, ...]

    @property
    def height_m(self) -> FloatArray:
        """Of the ball's centre above the grass, metres, NaN in gaps, shape (N,)."""
        return -self.position[:, 2]

    @property
    def known(self) -> npt.NDArray[np.bool_]:
        """Frames with a ball, shape (N,)."""
        return np.asarray(np.isfinite(self.position).all(axis=1))

    def flights(self) -> list[slice]:
        """Rows in which the ball flies without a break, one slice a flight."""
        found, at = [], 0
        for mode, rows in groupby(self.mode):
            count = len(list(rows))
            if mode == "flight":
                found.append(slice(at, at + count))
            at += count
        return found

    def __len__(self) -> int:
        """How many frames it has."""
        return len(self.frames)

    def __repr__(self) -> str:
        return f"<touchline.Track {self.stretch}, {len(self)} frames, {len(self.events)} events>"


def tracks_of(
    frames: Sequence[Mapping[str, Any]], events: Iterable[Mapping[str, Any]]
) -> tuple[Track, ...]:
    """Tracks from the rows of ``tracks.parquet`` and ``events.parquet``."""
    happened: dict[str, list[TrackEvent]] = {}
    for row in events:
        place = row["x_m"], row["y_m"], row["z_m"]
        event = TrackEvent(row["frame"], row["time_s"], row["kind"], place, row["sigma_s"])
        happened.setdefault(row["stretch"], []).append(event)
    return tuple(
        _track(stretch, list(rows), happened.get(stretch, ()))
        for stretch, rows in groupby(frames, key=lambda row: str(row["stretch"]))
    )


def _track(stretch: str, rows: Sequence[Mapping[str, Any]], events: Iterable[TrackEvent]) -> Track:
    def numbers(*names: str) -> FloatArray:
        # What is missing becomes NaN.
        return np.array([[row[name] for name in names] for row in rows], dtype=float)

    nothing = [np.nan] * 36
    spread = [row["covariance"] or nothing for row in rows]
    return Track(
        stretch,
        np.array([row["frame"] for row in rows], dtype=np.int64),
        numbers("time_s")[:, 0],
        numbers("x_m", "y_m", "z_m"),
        numbers("vx_m_s", "vy_m_s", "vz_m_s"),
        np.array(spread, dtype=float).reshape(-1, 6, 6),
        numbers("sigma_m")[:, 0],
        tuple(row["state"] for row in rows),
        tuple(row["mode"] or "" for row in rows),
        tuple(tuple(row["cameras"]) for row in rows),
        tuple(events),
    )
