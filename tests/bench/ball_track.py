"""Is the ball over time where it was, as surely as its track says?

ISSIA's own clicks left out and predicted; the Hawk-Eye minute through ISSIA's six cameras, through a
panning camera with a slow replay, and through that camera alone. Without these data, a made ball.
"""

from __future__ import annotations

import sys
import time
from collections.abc import Mapping, Sequence
from dataclasses import astuple, dataclass, replace
from itertools import combinations
from pathlib import Path

import numpy as np

from app.formats.issia_reader import IssiaOptions, open_issia
from app.formats.report import ReaderReport
from app.geometry.arrays import BoolArray, FloatArray
from app.geometry.camera import Camera
from app.soccer.pitch import Pitch
from app.soccer.policy import PAPER
from app.solving.rig_proposal import propose_rig
from app.tracking.ball_correct import correct_track
from app.tracking.ball_solve import track_ball
from app.tracking.ball_track import BallMeasurements, BallTrack, EventCorrection
from tests.bench.link import DATA, STANDS, Filmed, at_times, film, hawkeye, made_ball
from tests.bench.rigs import rig_of
from tests.bench.table import print_table
from tests.cameras import FULL_HD, looking

FPS = 25.0
INSIDE_95 = 7.815
"""Chi-squared with three degrees of freedom."""
NEAR_S = 0.5
EVENT_STEPS, EVENT_APART_S = 4, 0.06
"""Steps of the truth on either side of an event, and how far the next one is off."""
LEAST, LESS = 3.0, 2.0
"""A change of the true velocity that is an event, and one that may be called one, m/s."""
EVENT_FRAMES = 2


def bench_ball_track(data: Path = DATA, seeds: int = 3) -> None:
    """Print the tables."""
    ball = hawkeye(data)
    kind = "made" if ball is None else "Hawk-Eye minute"
    ball = made_ball() if ball is None else ball
    rigs: dict[str, Mapping[str, Camera]] = {"six cameras": _six()}
    if (data / "issia").is_dir():
        clicks, given, bundled = issia(data)
        rigs = {"ISSIA's cameras": bundled}
        _print_left_out(clicks, {"given": given, "bundled": bundled})
        _print_jumps(clicks, given, bundled)
        _print_neighbours(clicks, {"given": given, "bundled": bundled})
    rows = []
    for name, cameras in rigs.items():
        for noise, missing in ((0.0, 0.0), (0.0, 0.3), (0.5, 0.3)):
            seen = [through(ball, cameras, seed, noise, missing) for seed in range(seeds)]
            label = f"{name}, whole pixels"
            label += f" of {noise} px" if noise else ""
            rows.append(_row(f"{label}, {missing:.0%} missing", ball, seen))
    rows.append(_row("main camera, slow replays", ball, [replays(ball, s) for s in range(seeds)]))
    rows.append(_row("main camera alone", ball, [main(ball, s) for s in range(seeds)]))
    header = (
        f"ball: {kind}", "near two views", "known", "m, median", "p95", "inside 95 %",
        "all known", "sigma m, median", "inside 95 %", "flights placed", "within 1 m",
        "events F1", "left out px", "CPU s",
    )  # fmt: skip
    print_table("Is the ball over time where it was?", header, rows)
    seen = {"six cameras": through(ball, next(iter(rigs.values())), 0, 0.0, 0.3)}
    seen["main camera alone"] = main(ball, 0)
    edits = [(name, *edited(ball, one)) for name, one in seen.items()]
    print_table("What does a correction take?", ("", "frames solved anew", "CPU ms"), edits)


def edited(ball: FloatArray, seen: BallMeasurements, count: int = 20) -> tuple[float, float]:
    """Frames that are solved anew around an event that a person adds, and milliseconds; medians."""
    times = frame_times(ball)
    track = track_ball(seen, np.arange(len(times)), times, pitch=Pitch())
    frames, taken = [], []
    for frame in np.linspace(60, len(times) - 60, count).astype(int).tolist():
        began = time.process_time()
        patches = correct_track(track, seen, Pitch(), [EventCorrection(frame, "kick", True)])
        taken.append(1000 * (time.process_time() - began))
        frames.append(sum(len(patch.part.frames) for patch in patches))
    return float(np.median(frames)), float(np.median(taken))


