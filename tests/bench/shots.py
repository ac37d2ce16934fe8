"""Shots of films whose cuts are known (docs/recordings.md): what is found, how near, and how fast.

Real clips are joined where they are, rendered ones otherwise. ``python -m tests.bench.shots``.
"""

from __future__ import annotations

import os
import random
import sys
import tempfile
import time
from collections import defaultdict
from collections.abc import Sequence
from dataclasses import dataclass, field
from itertools import pairwise
from pathlib import Path

import cv2
import numpy as np

from app.config import Settings
from app.video.indexing import index_recording
from app.video.shots import RecordingShots, find_shots
from tests.bench.table import print_table
from tests.films import Clip, Join, KnownShot, flash, freeze, join, rendered, slow, whip, write_film
from tests.videos import vary_times

NEAR = 2
"""Frames that an end of a soft transition may be off."""
SIZE = (1280, 720)
CLIPS = 19
MAIN = ("dfl", "rma_sev", "avl_liv", "ang_psg", "liv_ben")
REPLAY_PARTS = (
    *(("action_0_clip_1", 60, 96), ("action_0_clip_2", 104, 126), ("action_1_clip_1", 0, 28)),
    *(("action_1_clip_1", 41, 109), ("action_1_clip_2", 0, 43), ("action_1_clip_2", 47, 120)),
)
"""Parts of replays in which one camera shows; they were made as fast as live, and are slowed down."""


@dataclass
class Found:
    """How much was found of one kind of join."""

    known: int = 0
    found: int = 0
    near: int = 0
    named: int = 0
    off: list[int] = field(default_factory=list)


def bench_shots(data: Path) -> None:
    """Print what is found in joined clips of a folder; rendered ones where it has none."""
    sources = real_clips(data) if (data / "broadcast" / "clips").is_dir() else rendered_clips()
    where = "real clips" if (data / "broadcast" / "clips").is_dir() else "rendered clips"
    totals: dict[str, Found] = defaultdict(Found)
    false = frames = 0
    seconds = processor = length = 0.0
    with tempfile.TemporaryDirectory() as folder:
        for seed, (kinds, rate, varies) in enumerate(
            [
                (("cut",), 25, False),
                (("cut",), 50, True),
                (("dissolve",), 25, False),
                (("dissolve", "wipe", "fade", "logo", "cut"), 25, False),
            ]
        ):
            film, shots, joins = make_film(sources, seed, kinds)
            path = write_film(Path(folder) / f"film{seed}.mp4", film, rate=rate)
            if varies:
                dice = random.Random(seed)
                vary_times(path, [dice.choice([256, 512, 1024]) for _ in film])
            began, busy = time.perf_counter(), time.process_time()
            found = find_shots(index_recording(path, Settings()))
            seconds += time.perf_counter() - began
            processor += time.process_time() - busy
            frames += len(film)
            length += found.shots[-1].end_s
            false += compare(found, shots, joins, totals)
    rows = [
        (kind, one.known, one.found, one.near, one.named, float(np.median(one.off or [0])))
        for kind, one in totals.items()
    ]
    header = ("join", "known", "found", "at their frames", "named so", "off (frames)")
    print_table(f"Shots of {where}, joined: {false} false", header, rows)
    print(
        f"{frames} frames of {SIZE[0]} x {SIZE[1]}, kinds not looked at: {frames / seconds:.0f} a second, "
        f"{length / seconds:.1f} times real time; {1000 * processor / frames:.1f} ms of processor a frame"
    )


def make_film(
    sources: Sequence[Clip], seed: int, kinds: Sequence[str]
) -> tuple[Clip, list[KnownShot], list[Join]]:
    """Clips in any order with flashes, freezes and whip pans, joined."""
    dice = random.Random(seed)
    clips: list[Clip] = []
    for _ in range(CLIPS):
        source = dice.choice([one for one in sources if not clips or one[0] is not clips[-1][0]])
        start = dice.randint(0, max(len(source) - 90, 0))
        clip = source[start : start + dice.randint(60, 90)]
        chance = dice.random()
        if chance < 0.15:
            clip = flash(clip, len(clip) // 2, dice.randint(1, 3), dice.uniform(1.4, 2.4))
        elif chance < 0.3:
            clip = freeze(clip, len(clip) // 2, 15)
        clips.append(clip)
    if seed == 0:
        clips[2] = whip(clips[2][0], (clips[2][0].shape[1], clips[2][0].shape[0]), 50, 0.25)
    lengths = {
        "cut": (0, 0),
        "dissolve": (6, 24),
        "wipe": (8, 18),
        "fade": (10, 22),
        "logo": (10, 18),
    }
    joins = []
    for kind in dice.choices(kinds, k=CLIPS - 1):
        joins.append(Join(kind, dice.randint(*lengths[kind]), dice.choice([0, 90, 180, 270])))
    return *join(clips, joins), joins


def compare(
    found: RecordingShots,
    shots: Sequence[KnownShot],
    joins: Sequence[Join],
    totals: dict[str, Found],
) -> int:
    """Count what was found of a film; returns how many boundaries are none."""
    boundaries = [
        (one.last + 1, other.first - 1, other.entered_by) for one, other in pairwise(found.shots)
    ]
    used = set()
    for (one, other), how in zip(pairwise(shots), joins, strict=True):
        count = totals[how.kind]
        count.known += 1
        first, last = one.last + 1, other.first - 1
        slack = 0 if how.kind == "cut" else NEAR
        at = [b for b in boundaries if b[0] <= last + 1 + slack and b[1] >= first - 1 - slack]
        used |= set(at)
        if at:
            best = min(at, key=lambda b: max(abs(b[0] - first), abs(b[1] - last)))
            off = max(abs(best[0] - first), abs(best[1] - last))
            count.found += 1
            count.off.append(off)
            count.near += off <= slack and len(at) == 1
            count.named += best[2] == {"logo": "wipe"}.get(how.kind, how.kind)
    return len(set(boundaries) - used)


def real_clips(data: Path) -> list[Clip]:
    """Clips of main cameras, of live play and of replays."""
    clips = [read_clip(data / "broadcast" / "clips" / f"{name}.mp4") for name in MAIN]
    for name in ("action_0_clip_0", "action_1_clip_0"):
        clips.append(read_clip(data / "replays" / f"{name}.mp4"))
    for name, first, stop in REPLAY_PARTS:
        clips.append(slow(read_clip(data / "replays" / f"{name}.mp4")[first:stop], 3, blend=True))
    return clips


def rendered_clips() -> list[Clip]:
    """Scenes that nobody filmed."""
    return [rendered(seed, 100, SIZE) for seed in range(8)]


def read_clip(path: Path) -> Clip:
    """The pictures of a clip, all of one size."""
    video, pictures = cv2.VideoCapture(str(path)), []
    while video.grab():
        pictures.append(cv2.resize(video.retrieve()[1], SIZE, interpolation=cv2.INTER_AREA))
    video.release()
    return pictures


if __name__ == "__main__":
    bench_shots(
        Path(sys.argv[1] if len(sys.argv) > 1 else os.environ.get("TOUCHLINE_REAL_DATA", "nowhere"))
    )
