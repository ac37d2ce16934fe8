"""Are planted offsets and speeds of replays found, and as well as their sigma says?

The ball of the Hawk-Eye minute where it is, else one of the same physics; a live camera that pans and
zooms after it, and a replay from anywhere.
"""

from __future__ import annotations

import os
import sys
import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from app.geometry.arrays import FloatArray
from app.geometry.camera import Camera
from app.sample.play import RADIUS, step_ball
from app.tracking.ball_rays import BallRays, build_ball_rays
from app.tracking.link import find_time_map
from app.tracking.time_map import TimeMap
from tests.bench.table import print_table
from tests.cameras import looking

DATA = Path(os.environ.get("TOUCHLINE_REAL_DATA", Path(__file__).parents[3] / "shared" / "data"))
BALL_STEP = 0.02
LIVE_FPS, REPLAY_FPS = 25.0, 50.0
STANDS = (
    (0.0, -75.0, -18.0), (-62.0, 6.0, -3.0), (64.0, -9.0, -14.0), (18.0, -42.0, -2.5),
    (-17.0, 44.0, -3.0), (-55.0, 50.0, -22.0), (40.0, -60.0, -15.0),
)  # fmt: skip
"""Where replays are filmed from, metres."""


@dataclass(frozen=True)
class Filmed:
    """One view of a ball: times, pixels and a camera each."""

    times: FloatArray
    pixels: FloatArray
    cameras: list[Camera]

    def rays(self) -> BallRays:
        return build_ball_rays(self.times.tolist(), self.pixels.tolist(), self.cameras)


@dataclass(frozen=True)
class Planted:
    """Two views of a ball and the map of their times."""

    live: Filmed
    replay: Filmed
    offset: float
    speed: float


def hawkeye(data: Path = DATA) -> FloatArray | None:
    """A real ball, times and places in the pitch frame, shape (N, 4)."""
    path = data / "hawkeye" / "minute_1.csv"
    if not path.is_file():
        return None
    rows = np.genfromtxt(path, delimiter=",", skip_header=1, usecols=(0, 1, 2, 3))
    return rows * (1.0, 1.0, -1.0, -1.0)


def made_ball(seconds: float = 60.0, seed: int = 0) -> FloatArray:
    """A ball that is kicked, flies with drag, bounces and rolls out, as ``hawkeye``."""
    generator = np.random.default_rng(seed)
    place, velocity = np.array([0.0, 0.0, RADIUS]), np.zeros(3)
    until, rows = 0.0, []
    for step in range(round(seconds / BALL_STEP)):
        now = step * BALL_STEP
        if now >= until:
            until = now + generator.uniform(0.8, 3.0)
            target = generator.uniform((-45.0, -28.0), (45.0, 28.0))
            way = target - place[:2]
            pace = float(np.clip(np.linalg.norm(way) / (until - now), 4.0, 24.0))
            up = generator.choice([0.0, generator.uniform(2.0, 9.0)])
            velocity = np.array([*(pace * way / np.linalg.norm(way)), up])
        rows.append((now, place[0], place[1], -place[2]))
        step_ball(place, velocity, BALL_STEP)
    return np.array(rows)


def at_times(ball: FloatArray, times: FloatArray) -> FloatArray:
    """Where a ball is at times, shape (N, 3)."""
    return np.column_stack([np.interp(times, ball[:, 0], ball[:, axis]) for axis in (1, 2, 3)])


def film(
    places: FloatArray,
    times: FloatArray,
    position: tuple[float, float, float],
    focal: Callable[[FloatArray], FloatArray] | float,
    *,
    lag: int = 12,
    follow: bool = True,
    jitter: float = 0.0,
    generator: np.random.Generator | None = None,
) -> Filmed:
    """A view that pans after the ball, smoothly and late."""
    kernel = np.ones(2 * lag + 1) / (2 * lag + 1)
    padded = np.vstack([places[:1].repeat(lag, 0), places, places[-1:].repeat(lag, 0)])
    aims = np.column_stack([np.convolve(padded[:, axis], kernel, "valid") for axis in range(3)])
    if not follow:
        aims[:] = places.mean(axis=0)
    aims[:, 2] = 0.0
    if generator is not None and jitter:
        aims[:, :2] += generator.normal(0, jitter, (len(aims), 2))
    lengths = np.full(len(times), float(focal)) if isinstance(focal, (int, float)) else focal(times)
    cameras = [
        looking(position, aim, float(length), bend=0.004)
        for aim, length in zip(aims, lengths, strict=True)
    ]
    pixels = np.array(
        [camera.project(place[None])[0] for camera, place in zip(cameras, places, strict=True)]
    )
    return Filmed(times, pixels, cameras)


def spoilt(
    view: Filmed,
    generator: np.random.Generator,
    *,
    noise_px: float,
    missing: float = 0.15,
    wrong: float = 0.02,
    whole: bool = False,
) -> Filmed:
    """A view as a detector gives it: noise, runs that are missing, gross errors, whole pixels."""
    count = len(view.times)
    pixels = view.pixels + generator.normal(0, noise_px, view.pixels.shape)
    off = generator.random(count) < wrong
    pixels[off] += generator.uniform(-150, 150, (int(off.sum()), 2))
    keep = np.isfinite(pixels).all(axis=1)
    while (~keep).mean() < missing:
        start = generator.integers(count)
        keep[start : start + generator.integers(1, 12)] = False
    if whole:
        pixels = np.round(pixels)
    cameras = [camera for camera, kept in zip(view.cameras, keep, strict=True) if kept]
    return Filmed(view.times[keep], pixels[keep], cameras)