def through(
    ball: FloatArray, cameras: Mapping[str, Camera], seed: int, noise: float, missing: float
) -> BallMeasurements:
    """A ball through static cameras, whole pixels, runs missing in each."""
    generator = np.random.default_rng(seed)
    times = frame_times(ball)
    places = at_times(ball, times)
    parts = []
    for name, camera in sorted(cameras.items()):
        pixels = camera.project(places)
        keep = np.isfinite(pixels).all(axis=1) & (pixels >= 0).all(axis=1)
        keep &= (pixels < (FULL_HD.width, FULL_HD.height)).all(axis=1)
        keep &= ~_runs(len(times), missing, generator)
        pixels = np.round(pixels + generator.normal(0, noise, pixels.shape))
        parts.append(
            _measured(name, Filmed(times, pixels, [camera] * len(times)), keep, noise, times)
        )
    return joined(parts)


def main(ball: FloatArray, seed: int, missing: float = 0.15) -> BallMeasurements:
    """A ball through a panning main camera, half a pixel of noise in whole pixels."""
    generator = np.random.default_rng(seed)
    times = frame_times(ball)
    places = at_times(ball, times)
    view = film(places, times, (0.0, 62.0, -16.0), lambda t: 1900 + 300 * np.sin(t))
    return _spoilt("main", view, generator, missing, times)


def replays(ball: FloatArray, seed: int, speed: float = 0.4) -> BallMeasurements:
    """The same, with a replay of 6 s in every 10, 50 fps slowed to 0.4, each from another stand."""
    generator = np.random.default_rng(100 + seed)
    parts = [main(ball, seed)]
    times = frame_times(ball)
    for number, begin in enumerate(np.arange(2.0, ball[-1, 0] - 6, 10.0)):
        at = np.arange(begin, begin + 6.0, speed / 50.0) + generator.uniform(0, 0.02)
        stand = STANDS[(number + seed) % len(STANDS)]
        view = film(at_times(ball, at), at, stand, 1800.0, lag=40)
        parts.append(_spoilt(f"replay {number}", view, generator, 0.15, times))
    return joined(parts)


def frame_times(ball: FloatArray) -> FloatArray:
    """Of the frames of a stretch."""
    return np.arange(ball[0, 0], ball[-1, 0], 1 / FPS)


def joined(parts: Sequence[BallMeasurements]) -> BallMeasurements:
    """Measurements of several views."""
    return BallMeasurements(
        np.concatenate([part.frames for part in parts]),
        np.concatenate([part.times for part in parts]),
        tuple(view for part in parts for view in part.views),
        np.concatenate([part.pixels for part in parts]),
        np.concatenate([part.sigma for part in parts]),
        tuple(camera for part in parts for camera in part.cameras),
    )


def events_of(ball: FloatArray) -> list[tuple[float, float]]:
    """Times of changes of a true velocity and how large they are, largest of their neighbourhood.

    Straight lines (parabolas in the air) through four steps on either side.
    """
    steps = np.arange(EVENT_STEPS + 1) * (ball[1, 0] - ball[0, 0])
    slope = (steps - steps.mean()) / ((steps - steps.mean()) ** 2).sum()
    change = np.zeros(len(ball))
    for at in range(EVENT_STEPS, len(ball) - EVENT_STEPS):
        before = ball[at - EVENT_STEPS : at + 1, 1:]
        after = ball[at : at + EVENT_STEPS + 1, 1:]
        jump = slope @ (after - before)
        if ball[at, 3] < -0.35:
            jump[2] -= 9.81 * steps[-1]
        change[at] = np.linalg.norm(jump)
    reach = round(EVENT_APART_S / (ball[1, 0] - ball[0, 0]))
    return [
        (float(ball[at, 0]), float(change[at]))
        for at in range(2 * EVENT_STEPS, len(ball) - 2 * EVENT_STEPS)
        if change[at] >= LESS and change[at] == change[at - reach : at + reach + 1].max()
    ]


