"""One click follows the ball: through the sample's recording, whose true ball is known, and through real clips.

``python -m tests.bench.ball_follow [SECONDS | FILM.mp4 | rig]``; without seconds the three minutes; ``rig``: groups of
a static rig (``rig_follow``), which need ``TOUCHLINE_REAL_DATA``. A simulated person
clicks a visible ball, looks through what was followed, and clicks again where the run ends though the ball is seen,
or where it is wrong; clicks miss the centre by a pixel and a half.
"""

from __future__ import annotations

import os
import sys
import tempfile
import time
from collections.abc import Iterator
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np

from app.sample import RECORDING_SECONDS
from app.sample.recording import write_recording
from app.tracking.ball_follow import follow_ball
from app.tracking.ball_run import BallClick, BallRun, FollowedBall, FollowHints
from app.video.frames import Image, RecordingReader
from app.video.index import RecordingIndex
from tests.bench.recording import KnownRecording, camera_of
from tests.bench.rig_follow import bench_rig_follow
from tests.bench.table import print_table

CLICK_PX = 1.5
"""Standard deviation of a click along each axis, pixels."""
EACH_WAY = 250
"""Frames that one click is followed to either side."""
BEHIND = 24
KEPT_BYTES = 200 * 2**20
MOST_CLICKS = 400


class Frames:
    """Reads frames of a film, backwards as quickly as forwards."""

    def __init__(self, path: Path, index: RecordingIndex):
        self._reader = RecordingReader(path, index, KEPT_BYTES)

    def read(self, number: int) -> Image:
        """A frame: red green blue, shape (H, W, 3)."""
        if not self._reader.has(number) and not self._reader.has(number - 1):
            for before in range(max(number - BEHIND, 0), number):
                self._reader.read(before)
        return self._reader.read(number)


@dataclass
class Told:
    """What came of a shot.

    Attributes:
        frames: Frames with a ball that can be seen, and that nothing hides.
        clicks: That the simulated person needed.
        first: How many of the frames the first click alone got right, and wrong without a mark.
        off: How far followed centres are off, pixels; and sigmas.
        unmarked: Followed frames that are wrong.
        marked: Uncertain frames, right and wrong.
        stretches: Uncertain frames in a row, which a person looks at.
    """

    frames: int = 0
    clicks: int = 0
    right: int = 0
    one_px: int = 0
    off: list[float] = field(default_factory=list)
    sigma: list[float] = field(default_factory=list)
    unmarked: int = 0
    marked: list[int] = field(default_factory=lambda: [0, 0])
    stretches: int = 0
    seconds: float = 0.0
    read: int = 0
    ends: list[str] = field(default_factory=list)


def followed_shot(
    frames: Frames,
    rows: list[dict[str, Any]],
    with_cameras: bool,
    seed: int,
) -> Told:
    """What a simulated person needs for a shot whose truth is known; every click but the first mends a run."""
    dice = np.random.default_rng(seed)
    by_number = {row["frame"]: row for row in rows}
    cameras = {row["frame"]: camera_of(row) for row in rows} if with_cameras else {}
    hints = FollowHints(cameras)
    first, last = rows[0]["frame"], rows[-1]["frame"]
    seen = {n: row for n, row in by_number.items() if row["pixel"] and not row["hidden"]}
    told = Told(frames=len(seen))
    runs: list[BallRun] = []
    tried: set[int] = set()

    def run_at(frame: int) -> int | None:
        """The run of a frame, or the one nearest to it, which the person has open."""
        off = [max(run.first - frame, frame - run.last, 0) for run in runs]
        return int(np.argmin(off)) if off else None

    def click(frame: int) -> BallRun | None:
        x, y = np.array(seen[frame]["pixel"]) + dice.normal(0, CLICK_PX, 2)
        began = time.process_time()
        before = range(frame - 1, max(first, frame - EACH_WAY) - 1, -1)
        after = range(frame + 1, min(last, frame + EACH_WAY) + 1)
        mended = run_at(frame)
        given = hints
        if mended is not None:
            run = runs[mended]
            given = replace(hints, seen=run.find_most_certain_click(), clicks=run.clicks)
        one = BallClick(frame, float(x), float(y))
        found = follow_ball(frames.read, one, before, after, given)
        told.seconds += time.process_time() - began
        told.clicks += 1
        tried.add(frame)
        if found is not None:
            told.read += len(found.balls)
        return found

    while told.clicks < MOST_CLICKS:
        # What was followed from a click is looked through; a wrong frame without a mark is clicked.
        known: dict[int, FollowedBall] = {}
        for run in runs:
            known |= {ball.frame: ball for ball in run.balls}
        wrong = next(
            (n for n, ball in sorted(known.items()) if n not in tried and ball.state == "followed" and is_wrong(ball, seen.get(n))
             and n in seen),
            None,
        )  # fmt: skip
        left = next((n for n in sorted(seen) if n not in known and n not in tried), None)
        frame = wrong if wrong is not None else left
        if frame is None:
            break
        run = click(frame)
        if run is None:
            continue
        near = run_at(frame)
        if near is None:
            runs.append(run)
        else:
            runs[near] = runs[near].merge_run(run)
        told.ends += [run.before, run.after]
    judged(runs, seen, by_number, told)
    return told


