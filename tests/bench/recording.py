"""The sample's recording, found again by those who never saw how it was drawn: shots, cameras, links.

``python -m tests.bench.recording [SECONDS]``; without seconds the three minutes.
"""

from __future__ import annotations

import json
import sys
import tempfile
import time
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from app.config import Settings
from app.formats.camera_json import camera_from_json
from app.geometry.arrays import FloatArray
from app.geometry.camera import Camera
from app.sample import RECORDING_SECONDS
from app.sample.recording import write_recording
from app.tracking.ball_rays import BallRays, build_ball_rays
from app.tracking.clip import Clip
from app.tracking.link import find_time_map
from app.tracking.time_map import TimeMap
from app.tracking.track import FrameCamera, track_clip
from app.video.index import RecordingIndex
from app.video.indexing import index_recording
from app.video.shots import Shot, find_shots_of_indexed_recording
from tests.bench.table import print_table

NOISE_PX = 0.5
GRID = np.stack(np.meshgrid(np.linspace(0, 1279, 9), np.linspace(0, 719, 7)), -1).reshape(-1, 2)


@dataclass(frozen=True)
class KnownRecording:
    """A recording and its truth.

    Attributes:
        path: The video.
        truth: What ``write_recording`` has written beside it.
        index: Of the video.
    """

    path: Path
    truth: dict[str, Any]
    index: RecordingIndex

    @staticmethod
    def open(path: Path) -> KnownRecording:
        """The recording that was written to a path."""
        truth = json.loads(path.with_suffix(".json").read_text(encoding="utf-8"))
        return KnownRecording(path, truth, index_recording(path, Settings()))

    def rows(self, shot: int) -> list[dict[str, Any]]:
        """The truth of the frames of a shot."""
        return [row for row in self.truth["each"] if row["shot"] == shot]

    def found_shots(self) -> list[Shot]:
        """Its shots as the product finds them."""
        return list(find_shots_of_indexed_recording(self.path, self.index).shots)

    def tracked(self, shot: int) -> list[FrameCamera]:
        """The cameras of a shot as the product finds them."""
        known = self.truth["shots"][shot]
        return track_clip(
            Clip.open(self.path, self.index, known["first"], known["last"]), {}
        ).frames

    def linked(self, link: dict[str, Any], noise_px: float, seed: int = 0) -> TimeMap:
        """The map of a replay's times as the product finds it, from true cameras and a noisy ball."""
        dice = np.random.default_rng(seed)
        live, replay = (self._rays(link[side], noise_px, dice) for side in ("live", "replay"))
        return find_time_map(live, replay)

    def _rays(self, shot: int, noise_px: float, dice: np.random.Generator) -> BallRays:
        # What is repeated or mixed is marked in the product, and says nothing new.
        rows = [
            row
            for row in self.rows(shot)
            if row["pixel"] and not row["hidden"] and not row["repeats"] and not row["mixes"]
        ]
        noisy = np.array([row["pixel"] for row in rows]) + dice.normal(0, noise_px, (len(rows), 2))
        times = [row["frame"] / self.truth["fps"] for row in rows]
        return build_ball_rays(times, noisy.tolist(), [camera_of(row) for row in rows])

    def middle_of(self, shot: int) -> float:
        """The middle of a shot, seconds."""
        known = self.truth["shots"][shot]
        return float((known["first"] + known["last"]) / 2 / self.truth["fps"])


def camera_of(row: dict[str, Any]) -> Camera:
    """The true camera of a frame."""
    return camera_from_json(row["camera"], "truth")


def off_px(found: Camera, truth: Camera) -> float:
    """How far a camera lays the grass of a picture from where it is, the most of a grid."""
    ground = truth.project_to_ground(GRID)
    seen = np.isfinite(ground).all(axis=1) & (np.abs(ground) < (52.5, 34)).all(axis=1)
    places = np.column_stack([ground[seen], np.zeros(seen.sum())])
    return float(np.hypot(*(found.project(places) - GRID[seen]).T).max())