def f1_of(track: BallTrack, ball: FloatArray) -> float:
    """Share of true events of 3 m/s that are found within two frames, and of found ones that are of 2."""
    real = events_of(ball)
    begin, end = ball[0, 0] + 0.2, ball[-1, 0] - 0.2
    found = [one.time_s for one in track.events if one.kind != "out" and begin < one.time_s < end]
    slack = EVENT_FRAMES / FPS + 1e-3

    def near(at: float, others: Sequence[float]) -> bool:
        return any(abs(at - other) <= slack for other in others)

    large = [at for at, change in real if change >= LEAST]
    recall = np.mean([near(at, found) for at in large])
    precision = np.mean([near(at, [other for other, _ in real]) for at in found]) if found else 0.0
    return float(2 * recall * precision / max(recall + precision, 1e-9))


@dataclass(frozen=True)
class Judged:
    """Tracks of one ball against its truth.

    Attributes:
        near: Share of frames within half a second of a ball that two views see, by track.
        known: Share of these that have a ball.
        median, p95: How far these are from the truth, metres; of all known where no two views see.
        inside: Share of these within their 95 % ellipsoid; of all known likewise.
        all_known: Share of all frames with a ball.
        sigma: Median of all these, metres.
        all_inside: Share of all these within their ellipsoid.
        placed, within: Of frames in flight, those with a ball, and of these those within a metre.
        events: F1.
        left_out_px: Median of the tracks' own.
        seconds: Of the processor, a track.
    """

    near: float
    known: float
    median: float
    p95: float
    inside: float
    all_known: float
    sigma: float
    all_inside: float
    placed: float
    within: float
    events: float
    left_out_px: float
    seconds: float


def judged(ball: FloatArray, seen: Sequence[BallMeasurements]) -> Judged:
    """Track a ball as it was seen several times, and compare."""
    times = frame_times(ball)
    truth = at_times(ball, times)
    flies = -truth[:, 2] > 0.5
    began = time.process_time()
    tracks = [track_ball(one, np.arange(len(times)), times, pitch=Pitch()) for one in seen]
    seconds = (time.process_time() - began) / len(seen)
    off = np.array([np.linalg.norm(track.position - truth, axis=1) for track in tracks])
    known = np.isfinite(off)
    inside = np.array([_inside(track, truth) for track in tracks])
    sigma = np.array([track.sigma for track in tracks])
    near = np.array([_near_two(track, times) for track in tracks])
    both = near & known if near.any() else known
    told = [track.left_out.median_px for track in tracks if track.left_out is not None]
    return Judged(
        float(near.mean()),
        float(both[near].mean()) if near.any() else float("nan"),
        float(np.median(off[both])),
        float(np.percentile(off[both], 95)),
        float(inside[both].mean()),
        float(known.mean()),
        float(np.median(sigma[known])),
        float(inside[known].mean()),
        float(known[:, flies].mean()),
        float((off[:, flies][known[:, flies]] < 1.0).mean()),
        float(np.mean([f1_of(track, ball) for track in tracks])),
        float(np.mean([one for one in told if one is not None])),
        seconds,
    )


def _row(name: str, ball: FloatArray, seen: Sequence[BallMeasurements]) -> list[object]:
    return [name, *astuple(judged(ball, seen))]


def _inside(track: BallTrack, truth: FloatArray) -> BoolArray:
    result = np.zeros(len(truth), dtype=bool)
    known = np.isfinite(track.position).all(axis=1)
    off = (track.position - truth)[known]
    inverse = np.linalg.inv(track.covariance[known][:, :3, :3])
    result[known] = np.einsum("ni,nij,nj->n", off, inverse, off) < INSIDE_95
    return result


def _near_two(track: BallTrack, times: FloatArray) -> BoolArray:
    two = np.flatnonzero([state == "measured" for state in track.state])
    gap = np.abs(times[:, None] - times[two]).min(axis=1, initial=np.inf)
    near: BoolArray = gap <= NEAR_S + 1e-9
    return near


def _runs(count: int, share: float, generator: np.random.Generator) -> BoolArray:
    """Frames that are missing, in runs of up to a second."""
    gone = np.zeros(count, dtype=bool)
    while gone.mean() < share:
        start = generator.integers(count)
        gone[start : start + generator.integers(1, 25)] = True
    return gone


