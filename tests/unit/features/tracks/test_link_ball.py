"""Links found from the ball, which files say or groups have, with cameras over time."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import asdict, replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from app.db.idempotency import without_pending_response
from app.db.json_columns import compress_json
from app.db.session import now
from app.db.store import Store
from app.features.datasets.service import read_dataset_head
from app.features.recordings.camera_tracking import TrackedStretch, save_cameras
from app.features.recordings.links import get_link
from app.features.recordings.service import get_recording
from app.features.tracks.codec import TrackInputs, inputs_to_json, track_to_json
from app.features.tracks.link_ball import _iterate_balls_of_groups, read_tracked_ball_positions
from app.features.tracks.queries import insert_track
from app.features.tracks.service import TrackReview, list_tracks, review_track
from app.features.tracks.stored import TrackSummary, compute_track_stamp
from app.geometry.arrays import FloatArray
from app.json_text import canonical_json_text
from app.soccer.pitch import Pitch
from app.solving.sides import turn_camera
from app.tracking.ball_track import BallMeasurements, BallTrack
from tests.bench.link import Filmed, at_times, film, made_ball
from tests.tracked_frames import CAMERA, frame
from tests.videos import write_video

Finished = Callable[[Any], Any]
FPS, SPEED, BEGIN = 25.0, 0.5, 1.5
LIVE, FRAMES = 150, 300
"""Six seconds live, and six of a replay that is half as fast and begins one and a half seconds later."""
REST = np.column_stack([np.arange(0, 8, 0.02), np.full((400, 2), 3.0), np.full(400, -0.1)])


def both(ball: FloatArray) -> tuple[Filmed, Filmed]:
    """A ball as the live camera and that of the replay see it, with half a pixel of noise."""
    generator = np.random.default_rng(4)
    live = np.arange(LIVE) / FPS
    replay = np.arange(FRAMES - LIVE) / FPS
    views = (
        film(at_times(ball, live), live, (0.0, 62.0, -16.0), 1900.0),
        film(at_times(ball, BEGIN + SPEED * replay), replay, (18.0, -60.0, -12.0), 2000.0, lag=40),
    )
    for view in views:
        view.pixels[:] += generator.normal(0, 0.5, view.pixels.shape)
    return views


@pytest.fixture
def store(app: Any) -> Store:
    found: Store = app.state.services.store
    return found


@pytest.fixture
def link(api: Any, film: Path, finished: Finished) -> str:
    """The address of a link without instants."""
    write_video(film, "mp4v", FRAMES)
    body = {"dataset": "cup", "source": {"folder": "films/final.mp4"}}
    recording = finished(api.post("/api/v1/recordings", json=body)).result["recording"]
    both = {
        "live": {"first": 0, "last": LIVE - 1},
        "replay": {"recording": recording, "first": LIVE, "last": FRAMES - 1},
    }
    made = api.post(f"/api/v1/recordings/{recording}/links", json=both)
    return str(made.headers["location"])


def tracked(store: Store, views: tuple[Filmed, Filmed]) -> None:
    """Let both shots have the cameras of views."""
    recording = get_recording(store, 1)
    for first, view in zip((0, LIVE), views, strict=True):
        frames = [
            replace(frame(first + at, "tracked"), camera=camera)
            for at, camera in enumerate(view.cameras)
        ]
        stretch = (first, first + len(frames) - 1)
        save_cameras(store, recording, stretch, TrackedStretch(frames, ()), [], "ann")


def uploads(api: Any, views: tuple[Filmed, Filmed]) -> dict[str, str]:
    """The uploads of what a detector says of both views."""
    sent = {}
    for name, first, view in zip(("live", "replay"), (0, LIVE), views, strict=True):
        rows = [f"{first + at},{at / FPS},{x},{y}" for at, (x, y) in enumerate(view.pixels)]
        # Of another shot, and no number.
        text = "\n".join(["frame,time_s,x,y", *rows, "900,36,1,2", "7.5,0,1,2"])
        kind = {"content-type": "application/octet-stream"}
        answer = api.post("/api/v1/uploads?name=ball.csv", content=text.encode(), headers=kind)
        sent[f"{name}_upload"] = answer.json()["id"]
    return sent


class TestLinkByBall:
    def test_planted_times_are_found_with_the_misses_of_the_rays(
        self, api: Any, store: Store, link: str, finished: Finished
    ) -> None:
        views = both(made_ball(8.0, seed=3))
        tracked(store, views)
        job = finished(api.post(f"{link}/ball", json=uploads(api, views)))
        assert (job.state, job.result["reason"]) == ("done", None)
        # The rows without a number: those of another shot are no concern of the link.
        assert job.result["left_out"] == 2
        found = api.get(link).json()["map"]
        assert (found["outcome"], found["found_by"], found["pieces"]) == ("linked", "ball", [])
        assert found["speed"] == pytest.approx(SPEED, rel=0.01)
        assert found["offset_s"] == pytest.approx(BEGIN, abs=0.1 / FPS)
        assert 0 < found["sigma_s"] < 0.1 / FPS
        misses = [one["miss_m"] for one in found["misses"]]
        assert len(misses) > 120
        assert np.median(misses) == pytest.approx(found["miss_m"], rel=0.05)
        frames = api.get(f"{link}/frames").json()
        assert frames["replay"][50] == LIVE + round((50 / FPS - BEGIN) / SPEED * FPS)

    def test_a_replay_that_was_tracked_turned_is_told_and_links_once_it_is_turned_back(
        self, api: Any, store: Store, link: str, finished: Finished
    ) -> None:
        live, replay = views = both(made_ball(8.0, seed=3))
        opposite = [turn_camera(camera) for camera in replay.cameras]
        tracked(store, (live, replace(replay, cameras=opposite)))
        sent = uploads(api, views)
        finished(api.post(f"{link}/ball", json=sent))
        found = api.get(link).json()["map"]
        assert (found["outcome"], found["turned"]) == ("unobservable", True)
        assert "turned to the other side of the pitch" in found["reason"]
        at = link.partition("/links")[0]
        job = finished(api.patch(f"{at}/cameras/{LIVE}", json={"turned": True}))
        assert (job.state, job.result["turned"]) == ("done", True)
        finished(api.post(f"{link}/ball", json=sent))
        found = api.get(link).json()["map"]
        assert (found["outcome"], found["turned"]) == ("linked", False)
        assert found["speed"] == pytest.approx(SPEED, rel=0.01)

    def test_a_resting_ball_is_refused_and_a_map_of_instants_stays(
        self, api: Any, store: Store, link: str, finished: Finished
    ) -> None:
        views = both(REST)
        tracked(store, views)
        sent = uploads(api, views)
        assert "hardly moves" in finished(api.post(f"{link}/ball", json=sent)).result["reason"]
        found = api.get(link).json()
        assert (found["map"]["outcome"], found["map"]["speed"]) == ("unobservable", None)
        assert "hardly moves" in found["map"]["reason"]
        pairs = {"instants": [{"live": 40, "replay": 155}, {"live": 100, "replay": 275}]}
        tag = {"If-Match": found["etag"]}
        linked = api.put(f"{link}/instants", json=pairs, headers=tag).json()["map"]
        assert linked["ball_reason"] is None
        finished(api.post(f"{link}/ball", json=sent))
        after = api.get(link).json()
        assert after["map"] == {**linked, "ball_reason": after["map"]["ball_reason"]}
        assert "hardly moves" in after["map"]["ball_reason"]
        assert len(after["instants"]) == 2

    def test_without_cameras_it_says_what_to_do(
        self, api: Any, link: str, finished: Finished
    ) -> None:
        sent = uploads(api, both(REST))
        job = finished(api.post(f"{link}/ball", json=sent))
        assert job.state == "failed"
        assert (
            "150 balls in the file, but no camera in any of those frames" in job.problem["detail"]
        )
        assert "Track the camera of the shot" in job.problem["hint"]
        assert api.post(f"{link}/ball", json={"live_upload": "0" * 32}).status_code == 404


class TestOfTracks:
    def test_a_track_says_where_the_ball_was_in_live_frames_that_nobody_marked(
        self, api: Any, store: Store, link: str, finished: Finished
    ) -> None:
        ball = made_ball(8.0, seed=3)
        views = both(ball)
        tracked(store, views)
        sent = {"replay_upload": uploads(api, views)["replay_upload"]}
        without = finished(api.post(f"{link}/ball", json=sent))
        assert "have no ball in their groups" in without.problem["detail"]
        insert_track_of(store, ball, np.arange(LIVE) / FPS)
        job = finished(api.post(f"{link}/ball", json=sent))
        assert (job.state, job.result["reason"]) == ("done", None)
        found = api.get(link).json()["map"]
        assert found["speed"] == pytest.approx(SPEED, rel=0.01)
        assert found["offset_s"] == pytest.approx(BEGIN, abs=0.1 / FPS)

    def test_a_track_in_which_the_replay_takes_part_says_nothing_of_its_times(
        self, api: Any, store: Store, link: str
    ) -> None:
        insert_track_of(store, made_ball(8.0, seed=3), np.arange(LIVE) / FPS, "final link 1")
        recording, shot = get_recording(store, 1), get_link(store, 1, 1).live
        assert read_tracked_ball_positions(store, recording, shot, 1) == {}
        assert len(read_tracked_ball_positions(store, recording, shot, 2)) == LIVE

    def test_a_track_that_a_person_rejected_says_nothing(
        self, api: Any, store: Store, link: str
    ) -> None:
        insert_track_of(store, made_ball(8.0, seed=3), np.arange(LIVE) / FPS)
        recording, shot = get_recording(store, 1), get_link(store, 1, 1).live
        assert len(read_tracked_ball_positions(store, recording, shot, 1)) == LIVE
        (track,) = list_tracks(store, recording.dataset_id)
        review_track(store, track.id, TrackReview("rejected"), track.etag, actor="ann")
        assert read_tracked_ball_positions(store, recording, shot, 1) == {}


def insert_track_of(store: Store, ball: FloatArray, times: FloatArray, view: str = "final") -> None:
    """The track of a ball over the live shot, known to a centimetre."""
    frames, count = np.arange(len(times)), len(times)
    empty = np.zeros((count, 3))
    made = BallTrack(
        frames,
        times,
        at_times(ball, times),
        empty,
        np.broadcast_to(np.eye(6) * 1e-4, (count, 6, 6)),
        ("measured",) * count,
        ("roll",) * count,
        ((view,),) * count,
    )
    pixels = np.zeros((1, 2))
    measured = BallMeasurements(frames[:1], times[:1], (view,), pixels, np.ones(1), (CAMERA,))
    inputs = TrackInputs(frames, times, Pitch(), measured)
    counts = {"measured": count}
    summary = TrackSummary(count, counts, {}, 1, 0, None, None, None, None, FPS, {})
    dataset = get_recording(store, 1).dataset_id
    with store.write() as session, without_pending_response():
        policy = read_dataset_head(session, dataset).policy
        stretch = {"key": "final 0-149", "match": "final", "first": 0, "last": count - 1}
        values = {
            "dataset_id": dataset,
            **stretch,
            "stamp": compute_track_stamp(policy, (), SimpleNamespace(**stretch)),
            "digest": "none",
            "inputs": compress_json(inputs_to_json(inputs)),
            "body": compress_json(track_to_json(made)),
            "summary": canonical_json_text(asdict(summary)),
            "corrections": "[]",
            "revision": 0,
            **dict.fromkeys(("verdict", "note", "judged_by", "judged_at")),
            "actor": "ann",
            "created": now(),
        }
        insert_track(session, values)


class TestOfGroups:
    def test_balls_of_groups_of_both_shots_are_found_by_their_frame(
        self, api: Any, store: Store, link: str, finished: Finished
    ) -> None:
        at = link.partition("/links")[0]
        finished(api.post(f"{at}/groups", json={"frames": [10, 20, 160], "propose": False}))
        for row in api.get("/api/v1/groups", params={"dataset": "cup"}).json()["items"][:2]:
            group = api.get(f"/api/v1/groups/{row['id']}")
            (view,) = group.json()["views"]
            ball = {"point": [63, 44]}
            tag = {"If-Match": group.headers["etag"]}
            path = f"/api/v1/views/{view['id']}/ball"
            answer = api.patch(path, json=ball, headers=tag)
            assert answer.status_code == 200, answer.text
        found = get_link(store, 1, 1)
        sides = (found.live, found.replay)
        assert dict(_iterate_balls_of_groups(store, found.live, sides)) == {
            10: ((63.0, 44.0), None),
            20: ((63.0, 44.0), None),
        }
