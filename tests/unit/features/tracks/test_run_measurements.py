"""Accepted ball runs of a recording and of its linked replay measure the ball between groups."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from app.db.store import Store
from app.features.recordings.ball_run_queries import insert_run, update_run
from app.features.recordings.ball_run_values import run_columns
from app.features.recordings.camera_tracking import Tracked, save_cameras
from app.features.recordings.links import add_link, set_instants
from app.features.recordings.service import get_recording
from app.features.tracks.around import track_around
from app.features.tracks.service import list_tracks, make_tracks, read_track
from app.tracking.ball_run import BallClick, BallRun, FollowedBall
from tests.bench.link import Filmed, at_times, made_ball
from tests.bench.link import film as filmed
from tests.tracked_frames import frame
from tests.videos import write_video

Accept = Callable[[int, bool], None]
Finished = Callable[[Any], Any]
FPS, SPEED, BEGIN = 25.0, 0.5, 1.4
LIVE, FRAMES = 100, 220
"""Four seconds live, and a replay that is half as fast and begins at the 35th frame."""
BALL = made_ball(6.0, seed=3)
TIMES = np.arange(LIVE) / FPS
GROUPS = (30, 60)


def views() -> tuple[Filmed, Filmed]:
    again = np.arange(FRAMES - LIVE) / FPS
    live = filmed(at_times(BALL, TIMES), TIMES, (0.0, 62.0, -16.0), 1900.0)
    places = at_times(BALL, BEGIN + SPEED * again)
    return live, filmed(places, again, (18.0, -60.0, -12.0), 2000.0, lag=40)


def run_of(first: int, view: Filmed, noise: float = 0.3) -> BallRun:
    pixels = view.pixels + np.random.default_rng(first).normal(0, noise, view.pixels.shape)
    balls = tuple(
        FollowedBall(first + at, *pixel, 9.0, 0.4, 0.9, "uncertain" if at in (5, 6) else "followed")
        for at, pixel in enumerate(pixels.tolist())
    )
    return BallRun((BallClick(first, *pixels[0].tolist()),), balls, "limit", "limit")


@pytest.fixture
def store(app: Any) -> Store:
    found: Store = app.state.services.store
    return found


@pytest.fixture
def accepted(api: Any, store: Store, film: Path, finished: Finished) -> Accept:
    """A recording of two groups with cameras, a link and two runs; accepts one of these, or takes it back."""
    write_video(film, "mp4v", FRAMES)
    body = {"dataset": "cup", "source": {"folder": "films/final.mp4"}}
    number = finished(api.post("/api/v1/recordings", json=body)).result["recording"]
    path = f"/api/v1/recordings/{number}"
    shots = [{"first": 0, "last": LIVE - 1, "kind": "main"}]
    shots.append({"first": LIVE, "last": FRAMES - 1, "kind": "replay"})
    tag = {"If-Match": api.get(f"{path}/shots").headers["etag"]}
    assert api.put(f"{path}/shots", json={"shots": shots}, headers=tag).status_code == 200
    finished(api.post(f"{path}/groups", json={"frames": GROUPS, "propose": False}))
    recording = get_recording(store, number)
    ends = (number, 0, LIVE - 1), (number, LIVE, FRAMES - 1)
    link = add_link(store, *ends, actor="ann")
    pairs = [(35 + at, LIVE + 2 * at) for at in (0, 25, 50)]
    set_instants(store, number, link.id, pairs, None, None, actor="ann")
    ids = []
    for first, view in zip((0, LIVE), views(), strict=True):
        frames = [
            replace(frame(first + at, "tracked"), camera=camera, covariance=None)
            for at, camera in enumerate(view.cameras)
        ]
        stretch = (first, first + len(frames) - 1)
        save_cameras(store, recording, stretch, Tracked(frames, ()), [], "ann")
        with store.write() as session:
            values = run_columns(run_of(first, view))
            where = {"dataset_id": recording.dataset_id, "recording_id": number}
            values |= where | {"sha256": recording.sha256}
            ids.append(insert_run(session, "ann", **values))

    def accept(which: int, is_accepted: bool) -> None:
        with store.write() as session:
            by = "ann" if is_accepted else None
            update_run(session, ids[which], accepted_by=by, revision=1 + is_accepted)

    return accept


def made(store: Store) -> Any:
    make_tracks(store, "cup", None, "ann", lambda *_: None)
    (track,) = list_tracks(store, "cup")
    return read_track(store, track.id)


class TestFollowedRuns:
    def test_every_accepted_frame_measures_the_ball(self, store: Store, accepted: Accept) -> None:
        assert made(store).ball.reason is not None
        accepted(0, True)
        accepted(1, True)
        (before,) = list_tracks(store, "cup")
        assert before.stale
        detail = made(store)
        assert not detail.track.stale and detail.ball.reason is None
        measured = detail.inputs.measurements
        assert (detail.track.first, detail.track.last) == (0, LIVE - 1)
        assert measured.names == ("final", "final link 1")
        of_live = {
            int(n)
            for n, name in zip(measured.frames, measured.views, strict=True)
            if name == "final"
        }
        # Not what is uncertain, and not what groups show: people say there where the ball is.
        assert of_live == set(range(LIVE)) - {5, 6, *GROUPS}
        again = measured.times[[name != "final" for name in measured.views]]
        shown = BEGIN + SPEED * np.arange(FRAMES - LIVE) / FPS
        assert set(again.round(3)) == set(np.delete(shown, (5, 6)).round(3))
        assert measured.sigma == pytest.approx(0.4)
        assert np.allclose(detail.ball.times, TIMES)
        off = np.linalg.norm(detail.ball.position - at_times(BALL, TIMES), axis=1)
        both = np.array([state == "measured" for state in detail.ball.state])
        assert both.sum() > 50 and np.median(off[both]) < 0.05

    def test_the_frames_around_one_have_them_too(self, store: Store, accepted: Accept) -> None:
        accepted(0, True)
        accepted(1, True)
        track = made(store).track
        around = track_around(store, track.id, 60).detail
        assert around.ball.reason is None
        assert set(around.inputs.measurements.views) == {"final", "final link 1"}

    def test_a_run_that_is_taken_back_measures_nothing(
        self, store: Store, accepted: Accept
    ) -> None:
        accepted(0, True)
        assert made(store).inputs.measurements.names == ("final",)
        accepted(0, False)
        (track,) = list_tracks(store, "cup")
        assert track.stale
        assert len(made(store).inputs.measurements) == 0
