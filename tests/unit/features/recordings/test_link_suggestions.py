"""Live shots that are suggested for a replay, by where cameras look and by the half of the match."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from app.db.store import Store
from app.features.recordings.camera_tracking import TrackedStretch, save_cameras
from app.features.recordings.service import get_recording
from app.geometry.camera import Camera
from app.solving.sides import turn_camera
from tests.bench.link import at_times, film, made_ball
from tests.tracked_frames import frame
from tests.videos import write_video

Finished = Callable[[Any], Any]
FPS = 25.0
SHOTS = [(0, 74, "main"), (75, 149, "main"), (150, 224, "main"), (225, 299, "replay")]
BALL = made_ball(30.0, seed=7)


@pytest.fixture
def match(api: Any, film: Path, finished: Finished) -> str:
    """The address of a recording of three live shots and a replay."""
    write_video(film, "mp4v", 300)
    body = {"dataset": "cup", "source": {"folder": "films/final.mp4"}}
    number = finished(api.post("/api/v1/recordings", json=body)).result["recording"]
    at = f"/api/v1/recordings/{number}"
    tag = {"If-Match": api.get(f"{at}/shots").headers["etag"]}
    items = [{"first": a, "last": b, "kind": kind} for a, b, kind in SHOTS]
    assert api.put(f"{at}/shots", json={"shots": items}, headers=tag).status_code == 200
    return at


def follow(first: float, stand: tuple[float, float, float], speed: float = 1.0) -> list[Camera]:
    """The cameras of a shot that follows play from a time on."""
    times = np.arange(75) / FPS
    places = at_times(BALL, first + speed * times)
    return list(film(places, times, stand, 1900.0).cameras)


def track(store: Store, shot: int, cameras: list[Camera]) -> None:
    recording, (first, last, _) = get_recording(store, 1), SHOTS[shot]
    frames = [
        replace(frame(first + at, "tracked"), camera=camera) for at, camera in enumerate(cameras)
    ]
    save_cameras(store, recording, (first, last), TrackedStretch(frames, ()), [], "ann")


def suggested(api: Any, match: str) -> list[dict[str, Any]]:
    found: list[dict[str, Any]] = api.get(f"{match}/links/suggestions/250").json()["items"]
    return found


def test_the_shot_that_looks_where_the_replay_looks_comes_before_a_nearer_one(
    app: Any, api: Any, match: str
) -> None:
    store, stand = app.state.services.store, (0.0, 62.0, -16.0)
    assert [one["first"] for one in suggested(api, match)] == [150, 75, 0]
    replay = [turn_camera(one) for one in follow(2.0, (10.0, -66.0, -14.0), 0.5)]
    track(store, 0, follow(1.0, stand))
    track(store, 3, replay)
    one, *others = suggested(api, match)
    assert (one["first"], one["turned"]) == (0, True) and one["apart_m"] < 6
    assert "At speed 0.5, both show places" in one["why"]
    assert [other["apart_m"] for other in others] == [None, None]
    track(store, 2, follow(15.0, stand))
    found = suggested(api, match)
    assert found[0]["first"] == 0 and found[-1]["first"] == 150
    assert "It shows another part of the pitch" in found[-1]["why"]


def test_shots_of_another_half_are_no_partners(api: Any, match: str) -> None:
    clocks = [
        {"frame": 0, "half": 1, "seconds": 2600.0},
        {"frame": 75, "half": 2, "seconds": 2700.0},
    ]
    assert api.patch(match, json={"clocks": clocks}).status_code == 200
    assert [one["first"] for one in suggested(api, match)] == [150, 75]