def _spoilt(
    name: str,
    view: Filmed,
    generator: np.random.Generator,
    missing: float,
    times: FloatArray,
    noise: float = 0.5,
) -> BallMeasurements:
    pixels = np.round(view.pixels + generator.normal(0, noise, view.pixels.shape))
    keep = np.isfinite(pixels).all(axis=1) & ~_runs(len(view.times), missing, generator)
    return _measured(name, replace(view, pixels=pixels), keep, noise, times)


def _measured(
    name: str, view: Filmed, keep: BoolArray, noise: float, times: FloatArray
) -> BallMeasurements:
    rows = np.flatnonzero(keep)
    return BallMeasurements(
        np.abs(view.times[rows][:, None] - times).argmin(axis=1),
        view.times[rows],
        (name,) * len(rows),
        view.pixels[rows],
        np.full(len(rows), float(np.hypot(noise, 0.29))),
        tuple(view.cameras[row] for row in rows),
    )


def _six() -> dict[str, Camera]:
    """Static cameras in pairs on both sides, as ISSIA's."""
    return {
        f"cam{2 * at + side + 1}": looking((x, y, -14.0), (1.2 * x, 0.0, 0.0), 1500.0, size=FULL_HD)
        for at, x in enumerate((-30.0, 0.0, 30.0))
        for side, y in enumerate((55.0, -55.0))
    }


@dataclass(frozen=True)
class Click:
    """One of ISSIA's clicks on a ball."""

    frame: int
    view: str
    pixel: tuple[float, float]


def issia(data: Path) -> tuple[list[Click], dict[str, Camera], dict[str, Camera]]:
    """Clicks on the ball, the cameras as given, and those adjusted together."""
    options = IssiaOptions(lines=data / "issia-lines")
    every = list(open_issia(data / "issia", options, ReaderReport()).groups())
    clicks = [
        Click(int(group.key), view.station.key, view.ball.center)
        for group in every
        for view in group.views
        if view.ball is not None and view.ball.center is not None
    ]
    given = {
        view.station.key: view.station.given
        for group in every
        for view in group.views
        if view.station.given is not None
    }
    proposal = propose_rig(*rig_of(every), Pitch(), PAPER)
    return clicks, given, given | {change.key: change.after for change in proposal.cameras}


def clicked(clicks: Sequence[Click], cameras: Mapping[str, Camera]) -> BallMeasurements:
    """ISSIA's clicks as measurements, a pixel of noise."""
    frames = np.array([click.frame for click in clicks])
    return BallMeasurements(
        frames,
        frames / FPS,
        tuple(click.view for click in clicks),
        np.array([click.pixel for click in clicks]),
        np.ones(len(clicks)),
        tuple(cameras[click.view] for click in clicks),
    )


def _print_left_out(clicks: Sequence[Click], rigs: Mapping[str, Mapping[str, Camera]]) -> None:
    rows = []
    for name, cameras in rigs.items():
        every = clicked(clicks, cameras)
        for run, of in ((1, 5), (5, 25), (10, 40)):
            px, straight, asked, against, seconds = left_out_of(every, run, of)
            rows.append([
                f"{name} cameras, {run} of {of}", asked, len(px), float(np.median(px)),
                float(np.percentile(px, 95)), float(np.nanmedian(straight)), against, seconds,
            ])  # fmt: skip
    header = ("ISSIA, frames left out in all cameras", "clicks", "predicted", "px, median", "p95")
    header += ("interpolated", "contradicted", "CPU s")
    print_table("Does the ball's track predict what it was made without?", header, rows)