def is_wrong(ball: FollowedBall, row: dict[str, Any] | None) -> bool:
    """Whether a place is off by more than half a diameter."""
    if row is None:
        return True
    return float(np.hypot(*(np.array(row["pixel"]) - (ball.x, ball.y)))) > row["diameter_px"] / 2


def judged(
    runs: list[BallRun],
    seen: dict[int, dict[str, Any]],
    every: dict[int, dict[str, Any]],
    told: Told,
) -> None:
    """Compare runs with the truth."""
    known: dict[int, FollowedBall] = {}
    for run in runs:
        known |= {ball.frame: ball for ball in run.balls}
    before = "followed"
    for number in sorted(known):
        ball, row = known[number], seen.get(number)
        if ball.state == "uncertain" and before != "uncertain":
            told.stretches += 1
        before = ball.state
        if row is None:
            # Somebody stands before it: right where the ball is all the same.
            whole = every[number]
            off = is_wrong(ball, whole if whole["pixel"] else None)
            told.unmarked += ball.state == "followed" and off
            continue
        off_px = float(np.hypot(*(np.array(row["pixel"]) - (ball.x, ball.y))))
        wrong = is_wrong(ball, row)
        if ball.state == "uncertain":
            told.marked[wrong] += 1
            continue
        told.unmarked += wrong
        told.right += not wrong
        told.one_px += off_px <= 1.0
        if not wrong:
            told.off.append(off_px)
            told.sigma.append(ball.sigma_px)


def shots_of(known: KnownRecording) -> Iterator[tuple[int, list[dict[str, Any]]]]:
    """Live shots and replays, with the truth of their frames."""
    for number, shot in enumerate(known.truth["shots"]):
        if shot["kind"] in ("main", "replay"):
            yield number, known.rows(number)


def bench_ball_follow(seconds: float = RECORDING_SECONDS, path: Path | None = None) -> None:
    """Print what one click follows."""
    with tempfile.TemporaryDirectory() as folder:
        out = path or Path(folder) / "film.mp4"
        if not out.is_file():
            write_recording(out, seconds)
        known = KnownRecording.open(out)
        for with_cameras in (True, False):
            table: list[list[object]] = []
            whole = Told()
            for number, rows in shots_of(known):
                frames, kind = Frames(known.path, known.index), known.truth["shots"][number]["kind"]
                told = followed_shot(frames, rows, with_cameras, number)
                table.append([number + 1, kind, *_cells(told)])
                _add(whole, told)
            table.append(["all", "", *_cells(whole)])
            print_table(
                f"The sample's film, {'with' if with_cameras else 'without'} cameras over time",
                (
                    "shot", "kind", "ball s", "clicks", "clicks a s", "within half a diameter %",
                    "within 1 px %", "wrong, not marked %", "uncertain, right %", "uncertain, wrong %",
                    "stretches to look at, a s", "off px, median", "p95", "sigma px, median", "cpu ms a frame",
                ),
                table,
            )  # fmt: skip


def _cells(told: Told) -> list[object]:
    seconds = told.frames / 25
    share = 100 / max(told.frames, 1)
    off = np.array(told.off or [np.nan])
    return [
        seconds, told.clicks, told.clicks / max(seconds, 1e-9), share * told.right, share * told.one_px,
        share * told.unmarked, share * told.marked[0], share * told.marked[1], told.stretches / max(seconds, 1e-9),
        float(np.median(off)), float(np.percentile(off, 95)), float(np.median(told.sigma or [np.nan])),
        1000 * told.seconds / max(told.read, 1),
    ]  # fmt: skip


def _add(whole: Told, told: Told) -> None:
    for name in ("frames", "clicks", "right", "one_px", "unmarked", "stretches", "seconds", "read"):
        setattr(whole, name, getattr(whole, name) + getattr(told, name))
    whole.off += told.off
    whole.sigma += told.sigma
    whole.marked = [a + b for a, b in zip(whole.marked, told.marked, strict=True)]


if __name__ == "__main__":
    arguments = sys.argv[1:]
    if arguments == ["rig"]:
        bench_rig_follow(Path(os.environ["TOUCHLINE_REAL_DATA"]) / "issia")
        sys.exit()
    made = [Path(one) for one in arguments if one.endswith(".mp4")]
    numbers = [float(one) for one in arguments if not one.endswith(".mp4")]
    bench_ball_follow(numbers[0] if numbers else RECORDING_SECONDS, made[0] if made else None)
