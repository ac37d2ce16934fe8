"""The ball over time as values: what views measured of it, and the track that explains them.

Pitch frame, metres and seconds; z points down, so that a ball in the air has negative z.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import Literal

import numpy as np

from app.geometry.arrays import BoolArray, FloatArray, IntArray
from app.geometry.camera import Camera
from app.soccer.choices import BallEventKind
from app.wording import plural

BallState = Literal["measured", "one_view", "predicted", "bridged", "gap"]
"""How a frame's ball is known: by two views or more, by one, by physics from one side of a gap or
between measurements close by, by physics across a gap, or not at all."""
BallMode = Literal["roll", "flight", "held", "out", ""]
EventKind = BallEventKind


@dataclass(frozen=True)
class BallMeasurements:
    """Where views show the ball, in any order; views of other instants carry their own times.

    Attributes:
        frames: Of the stretch, the nearest one for an asynchronous view, shape (M,).
        times: Seconds, as the track's times count, shape (M,).
        views: Name of the view (camera or recording) of each; one ball a view and instant.
        pixels: As the image shows them, shape (M, 2).
        sigma: Noise of each coordinate, pixels, shape (M,).
        cameras: One for each.
        sizes: Diameters in pixels, NaN where unknown, shape (M,); all unknown by default. A weak
            prior of the distance.
        size_sigma: Their noise, pixels, shape (M,).
    """

    frames: IntArray
    times: FloatArray
    views: tuple[str, ...]
    pixels: FloatArray
    sigma: FloatArray
    cameras: tuple[Camera, ...]
    sizes: FloatArray = field(default_factory=lambda: np.zeros(0))
    size_sigma: FloatArray = field(default_factory=lambda: np.zeros(0))

    def __post_init__(self) -> None:
        for name in ("sizes", "size_sigma"):
            if not len(getattr(self, name)):
                object.__setattr__(self, name, np.full(len(self.frames), np.nan))

    def __len__(self) -> int:
        return len(self.frames)

    @cached_property
    def view_names(self) -> tuple[str, ...]:
        """Of the views, each once, sorted."""
        return tuple(sorted(set(self.views)))

    def part(self, rows: IntArray | BoolArray) -> BallMeasurements:
        """Some of the measurements, by numbers or by a mask."""
        rows = np.arange(len(self))[rows]
        return BallMeasurements(
            self.frames[rows],
            self.times[rows],
            tuple(self.views[row] for row in rows),
            self.pixels[rows],
            self.sigma[rows],
            tuple(self.cameras[row] for row in rows),
            self.sizes[rows],
            self.size_sigma[rows],
        )


@dataclass(frozen=True)
class ViewErrors:
    """How wrong views are, as a whole track tells it: a part of it alone would tell less, and otherwise.

    Attributes:
        noise: As of ``BallTrack``, by name.
        late: Seconds to add to the times of a view, by name.
    """

    noise: Mapping[str, float] = field(default_factory=dict)
    late: Mapping[str, float] = field(default_factory=dict)

    def noise_factors(self, names: Sequence[str]) -> FloatArray:
        """Times that views are noisier than is said of them, shape (V,)."""
        return np.array([self.noise.get(name, 1.0) for name in names])

    def time_shifts(self, names: Sequence[str]) -> FloatArray:
        """Seconds to add to the times of views, shape (V,)."""
        return np.array([self.late.get(name, 0.0) for name in names])


@dataclass(frozen=True)
class BallEvent:
    """What changed the ball's way.

    Attributes:
        frame: The nearest one.
        time_s: Seconds.
        kind: ``kick`` (or whatever else touched it), ``bounce`` on the grass, ``out``: wholly over a
            line.
        position: Pitch frame, metres, shape (3,).
        sigma_s: Of the time, seconds.
    """

    frame: int
    time_s: float
    kind: EventKind
    position: FloatArray
    sigma_s: float


@dataclass(frozen=True)
class ViewJump:
    """Where views that take over put the ball elsewhere: their cameras contradict each other.

    It is no event of the ball.

    Attributes:
        frame: The nearest frame.
        time_s: From then on, seconds.
        metres: How far the ball jumps beside its motion.
        views: Those that see it from then on.
    """

    frame: int
    time_s: float
    metres: float
    views: tuple[str, ...]


@dataclass(frozen=True)
class EventCorrection:
    """An event that a person added to a track, or removed from it.

    Attributes:
        frame: Of the stretch.
        kind: ``kick``, ``bounce`` or ``out``.
        added: Whether it is there; else it is not.
    """

    frame: int
    kind: EventKind
    added: bool


@dataclass(frozen=True)
class ContradictingMeasurement:
    """A measurement that the track does not explain, and took no part.

    Attributes:
        measurement: Its row.
        px: How far from the track.
        reason: A sentence.
    """

    measurement: int
    px: float
    reason: str


@dataclass(frozen=True)
class UntrackedRun:
    """A run of measurements that is in no track, beside others that are.

    Attributes:
        first, last: Its first and last frame.
        measurements: How many it has.
        reason: Why, a sentence.
    """

    first: int
    last: int
    measurements: int
    reason: str

    @property
    def sentence(self) -> str:
        """What people are told."""
        balls = plural(self.measurements, "measured ball")
        return f"Frames {self.first} to {self.last} ({balls}) have no track: {self.reason}"


@dataclass(frozen=True)
class LeaveOneOutSummary:
    """How well measurements are predicted by a track that was made without them.

    Attributes:
        px: Of each measurement, NaN where none was predicted, shape (M,).
        by_frame: Median of those of each frame of the track, NaN without one, shape (N,).
        median_px: Of all; None without one.
        p95_px: Their 95th percentile.
        predicted: Measurements that were.
    """

    px: FloatArray
    by_frame: FloatArray
    median_px: float | None
    p95_px: float | None
    predicted: int


@dataclass(frozen=True)
class BallTrack:
    """The ball in every frame of a stretch.

    Attributes:
        frames: Numbers, shape (N,).
        times: Seconds, shape (N,).
        position: NaN in gaps, shape (N, 3).
        velocity: Metres per second, NaN in gaps, shape (N, 3).
        covariance: Of position and velocity, NaN in gaps, shape (N, 6, 6).
        state: How each is known.
        mode: What the ball does, empty in gaps.
        views: Names of those that saw it and agree.
        events: By time.
        contradicted: Measurements that took no part.
        reason: Why there is no track, a sentence; None where there is one.
        left_out: None where nothing was left out.
        offsets: Seconds to add to a view's times, as the ball shows them, by name; only where that
            is observable and not nought.
        noise: Times that a view is noisier than is said of it, because its camera is inexact, by name; only where
            that is more than once.
        untracked: Runs of measurements that are in no track, though others are.
        jumps: Where views that take over put the ball elsewhere, by time.
    """

    frames: IntArray
    times: FloatArray
    position: FloatArray
    velocity: FloatArray
    covariance: FloatArray
    state: tuple[BallState, ...]
    mode: tuple[BallMode, ...]
    views: tuple[tuple[str, ...], ...]
    events: tuple[BallEvent, ...] = ()
    contradicted: tuple[ContradictingMeasurement, ...] = ()
    reason: str | None = None
    left_out: LeaveOneOutSummary | None = None
    offsets: tuple[tuple[str, float], ...] = ()
    noise: tuple[tuple[str, float], ...] = ()
    untracked: tuple[UntrackedRun, ...] = ()
    jumps: tuple[ViewJump, ...] = ()

    @cached_property
    def sigma(self) -> FloatArray:
        """Largest standard deviation of the position, metres, NaN in gaps, shape (N,)."""
        result = np.full(len(self.frames), np.nan)
        known = np.isfinite(self.position).all(axis=1)
        if known.any():
            variances = np.linalg.eigvalsh(self.covariance[known][:, :3, :3])[:, -1]
            result[known] = np.sqrt(np.maximum(variances, 0.0))
        return result

    @staticmethod
    def make_empty_track(frames: IntArray, times: FloatArray, reason: str) -> BallTrack:
        """No ball in any frame, and why."""
        count = len(frames)
        state: tuple[BallState, ...] = ("gap",)
        mode: tuple[BallMode, ...] = ("",)
        return BallTrack(
            frames,
            times,
            np.full((count, 3), np.nan),
            np.full((count, 3), np.nan),
            np.full((count, 6, 6), np.nan),
            state * count,
            mode * count,
            ((),) * count,
            reason=reason,
        )
