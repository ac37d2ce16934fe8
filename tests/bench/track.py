"""Cameras over time: how many frames of real clips are tracked, and how well they lie (docs/track.md).

Distances are pixels at 960 wide. Paint is read anew beside each camera; clicked markings are those of the
annotated frames, met where every click lies within 0.5 % of the diagonal: by the cameras on the plan, 105 x 68 m,
and by those on the pitch that the clip shows. Without real clips a
rendered film is followed. ``python -m tests.bench.track [CLIP ...]``.
"""

from __future__ import annotations

import json
import os
import sys
import time
from collections.abc import Mapping, Sequence
from itertools import combinations
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
from scipy.stats import chi2

from app.formats.report import ReaderReport
from app.formats.sn_calibration_reader import lines_from_json
from app.geometry.arrays import FloatArray
from app.geometry.polyline import distance_to_polyline
from app.geometry.resection import X, Z
from app.paint.evidence import find_paint, trace_visible_markings
from app.soccer.annotation import Lines
from app.soccer.pitch import MARKINGS, Pitch
from app.solving.jaccard import project_markings
from app.solving.tripod_pitch import TripodPitch
from app.tracking.clip import Clip
from app.tracking.picture import make_frame_pictures
from app.tracking.track import FrameCamera, track_clip
from tests.bench.table import print_table
from tests.tripod_films import render_film

DATA = Path(os.environ.get("TOUCHLINE_REAL_DATA", Path(__file__).parents[3] / "shared" / "data"))
MEETS = float(chi2.ppf(0.95, 3))
NEAR = 0.005
PAIRS_EVERY = 5
RENDERED = 24
WARM = 12
HEADER = (
    "clip", "annotated", "frames", "tracked %", "bridged", "lost", "paint px", "p95", "clicked met",
    "sigma m", "pairs meet %", "pitch that is shown, m", "on it: paint px", "p95", "met", "sigma m",
    "pairs meet %", "frames/s", "cpu ms without decoding", "decoding ms", "both x decoding",
)  # fmt: skip


