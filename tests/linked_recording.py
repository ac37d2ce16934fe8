"""A recording of a ball and of its slow replay, with cameras over time, a link, and a run of the ball in each."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from app.db.store import Store
from app.features.recordings.ball_run_values import run_to_columns
from app.features.recordings.camera_tracking import TrackedStretch, save_cameras
from app.features.recordings.links import add_link, set_instants
from app.features.recordings.queries import insert_ball_run, update_ball_run
from app.features.recordings.service import get_recording
from app.tracking.ball_run import BallClick, BallRun, FollowedBall
from tests.bench.link import Filmed, at_times, film, made_ball
from tests.tracked_frames import frame
from tests.videos import write_video

FPS, SPEED, BEGIN = 25.0, 0.5, 1.4
LIVE, FRAMES = 100, 220
"""Four seconds live, and a replay that is half as fast and begins at the 35th frame."""
UNSURE = (5, 6)
"""Frames of each run that are uncertain."""
SIGMA_PX = 0.4
BALL = made_ball(6.0, seed=3)
TIMES = np.arange(LIVE) / FPS


def views() -> tuple[Filmed, Filmed]:
    """The ball as both shots show it."""
    again = np.arange(FRAMES - LIVE) / FPS
    live = film(at_times(BALL, TIMES), TIMES, (0.0, 62.0, -16.0), 1900.0)
    places = at_times(BALL, BEGIN + SPEED * again)
    return live, film(places, again, (18.0, -60.0, -12.0), 2000.0, lag=40)


def run_of(first: int, view: Filmed, noise: float = 0.3) -> BallRun:
    """A run of all frames of a view."""
    pixels = view.pixels + np.random.default_rng(first).normal(0, noise, view.pixels.shape)
    balls = tuple(
        FollowedBall(
            *(first + at, *pixel, 9.0, SIGMA_PX, 0.9),
            state="uncertain" if at in UNSURE else "followed",
        )
        for at, pixel in enumerate(pixels.tolist())
    )
    return BallRun((BallClick(first, *pixels[0].tolist()),), balls, "limit", "limit")


class LinkedRecording:
    """The recording, in the dataset *cup*; its runs are not accepted yet.

    Attributes:
        id: Of the recording.
        path: Its address.
        runs: Ids of the runs of the live shot and of the replay.
    """

    def __init__(
        self, api: Any, store: Store, video: Path, finished: Callable[[Any], Any], groups: list[int]
    ):
        self._store = store
        write_video(video, "mp4v", FRAMES)
        source = {"folder": f"{video.parent.name}/{video.name}"}
        job = finished(api.post("/api/v1/recordings", json={"dataset": "cup", "source": source}))
        self.id = int(job.result["recording"])
        self.path = f"/api/v1/recordings/{self.id}"
        shots = [{"first": 0, "last": LIVE - 1, "kind": "main"}]
        shots.append({"first": LIVE, "last": FRAMES - 1, "kind": "replay"})
        tag = {"If-Match": api.get(f"{self.path}/shots").headers["etag"]}
        assert api.put(f"{self.path}/shots", json={"shots": shots}, headers=tag).status_code == 200
        if groups:
            asked = {"frames": groups, "propose": False}
            assert finished(api.post(f"{self.path}/groups", json=asked)).state == "done"
        recording = get_recording(store, self.id)
        ends = (self.id, 0, LIVE - 1), (self.id, LIVE, FRAMES - 1)
        link = add_link(store, *ends, actor="ann")
        pairs = [(35 + at, LIVE + 2 * at) for at in (0, 25, 50)]
        set_instants(store, self.id, link.id, pairs, None, None, actor="ann")
        self.runs = []
        for first, view in zip((0, LIVE), views(), strict=True):
            frames = [
                replace(frame(first + at, "tracked"), camera=camera, covariance=None)
                for at, camera in enumerate(view.cameras)
            ]
            stretch = (first, first + len(frames) - 1)
            save_cameras(store, recording, stretch, TrackedStretch(frames, ()), [], "ann")
            values = run_to_columns(run_of(first, view)) | {"sha256": recording.sha256}
            values |= {"dataset_id": recording.dataset_id, "recording_id": self.id}
            with store.write() as session:
                self.runs.append(insert_ball_run(session, "ann", **values))

    def accept(self, which: int, is_accepted: bool = True) -> None:
        """Accept a run without giving groups its balls, or take that back."""
        with self._store.write() as session:
            by = "ann" if is_accepted else None
            update_ball_run(session, self.runs[which], accepted_by=by, revision=1 + is_accepted)