def _print_neighbours(clicks: Sequence[Click], rigs: Mapping[str, Mapping[str, Camera]]) -> None:
    """How far apart two cameras of one side put a ball on the grass, each by its own ray."""
    by_frame: dict[int, dict[str, tuple[float, float]]] = {}
    for click in clicks:
        by_frame.setdefault(click.frame, {})[click.view] = click.pixel
    rows = []
    for name, cameras in rigs.items():
        for one, other in combinations(sorted(cameras), 2):
            if cameras[one].position[1] * cameras[other].position[1] < 0:
                continue
            seen = [views for views in by_frame.values() if one in views and other in views]
            if not seen:
                continue
            places = [
                cameras[view].project_to_ground(np.array([[*views[view]] for views in seen]))
                for view in (one, other)
            ]
            apart = places[0] - places[1]
            # Along their rays a ball in the air is elsewhere for both.
            low = np.abs(apart[:, 1]) < 1.5
            if low.sum() < 10:
                continue
            median, spread = np.median(apart[low], axis=0), apart[low].std(axis=0)
            rows.append([f"{name} cameras, {one} and {other}", int(low.sum()), *median, *spread])
    header = ("ISSIA, cameras of one side", "frames on the grass", "m apart along the pitch")
    header += ("across", "their spread", "across")
    print_table("Where do neighbours put a ball that rolls?", header, rows)


def _print_jumps(
    clicks: Sequence[Click], given: Mapping[str, Camera], bundled: Mapping[str, Camera]
) -> None:
    """The ball by cameras that contradict each other, against the same by those adjusted to all clicks."""
    frames = np.arange(clicks[0].frame, clicks[-1].frame + 1)
    times = frames / FPS
    track, truth = (
        track_ball(clicked(clicks, cameras), frames, times, pitch=Pitch())
        for cameras in (given, bundled)
    )
    known = np.isfinite(track.position).all(axis=1)
    known &= np.array([len(views) > 1 for views in truth.views])
    known &= np.isfinite(truth.position).all(axis=1)
    both = replace(track, covariance=track.covariance + np.where(known, 1, np.nan)[:, None, None]
                   * truth.covariance, position=np.where(known[:, None], track.position, np.nan))  # fmt: skip
    inside, jumps = _inside(both, truth.position), np.array([one.time_s for one in track.jumps])
    gap = np.abs(times[:, None] - jumps).min(axis=1, initial=np.inf)
    off = np.linalg.norm(track.position - truth.position, axis=1)
    rows = []
    for label, near in (("at a jump", gap < 0.03), ("within 1 s", gap < 1), ("farther", gap >= 1)):
        some = known & near
        rows.append(
            [label, int(some.sum()), float(np.median(off[some])), float(inside[some].mean())]
        )
    metres = [jump.metres for jump in track.jumps]
    title = f"ISSIA, given cameras: {len(metres)} jumps of {np.median(metres):.2f} m in the median"
    print_table(title, ("frames", "of two views", "off, m, median", "inside 95 %"), rows)


def left_out_of(
    every: BallMeasurements, run: int, of: int
) -> tuple[FloatArray, FloatArray, int, int, float]:
    """Leave runs of frames out in all cameras, and predict their clicks.

    Returns:
        How far the track is from each click that it predicts, pixels, and how far a straight line
        between clicks; how many were asked for; measurements that contradict; seconds.
    """
    frames = np.arange(every.frames.min(), every.frames.max() + 1)
    gone = every.frames % of < run
    left, told = every.part(~gone), every.part(gone)
    began = time.process_time()
    track = track_ball(left, frames, frames / FPS, pitch=Pitch())
    seconds = time.process_time() - began
    px, straight = [], []
    for row in range(len(told)):
        place = track.position[told.frames[row] - frames[0]]
        if np.isfinite(place).all():
            seen = told.cameras[row].project(place[None])[0]
            px.append(float(np.hypot(*(seen - told.pixels[row]))))
            straight.append(_interpolated(left, told, row))
    return np.array(px), np.array(straight), len(told), len(track.contradicted), seconds


def _interpolated(left: BallMeasurements, told: BallMeasurements, row: int) -> float:
    """What a straight line between the nearest clicks of the same view misses by, pixels."""
    own = np.array([view == told.views[row] for view in left.views])
    times, pixels = left.times[own], left.pixels[own]
    order = np.argsort(times)
    at = np.array([np.interp(told.times[row], times[order], pixels[order, c]) for c in (0, 1)])
    return float(np.hypot(*(at - told.pixels[row])))


if __name__ == "__main__":
    bench_ball_track(seeds=int(sys.argv[1]) if len(sys.argv) > 1 else 3)