def plant(
    ball: FloatArray,
    seed: int,
    *,
    seconds: float | None = None,
    speed: float | None = None,
    noise_px: float | None = None,
    whole: bool = False,
    missing: float = 0.15,
    wrong: float = 0.02,
    stand: tuple[float, float, float] | None = None,
    jitter: float = 0.0,
) -> Planted:
    """A live shot and a replay of a part of it."""
    generator = np.random.default_rng(seed)
    last = ball[-1, 0]
    length = min(generator.uniform(8.0, 20.0), last)
    begin = generator.uniform(0.0, last - length)
    taken = seconds or generator.uniform(3.0, 7.0)
    replay_begin = begin + generator.uniform(-0.5, max(length - taken, 0.0))
    replay_begin = float(np.clip(replay_begin, 0.0, last - taken))
    speed = speed or float(np.exp(generator.uniform(np.log(0.25), 0.0)))
    noise_px = noise_px or generator.uniform(0.3, 2.0)
    live_times = np.arange(begin, begin + length, 1 / LIVE_FPS)
    shift = generator.uniform(0, 1 / REPLAY_FPS)
    replay_times = np.arange(0.0, taken / speed, 1 / REPLAY_FPS)
    first = float(generator.choice([0.0, 3.7, 250.0]))
    place = stand or STANDS[generator.integers(len(STANDS))]
    live = film(
        at_times(ball, live_times), live_times, (0.0, 62.0, -16.0),
        lambda times: 1900 + 300 * np.sin(times), generator=generator, jitter=jitter,
    )  # fmt: skip
    at = replay_begin + shift + speed * replay_times
    inside = at < last
    replay = film(
        at_times(ball, at[inside]), replay_times[inside] + first, place,
        float(generator.uniform(1200, 2600)), lag=40,
    )  # fmt: skip
    live = Filmed(live.times - begin, live.pixels, live.cameras)
    given = {"noise_px": noise_px, "missing": missing, "wrong": wrong, "whole": whole}
    return Planted(
        spoilt(live, generator, **given),
        spoilt(replay, generator, **given),
        replay_begin + shift - begin - speed * first,
        speed,
    )


def bench_link(data: Path = DATA, count: int = 40) -> None:
    """Print the table."""
    ball = hawkeye(data)
    kind = "made" if ball is None else "Hawk-Eye minute"
    ball = made_ball() if ball is None else ball
    rest = ball.copy()
    rest[:, 1:] = (12.0, -8.0, -0.11)
    rows = [
        _row("noise 0.3 to 2 px", [plant(ball, seed) for seed in range(count)]),
        _row("noise 0.5 px", [plant(ball, seed, noise_px=0.5) for seed in range(count)]),
        _row(
            "whole pixels", [plant(ball, seed, noise_px=0.5, whole=True) for seed in range(count)]
        ),
        _row(
            "a third missing, 5 % wrong",
            [plant(ball, seed, missing=0.33, wrong=0.05) for seed in range(count)],
        ),
        _row("a ball at rest", [plant(rest, seed) for seed in range(count // 4)]),
    ]
    header = (
        f"ball: {kind}", "replays", "linked", "time off, frames, median", "p95",
        "speed off, %, median", "p95", "offset in its 95 %", "speed in its 95 %", "s each",
    )  # fmt: skip
    print_table("Is a replay linked to its live shot at the right times?", header, rows)


@dataclass(frozen=True)
class Outcome:
    """One planted map and what was found of it.

    ``frames`` is the error of the time in the middle of the replay in live frames, ``percent`` that
    of the speed, ``z`` the errors of offset and speed by their sigma.
    """

    found: TimeMap
    frames: float
    percent: float
    z: FloatArray


def outcome_of(planted: Planted) -> Outcome:
    """Link a planted replay, and compare."""
    found = find_time_map(planted.live.rays(), planted.replay.rays())
    if found.offset is None or found.speed is None or found.covariance is None:
        return Outcome(found, np.nan, np.nan, np.full(2, np.nan))
    error = np.array([found.offset - planted.offset, found.speed - planted.speed])
    middle = planted.replay.times[[0, -1]].mean()
    return Outcome(
        found,
        float(error @ (1.0, middle)) * LIVE_FPS,
        float(100 * error[1] / planted.speed),
        error / np.sqrt(found.covariance.diagonal()),
    )


def _row(name: str, planted: list[Planted]) -> list[object]:
    began = time.process_time()
    every = [outcome_of(one) for one in planted]
    seconds = (time.process_time() - began) / len(every)
    linked = [one for one in every if one.found.reason is None]
    if not linked:
        return [name, len(every), 0, *("-",) * 6, seconds]
    frames = np.abs([one.frames for one in linked])
    percent = np.abs([one.percent for one in linked])
    inside = (np.abs([one.z for one in linked]) < 1.96).mean(axis=0)
    return [
        name, len(every), len(linked), float(np.median(frames)), float(np.percentile(frames, 95)),
        float(np.median(percent)), float(np.percentile(percent, 95)), *inside.tolist(), seconds,
    ]  # fmt: skip


if __name__ == "__main__":
    bench_link(count=int(sys.argv[1]) if len(sys.argv) > 1 else 40)