def bench_track(data: Path, names: Sequence[str] = ()) -> None:
    """Print the table: each real clip with no annotated frame, and with one of each; without them a rendered film."""
    folder = data / "broadcast"
    files = [
        *sorted((folder / "clips").glob("*.mp4")),
        *sorted((data / "replays").glob("*_clip_0.mp4")),
    ]
    rows = []
    for file in files:
        if names and file.stem not in names:
            continue
        known = clicked(Clip.open(file), file.stem, folder / "lines")
        middle = sorted(known)[len(known) // 2 : len(known) // 2 + 1]
        for chosen in ([], middle) if middle else ([],):
            rows.append(measure(file, known, chosen))
    if not files:
        with TemporaryDirectory() as place:
            rows.append(measure(render_film(RENDERED).write(Path(place)), {}, []))
    print_table("Cameras over time", HEADER, rows)


def measure(file: Path, known: Mapping[int, Lines], chosen: list[int]) -> list[object]:
    """Numbers of one clip."""
    clip = Clip.open(file)
    # What is compiled at its first use is no part of what a frame costs.
    track_clip(Clip.open(file, clip.index, last=min(clip.count, WARM) - 1), {})
    began, spent = time.perf_counter(), time.process_time()
    track = track_clip(clip, {number: known[number] for number in chosen})
    found = track.frames
    wall, cpu = time.perf_counter() - began, time.process_time() - spent
    decoding = -time.process_time()
    count = sum(1 for _ in clip.frames())
    decoding += time.process_time()
    paint = paint_distances(clip, found)
    met, met_shown = (
        [hits for number in known for hits in clicked_hits(each[number], known[number], shown)]
        for each, shown in ((found, None), (track.shown_frames, track.shown))
    )
    outcomes = [frame.outcome for frame in found]
    tracked = [frame for frame in found if frame.outcome == "tracked"]
    shown = track.shown
    on_shown = [frame for frame in track.shown_frames if frame.outcome == "tracked"]
    apart = [frame.error_px for frame in on_shown if frame.error_px is not None]
    unit = clip.size.width / 960
    return [
        file.stem, ",".join(map(str, chosen)) or "none", count,
        f"{100 * outcomes.count('tracked') / count:.1f}", outcomes.count("bridged"),
        outcomes.count("lost"), *(np.percentile(paint, [50, 95]).tolist() if paint else [None, None]),
        f"{np.mean(met):.2f} of {len(met)}" if met else None, *_agreement(tracked),
        "" if shown is None else said(shown),
        *(np.percentile(apart, [50, 95]) / unit if apart else [None, None]),
        f"{np.mean(met_shown):.2f}" if met_shown else None, *_agreement(on_shown),
        f"{count / wall:.0f}", f"{1000 * (cpu - decoding) / count:.0f}", f"{1000 * decoding / count:.1f}",
        f"{cpu / decoding:.1f}",
    ]  # fmt: skip


def _agreement(tracked: Sequence[FrameCamera]) -> list[float | None]:
    """Median sigma of the position, metres, and the percentage of pairs whose regions meet."""
    pairs = [meet(*pair) for pair in combinations(tracked[::PAIRS_EVERY], 2)]
    return [
        float(np.median([sigma_m(frame) for frame in tracked])) if tracked else None,
        100 * float(np.mean(pairs)) if pairs else None,
    ]


def said(shown: TripodPitch) -> str:
    """Length, width and crown with their standard deviations."""
    length, width = shown.size_sigmas
    crown, sigma = shown.crown
    return (
        f"{shown.pitch.length:.1f} ±{length:.1f} x {shown.pitch.width:.1f} ±{width:.1f},"
        f" crown {crown:.2f} ±{sigma:.2f}"
    )


def clicked(clip: Clip, name: str, lines: Path) -> dict[int, Lines]:
    """Clicked lines of a clip by number of their frame, pixels of the video."""
    return {
        int(file.stem.rpartition("_f")[2]): lines_from_json(
            json.loads(file.read_text(encoding="utf-8")), clip.size, file.stem, ReaderReport()
        )[0]
        for file in sorted(lines.glob(f"{name}_f*.json"))
    }


def clicked_hits(frame: FrameCamera, lines: Lines, pitch: TripodPitch | None = None) -> list[bool]:
    """Of each clicked marking of the grass, whether the camera lays it there; that of a pitch, or of the plan."""
    names = [name for name in lines if name in MARKINGS and not name.startswith("Goal")]
    if frame.camera is None:
        return [False] * len(names)
    shown = project_markings(frame.camera, Pitch(), frame.size)
    if pitch is not None:
        lines_of = ((name, frame.camera.project(pitch.sample_marking(name))) for name in names)
        shown = {name: line[np.isfinite(line).all(axis=1)] for name, line in lines_of}
    hits = []
    for name in names:
        points = np.array([[point.x, point.y] for point in lines[name]])
        polyline = shown.get(name)
        if polyline is None or len(polyline) < 2:
            hits.append(False)
            continue
        far = distance_to_polyline(points, polyline)[0].max()
        hits.append(bool(far < NEAR * frame.size.diagonal))
    return hits


def paint_distances(clip: Clip, found: list[FrameCamera]) -> list[float]:
    """Median distance of the paint of each tracked frame, pixels at 960 wide."""
    distances = []
    for picture in make_frame_pictures(clip.frames()):
        frame = found[picture.number]
        if frame.outcome != "tracked" or frame.camera is None:
            continue
        camera = clip.scale_to_work_size(frame.camera)
        unit = picture.reading.width / 960
        evidence = find_paint(
            picture.reading, trace_visible_markings(picture.reading, camera, Pitch()), 3.0 * unit
        )
        distances.append(float(np.median(np.abs(evidence.offsets))) / unit)
    return distances


def position_covariance(frame: FrameCamera) -> FloatArray:
    """Metres squared, shape (3, 3)."""
    matrix = np.reshape(frame.covariance or np.full(64, np.nan), (8, 8))
    return matrix[X : Z + 1, X : Z + 1]


def sigma_m(frame: FrameCamera) -> float:
    """Largest standard deviation of the position, metres."""
    return float(np.sqrt(np.linalg.eigvalsh(position_covariance(frame))[-1]))


def meet(one: FrameCamera, other: FrameCamera) -> bool:
    """Whether the 95 % regions of two positions meet."""
    assert one.camera is not None and other.camera is not None
    apart = one.camera.position - other.camera.position
    both = position_covariance(one) + position_covariance(other)
    return bool(apart @ np.linalg.solve(both, apart) < MEETS)


if __name__ == "__main__":
    bench_track(DATA, sys.argv[1:])