def turned(camera: Camera) -> Camera:
    """The camera that sees the same of a pitch that is turned by half: paint cannot tell which is which."""
    turn = np.diag([-1.0, -1.0, 1.0])
    return Camera(
        camera.rotation @ turn, turn @ camera.position, camera.focal_length,
        camera.principal_point, distortion=camera.distortion,
    )  # fmt: skip


def compared(
    found: list[FrameCamera], rows: list[dict[str, Any]]
) -> tuple[float, FloatArray, FloatArray]:
    """Share of a shot's frames that are tracked, and of those how far grass (px) and position (m) are off."""
    tracked = [
        (frame.camera, camera_of(row))
        for frame, row in zip(found, rows, strict=True)
        if frame.outcome == "tracked" and frame.camera is not None
    ]
    pixels, metres = [], []
    for camera, truth in tracked:
        alike = min((camera, turned(camera)), key=lambda one: off_px(one, truth))
        pixels.append(off_px(alike, truth))
        metres.append(float(np.linalg.norm(alike.position - truth.position)))
    return len(tracked) / len(rows), np.array(pixels), np.array(metres)


def bench_recording(seconds: float = RECORDING_SECONDS, path: Path | None = None) -> None:
    """Print what is found of a recording of the sample."""
    with tempfile.TemporaryDirectory() as folder:
        out = path or Path(folder) / "film.mp4"
        if not out.is_file():
            began = time.process_time()
            written = write_recording(out, seconds)
            spent = 1000 * (time.process_time() - began) / written.frames
            print(f"\n{written.frames} frames drawn, {spent:.1f} ms of processor each")
        known = KnownRecording.open(out)

        rows: list[list[object]] = []
        found = known.found_shots()
        for number, truth in enumerate(known.truth["shots"]):
            at = min(found, key=lambda one: abs(one.first - truth["first"]))
            row: list[object] = [
                number + 1, truth["kind"], at.kind, truth["entered_by"], at.entered_by,
                at.first - truth["first"], at.last - truth["last"],
            ]  # fmt: skip
            if truth["kind"] == "main":
                began = time.process_time()
                share, pixels, metres = compared(known.tracked(number), known.rows(number))
                each = 1000 * (time.process_time() - began) / (truth["last"] - truth["first"] + 1)
                row += [100 * share, float(np.median(pixels)), float(np.percentile(pixels, 95))]
                row += [float(np.median(metres)), each]
            rows.append(row + [None] * (12 - len(row)))
        print_table(
            f"The sample's recording: {len(found)} shots found of {len(rows)}",
            (
                "shot", "kind", "found", "entered by", "found", "first off", "last off",
                "tracked %", "grass off px, median", "p95", "position off m, median", "cpu ms a frame",
            ),
            rows,
        )  # fmt: skip
        links: list[list[object]] = []
        for link in known.truth["links"]:
            for noise in (0.3, NOISE_PX, 1.0):
                found_map = known.linked(link, noise)
                links.append(
                    [link["replay"] + 1, link["speed"], noise, *link_errors(known, link, found_map)]
                )
        header = (
            "replay",
            "speed",
            "noise px",
            "outcome",
            "time off, frames",
            "speed off, %",
            "sigma, frames",
        )
        print_table("Replays linked from true cameras and a noisy ball", header, links)


def link_errors(known: KnownRecording, link: dict[str, Any], found: TimeMap) -> list[object]:
    """Outcome, and how far the time in the middle of the replay (live frames) and the speed (%) are off."""
    if found.offset is None or found.speed is None:
        return [found.reason, None, None, None]
    middle = known.middle_of(link["replay"])
    off = (found.offset - link["offset_s"]) + (found.speed - link["speed"]) * middle
    sigma = None
    if found.covariance is not None:
        way = np.array([1.0, middle])
        sigma = float(np.sqrt(way @ found.covariance @ way)) * known.truth["fps"]
    return ["linked", off * known.truth["fps"], 100 * (found.speed / link["speed"] - 1), sigma]


if __name__ == "__main__":
    arguments = sys.argv[1:]
    made = [Path(one) for one in arguments if one.endswith(".mp4")]
    numbers = [float(one) for one in arguments if not one.endswith(".mp4")]
    bench_recording(numbers[0] if numbers else RECORDING_SECONDS, made[0] if made else None)
