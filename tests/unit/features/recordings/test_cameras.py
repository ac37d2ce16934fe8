"""Cameras over time of a recording: tracked by a job, read over HTTP, given to groups, mended by lines."""

from __future__ import annotations

import errno
import io
import json
import zipfile
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from sqlalchemy import select

from app.db.idempotency import without_pending_response
from app.db.store import Store
from app.errors import ConflictError, InputError, JobCancelled
from app.features.audit.service import assign_local_work
from app.features.datasets.queries import list_unused_frame_files
from app.features.groups.queries import read_groups
from app.features.groups.replay import replay_log
from app.features.groups.state_snapshot_queries import read_state_snapshot
from app.features.imports.cameras import import_given_cameras
from app.features.people.roles import Role
from app.features.people.service import find_person, invite
from app.features.recordings import camera_tracking as module
from app.features.recordings.camera_tracking import (
    TrackedStretch,
    track_stretch,
    track_stretch_in_worker,
)
from app.features.recordings.cameras import (
    SOURCE,
    get_shot_cameras,
    list_shot_cameras,
    read_cameras,
    read_cameras_of_frames,
)
from app.features.recordings.links import add_link, set_instants
from app.features.recordings.queries import update_recording
from app.features.recordings.service import Recording, find_group_ids_by_frame, get_recording
from app.features.recordings.shots import Shot, replace_shots
from app.features.recordings.tables import ShotCamerasModel
from app.geometry.camera import Camera
from app.soccer.annotation import make_lines
from app.soccer.frames import ImagePoint, ImageSize
from app.soccer.pitch import Pitch
from app.soccer.policy import CalibrationPolicy
from app.solving.jaccard import project_markings
from app.solving.sides import turn_camera
from app.tracking.track import CameraTrack, FrameCamera
from tests.tripod_films import Film, render_film
from tests.videos import write_pictures

Finished = Callable[[Any], Any]
FIRST, FRAMES = 4, 8
"""The shot begins behind frames that show nothing."""
SIZE = ImageSize(1280, 720)


@pytest.fixture(scope="module")
def tripod() -> Film:
    return render_film(FRAMES)


@pytest.fixture(scope="module")
def shot(tripod: Film, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A video whose frames from ``FIRST`` on are a shot of a pitch."""
    nothing = [np.full((720, 1280, 3), (60, 60, 150), np.uint8)] * FIRST
    pictures = [*nothing, *tripod.images]
    return write_pictures(tmp_path_factory.mktemp("shot") / "pan.avi", "MJPG", pictures)


@pytest.fixture
def recording(app: Any, api: Any, shot: Path, finished: Finished) -> str:
    object.__setattr__(app.state.services.settings, "import_folders", [shot.parent])
    body = {"dataset": "cup", "source": {"folder": f"{shot.parent.name}/{shot.name}"}}
    job = finished(api.post("/api/v1/recordings", json=body))
    assert job.state == "done", job.problem
    return f"/api/v1/recordings/{job.result['recording']}"


@pytest.fixture
def found(app: Any, recording: str) -> Recording:
    return get_recording(app.state.services.store, int(recording.rpartition("/")[2]))


class Tracker:
    """In place of the process that tracks: frames as they are said, and what it was asked."""

    def __init__(self, truth: list[Camera]):
        self.truth = truth
        self.lost: set[int] = set()
        self.off = 0.0
        self.asked: dict[int, Any] = {}
        self.pitch: dict[str, Any] | None = None

    def __call__(self, path: Path, work: Any, *arguments: Any, **_: Any) -> TrackedStretch:
        assert work is track_stretch
        first, last, lines = arguments[2:5]
        self.asked = lines
        frames = [self.frame(number, lines) for number in range(first, last + 1)]
        return TrackedStretch(frames, (), pitch=self.pitch)

    def frame(self, number: int, lines: Any) -> FrameCamera:
        lost = number in self.lost
        camera = self.truth[number - FIRST]
        moved = Camera(
            camera.rotation,
            camera.position + np.array([self.off, 0, 0]),
            camera.focal_length,
            camera.principal_point,
            camera.skew,
            camera.distortion,
        )
        sigma = np.diag(np.full(8, 0.01)).ravel().tolist()
        return FrameCamera(
            number=number,
            time=number / 25,
            outcome="lost" if lost else "tracked",
            size=SIZE,
            camera=None if lost else moved,
            covariance=None if lost else tuple(sigma),
            supported=None if lost else 0.9,
            explained=None if lost else 0.7,
            error_px=None if lost else 0.1 * number,
            is_keyframe=number == FIRST or number in lines,
            reason="no_paint" if lost else None,
        )


@pytest.fixture
def tracker(tripod: Film, monkeypatch: pytest.MonkeyPatch) -> Tracker:
    tracker = Tracker(tripod.cameras)
    monkeypatch.setattr(module, "run_in_worker", tracker)
    return tracker


def track(api: Any, recording: str, finished: Finished, first: int = FIRST, last: int = 11) -> Any:
    job = finished(api.post(f"{recording}/cameras", json={"first": first, "last": last}))
    assert job.state == "done", job.problem
    return job.result


def take(api: Any, recording: str, finished: Finished, *frames: int) -> Any:
    body = {"frames": list(frames), "propose": True}
    job = finished(api.post(f"{recording}/groups", json=body))
    assert job.state == "done", job.problem
    return job.result


def draw(api: Any, group: int, camera: Camera, view: int = 0) -> None:
    """Draw the lines of a frame as a person does."""
    document = api.get(f"/api/v1/groups/{group}")
    chosen = document.json()["views"][view]
    shown = project_markings(camera, Pitch(), SIZE)
    lines = {
        name: [{"x": x, "y": y} for x, y in line[:: max(len(line) // 6, 1)].round(2).tolist()]
        for name, line in shown.items()
        if len(line) > 5
    }
    path = f"/api/v1/views/{chosen['id']}/lines"
    tag = {"If-Match": document.headers["etag"]}
    answer = api.patch(path, json={"lines": lines}, headers=tag)
    assert answer.status_code == 200, answer.text


def test_a_shot_is_tracked_and_its_frames_have_cameras(
    app: Any, api: Any, recording: str, found: Recording, finished: Finished, tripod: Film
) -> None:
    result = track(api, recording, finished)
    counts = {"frames": FRAMES, "tracked": FRAMES, "bridged": 0, "lost": 0}
    assert counts.items() <= result.items() and result["groups"] == 0
    (one,) = api.get(f"{recording}/cameras").json()["items"]
    assert (one["first"], one["last"], one["revision"], one["stale"]) == (FIRST, 11, 1, False)
    assert counts.items() <= one["summary"].items() and one["before"] is None
    answer = api.get(f"{recording}/cameras/9")
    body, tag = answer.json(), {"If-None-Match": answer.headers["etag"]}
    assert (body["first"], body["last"], body["size"]) == (FIRST, 11, [1280, 720])
    assert body["outcome"] == "T" * FRAMES and body["keyframe"] == [FIRST]
    assert body["time"][0] == pytest.approx(FIRST / 25)
    assert max(body["error_px"]) < 0.5 and min(body["supported"]) > 0.8
    assert api.get(f"{recording}/cameras/9", headers=tag).status_code == 304
    store = app.state.services.store
    frames = read_cameras(store.settings, get_shot_cameras(store, found.id, 9).digest)
    for place, frame in enumerate(frames):
        assert frame.number == FIRST + place and frame.camera is not None
        assert tripod.off_px(place, frame.camera) < 1.5
        row = body["camera"][place]
        assert row[:3] == pytest.approx(frame.camera.position.tolist(), abs=1e-4)
        assert row[3:6] == pytest.approx(frame.camera.pan_tilt_roll_degrees, abs=1e-5)
        assert row[6:8] == pytest.approx(frame.camera.focal_length, abs=1e-2)
    assert api.get(f"{recording}/cameras/3").status_code == 404
    assert api.get(f"{recording}/cameras/9?before=true").status_code == 404


@pytest.mark.parametrize(
    ("first", "last", "problem"),
    [
        (5, 4, "does not have all of the frames"),
        (0, 12, "its last one is 11"),
        (0, 10**6, "its last one is 11"),
    ],
)
def test_frames_that_are_not_there_are_refused(
    api: Any, recording: str, first: int, last: int, problem: str
) -> None:
    answer = api.post(f"{recording}/cameras", json={"first": first, "last": last})
    assert answer.status_code == 400 and problem in answer.json()["detail"]


def test_more_frames_than_a_shot_has_are_refused(
    api: Any, recording: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(module, "MOST_FRAMES", 5)
    answer = api.post(f"{recording}/cameras", json={"first": 0, "last": 5})
    assert answer.status_code == 400
    assert "6 frames are too many; 5 can" in answer.json()["detail"]


def test_groups_get_the_cameras_of_their_frames_and_need_no_proposal(
    app: Any, api: Any, recording: str, found: Recording, finished: Finished, tracker: Tracker
) -> None:
    tracker.lost = {7}
    assert track(api, recording, finished)["lost"] == 1
    taken = take(api, recording, finished, 5, 6)
    assert (taken["new"], taken["cameras"], taken["proposals_job"]) == (2, 2, None)
    assert taken["group"] == find_group_ids_by_frame(app.state.services.store, found)[5]
    taken = take(api, recording, finished, 7, 8)
    assert taken["cameras"] == 1 and taken["proposals_job"] is not None
    store: Store = app.state.services.store
    groups = find_group_ids_by_frame(store, found)
    with store.read() as session:
        stored = read_groups(session, list(groups.values()))
    station = stored[groups[5]].group.views[0].station
    assert station.given == tracker.truth[1] and station.given_covariance is not None
    shown = stored[groups[5]].group.views[0].extras.metadata["recording"]
    assert shown["frame"] == 5 and "camera" not in shown
    told = shown["camera_when_taken"]
    assert told["source"] == SOURCE == "track"
    assert told["outcome"] == "tracked" and told["sigma"]["position"] > 0
    assert stored[groups[7]].group.views[0].station.given is None
    assert "camera_when_taken" not in stored[groups[7]].group.views[0].extras.metadata["recording"]


def test_a_person_mends_a_frame_and_shot_and_groups_follow(
    app: Any, api: Any, recording: str, found: Recording, finished: Finished, tracker: Tracker
) -> None:
    store: Store = app.state.services.store
    tracker.lost, tracker.off = {7, 8}, 2.0
    track(api, recording, finished)
    take(api, recording, finished, 5, 7, 8, 11)
    groups = find_group_ids_by_frame(store, found)
    draw(api, groups[7], tracker.truth[3])
    assert api.get(f"{recording}/cameras").json()["items"][0]["drawn"] == [7]
    tracker.lost, tracker.off = {11}, 0.0
    result = track(api, recording, finished)
    assert sorted(tracker.asked) == [7] and "Side line top" in tracker.asked[7]
    # 5 moved, 8 has one now, that of 11 is withdrawn; lines say where the camera of 7 is.
    assert result["groups"] == 3 and result["solve_job"] is not None
    with store.read() as session:
        stored = read_groups(session, list(groups.values()))
    given = {number: stored[group].group.views[0].station.given for number, group in groups.items()}
    assert given == {5: tracker.truth[1], 7: None, 8: tracker.truth[4], 11: None}
    with store.read() as session:
        assert replay_log(session) == read_state_snapshot(session)
    (one,) = api.get(f"{recording}/cameras").json()["items"]
    assert one["revision"] == 2 and one["summary"]["annotated"] == [7]
    assert (one["before"]["lost"], one["summary"]["lost"]) == (2, 1)
    assert one["summary"]["worst_frame"] == 10
    before = api.get(f"{recording}/cameras/7?before=true").json()
    assert before["outcome"] == "TTTLLTTT" and before["camera"][3] is None
    assert before["reason"][3] == "no_paint"


def test_views_of_linked_replays_are_frames_of_their_shot(
    app: Any,
    api: Any,
    recording: str,
    found: Recording,
    finished: Finished,
    tracker: Tracker,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    store: Store = app.state.services.store
    # So few frames would tell no speed.
    monkeypatch.setattr("app.tracking.time_map._UNSURE", 1.0)
    replace_shots(
        store,
        found.id,
        [Shot(4, 7, "main", "cut"), Shot(8, 11, "replay", "cut")],
        None,
        actor="ann",
    )
    link = add_link(store, (found.id, 4, 7), (found.id, 8, 11), actor="ann")
    set_instants(store, found.id, link.id, [(4, 8), (7, 11)], None, None, actor="ann")
    track(api, recording, finished, 8, 11)
    body = {"frames": [5], "propose": False, "linked": True}
    finished(api.post(f"{recording}/groups", json=body))
    (group,) = find_group_ids_by_frame(store, found).values()

    def given() -> list[Camera | None]:
        with store.read() as session:
            views = read_groups(session, [group])[group].group.views
        return [view.station.given for view in views]

    assert given() == [None, tracker.truth[5]]
    tracker.off = 1.0
    assert track(api, recording, finished, 8, 11)["groups"] == 1
    assert track(api, recording, finished, 4, 7)["groups"] == 1
    assert [camera and camera.position[0] for camera in given()] == [
        tracker.truth[place].position[0] + 1.0 for place in (1, 5)
    ]
    draw(api, group, tracker.truth[5], view=1)
    track(api, recording, finished, 8, 11)
    assert list(tracker.asked) == [9]


def test_cameras_are_turned_by_half_and_back_and_groups_follow(
    app: Any, api: Any, recording: str, found: Recording, finished: Finished, tracker: Tracker
) -> None:
    store: Store = app.state.services.store
    own = tracker.truth[0]
    track(api, recording, finished)
    take(api, recording, finished, 5, 6, 7)
    import_given_cameras(store, "cup", {"7": own}, source="mine", actor="ann")
    as_tracked = api.get(f"{recording}/cameras/5").json()

    def turn(turned: bool) -> Any:
        job = finished(api.patch(f"{recording}/cameras/9", json={"turned": turned}))
        assert job.state == "done", job.problem
        return job.result

    def given() -> dict[int, Camera | None]:
        groups = find_group_ids_by_frame(store, found)
        with store.read() as session:
            stored = read_groups(session, list(groups.values()))
        return {
            number: stored[group].group.views[0].station.given for number, group in groups.items()
        }

    result = turn(True)
    assert (result["turned"], result["groups"]) == (True, 2) and result["solve_job"] is not None
    shown = api.get(f"{recording}/cameras/5").json()
    for before, after in zip(as_tracked["camera"], shown["camera"], strict=True):
        assert after[:3] == [-before[0], -before[1], before[2]]
        assert abs(after[3] - before[3]) == pytest.approx(180, abs=1e-5)
        assert after[4:] == pytest.approx(before[4:], abs=1e-5)
    assert shown["sigma"] == as_tracked["sigma"]
    views = given()
    assert views[5] == turn_camera(tracker.truth[1]) and views[7] == own
    with store.read() as session:
        assert replay_log(session) == read_state_snapshot(session)
    (one,) = api.get(f"{recording}/cameras").json()["items"]
    assert (one["summary"]["turned"], one["before"]["turned"], one["revision"]) == (True, False, 2)
    assert turn(True)["groups"] == 0
    # Tracked again they stay on the side that a person chose.
    track(api, recording, finished)
    assert given()[5] == views[5]
    assert api.get(f"{recording}/cameras").json()["items"][0]["summary"]["turned"]
    assert turn(False)["groups"] == 2
    assert given() == {5: tracker.truth[1], 6: tracker.truth[2], 7: own}
    assert api.get(f"{recording}/cameras/5").json() == as_tracked


def test_cameras_that_lines_put_on_their_side_or_that_others_tracked_are_not_turned(
    app: Any, api: Any, recording: str, found: Recording, finished: Finished, tracker: Tracker
) -> None:
    store: Store = app.state.services.store
    assert api.patch(f"{recording}/cameras/5", json={"turned": True}).status_code == 404
    track(api, recording, finished)
    present = get_shot_cameras(store, found.id, 5)
    take(api, recording, finished, 7)
    draw(api, find_group_ids_by_frame(store, found)[7], tracker.truth[3])
    tracker.off = 1.0
    track(api, recording, finished)
    answer = api.patch(f"{recording}/cameras/5", json={"turned": True})
    assert answer.status_code == 409
    assert "lines of frame 7 already say which half of the pitch" in answer.json()["detail"]
    turned = TrackedStretch([tracker.frame(number, {}) for number in range(4, 12)], (), True)
    with pytest.raises(
        ConflictError, match="the cameras of this shot were changed in the meantime"
    ):
        module.save_cameras(store, found, (4, 11), turned, [], "ann", turned_from=present)


def test_linked_views_leave_a_camera_that_was_given_or_lines_that_were_drawn(
    app: Any,
    api: Any,
    recording: str,
    found: Recording,
    finished: Finished,
    tracker: Tracker,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    store: Store = app.state.services.store
    monkeypatch.setattr("app.tracking.time_map._UNSURE", 1.0)
    take(api, recording, finished, 4, 5, 6)
    own = tracker.truth[0]
    import_given_cameras(store, "cup", {"5": own}, source="mine", actor="ann")
    groups = find_group_ids_by_frame(store, found)
    draw(api, groups[6], tracker.truth[2])
    track(api, recording, finished)
    link = add_link(store, (found.id, 4, 7), (found.id, 8, 11), actor="ann")
    set_instants(store, found.id, link.id, [(4, 8), (7, 11)], None, None, actor="ann")
    body = {"frames": [4, 5, 6], "propose": False, "linked": True}
    assert finished(api.post(f"{recording}/groups", json=body)).result["changed"] == 3
    with store.read() as session:
        stored = read_groups(session, list(groups.values()))
        assert replay_log(session) == read_state_snapshot(session)
    stations = {
        number: [view.station for view in stored[group].group.views]
        for number, group in groups.items()
    }
    given = {number: [one.given for one in both] for number, both in stations.items()}
    assert given == {
        4: [tracker.truth[0], tracker.truth[4]],
        5: [own, tracker.truth[5]],
        6: [None, tracker.truth[6]],
    }
    assert stations[6][0].lines and stored[groups[6]].is_view_edited("6.png")


def test_a_camera_that_somebody_gave_stays(
    app: Any, api: Any, recording: str, found: Recording, finished: Finished, tracker: Tracker
) -> None:
    store: Store = app.state.services.store
    take(api, recording, finished, 5, 6)
    own = tracker.truth[0]
    import_given_cameras(store, "cup", {"5": own}, source="mine", actor="ann")
    assert track(api, recording, finished)["groups"] == 1
    groups = find_group_ids_by_frame(store, found)
    with store.read() as session:
        stored = read_groups(session, list(groups.values()))
    assert stored[groups[5]].group.views[0].station.given == own
    assert stored[groups[6]].group.views[0].station.given == tracker.truth[2]


def test_cameras_take_the_place_of_those_that_share_a_frame_and_leave_no_file(
    app: Any, api: Any, recording: str, found: Recording, finished: Finished, tracker: Tracker
) -> None:
    store: Store = app.state.services.store

    def files() -> int:
        return len(list(store.settings.recordings.glob("*.cameras.npz")))

    def stretches() -> list[tuple[int, int]]:
        items = api.get(f"{recording}/cameras").json()["items"]
        return [(one["first"], one["last"]) for one in items]

    for off in (0.0, 1.0, 2.0):
        tracker.off = off
        track(api, recording, finished, 4, 8)
    track(api, recording, finished, 9, 11)
    assert stretches() == [(4, 8), (9, 11)] and files() == 3
    track(api, recording, finished, 6, 9)
    # Frames beside it keep their cameras.
    assert stretches() == [(4, 5), (6, 9), (10, 11)] and files() == 3
    assert sorted(read_cameras_of_frames(store, found, [4, 6, 9, 11])) == [4, 6, 9, 11]
    with store.read() as session:
        assert not [
            name for name in list_unused_frame_files(session, store.settings) if "cameras" in name
        ]
    assert api.delete(recording).status_code == 204
    with store.read() as session:
        assert [
            name for name in list_unused_frame_files(session, store.settings) if "cameras" in name
        ]


def test_frames_beside_a_stretch_that_is_tracked_keep_who_tracked_them_and_when(
    app: Any, api: Any, recording: str, found: Recording, finished: Finished, tracker: Tracker
) -> None:
    store: Store = app.state.services.store

    def stored() -> list[tuple[int, str, str]]:
        table = ShotCamerasModel
        statement = select(table.first, table.actor, table.created).order_by(table.first)
        with store.read() as session:
            return [tuple(row) for row in session.execute(statement)]

    track(api, recording, finished, 4, 11)
    ((_, actor, created),) = stored()
    assert actor == "local"
    invite(store, "anna", Role.LEAD, actor="local")
    assign_local_work(store, find_person(store, "anna").id, actor="ada")
    assert [one.actor for one in list_shot_cameras(store, found.id)] == ["anna"]
    frames = [tracker.frame(number, {}) for number in (6, 7)]
    module.save_cameras(store, found, (6, 7), TrackedStretch(frames, ()), [], "bob")
    before, new, behind = stored()
    assert [before, behind] == [(4, "local", created), (8, "local", created)]
    assert new[:2] == (6, "bob") and new[2] > created
    shown = [one.actor for one in list_shot_cameras(store, found.id)]
    assert shown == ["anna", "bob", "anna"]


def test_cameras_of_another_video_or_of_no_file_are_not_given(
    app: Any, api: Any, recording: str, found: Recording, finished: Finished, tracker: Tracker
) -> None:
    store: Store = app.state.services.store
    track(api, recording, finished)
    kept = get_shot_cameras(store, found.id, 5)
    place = module.cameras_file_path(store.settings, kept.digest)
    content = place.read_bytes()
    place.write_bytes(content[:100])
    answer = api.get(f"{recording}/cameras/5")
    assert answer.status_code == 409 and "Track the shot again" in answer.json()["hint"]
    assert read_cameras_of_frames(store, found, [5]) == {}
    place.write_bytes(content)
    assert sorted(read_cameras_of_frames(store, found, [5])) == [5]
    with store.write() as session, without_pending_response():
        update_recording(session, found.id, sha256="0" * 64)
    assert read_cameras_of_frames(store, found, [5]) == {}
    assert api.get(f"{recording}/cameras").json()["items"][0]["stale"]


def test_a_video_that_changes_while_it_is_tracked_is_refused(
    app: Any, recording: str, found: Recording, tracker: Tracker
) -> None:
    store: Store = app.state.services.store
    tracked = TrackedStretch([tracker.frame(number, {}) for number in range(4, 12)], ())
    other = Recording(**{**vars(found), "sha256": "0" * 64})
    with pytest.raises(ConflictError, match="was replaced while the shot was tracked"):
        module.save_cameras(store, other, (4, 11), tracked, [], "ann")
    with pytest.raises(InputError):
        module.require_trackable_stretch(found, 4, 12)


def test_it_ends_when_its_job_is_cancelled_and_keeps_nothing(
    app: Any, recording: str, found: Recording
) -> None:
    def cancelled() -> None:
        raise JobCancelled

    store: Store = app.state.services.store
    asked = {"actor": "ann", "progress": lambda *_: None, "stop": cancelled}
    with pytest.raises(JobCancelled):
        track_stretch_in_worker(store, found.id, FIRST, 11, **asked)
    assert list_shot_cameras(store, found.id) == []
    assert list(store.settings.recordings.glob("*.cameras.npz")) == []


def test_a_disk_that_is_full_is_one_message_and_changes_nothing(
    app: Any,
    api: Any,
    recording: str,
    found: Recording,
    finished: Finished,
    tracker: Tracker,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    track(api, recording, finished)

    def full(*_: Any) -> None:
        raise OSError(errno.ENOSPC, "No space left on device")

    tracker.off = 1.0
    with monkeypatch.context() as patch:
        patch.setattr(module, "replace_file", full)
        job = finished(api.post(f"{recording}/cameras", json={"first": FIRST, "last": 11}))
    assert job.state == "failed" and "cannot be stored" in job.problem["detail"]
    (one,) = api.get(f"{recording}/cameras").json()["items"]
    assert one["revision"] == 1
    assert api.get(f"{recording}/cameras/5").status_code == 200


def test_lines_that_make_no_camera_are_named_and_left_out(
    app: Any, found: Recording, monkeypatch: pytest.MonkeyPatch, tripod: Film
) -> None:
    asked: dict[str, Any] = {}

    def follow(clip: Any, lines: Any, *_: Any) -> CameraTrack:
        asked.update(lines)
        return CameraTrack([], None, [])

    monkeypatch.setattr(module, "track_clip", follow)
    few = make_lines({"Middle line": (ImagePoint(600, 100), ImagePoint(620, 500))})
    known = (found.path, app.state.services.settings, found.require_readable(), 4, 11)
    tracked = track_stretch(*known, {5: few}, None, CalibrationPolicy(), lambda _: None)
    assert tracked.unusable == (5,) and asked == {}


@pytest.mark.parametrize("form", ["soccernet", "npz", "opentrackio"])
def test_cameras_are_written_for_other_tools(
    api: Any, recording: str, finished: Finished, tracker: Tracker, form: str
) -> None:
    tracker.lost = {6}
    track(api, recording, finished)
    answer = api.get(f"{recording}/cameras/5/file?format={form}")
    assert answer.status_code == 200 and "pan_4-11" in answer.headers["content-disposition"]
    if form == "npz":
        arrays = np.load(io.BytesIO(answer.content))
        assert arrays["K"].shape == (12, 3, 3) and np.isnan(arrays["K"][6]).all()
        assert arrays["K"][5][0, 0] == pytest.approx(tracker.truth[1].focal_length[0])
        return
    archive = zipfile.ZipFile(io.BytesIO(answer.content))
    names = archive.namelist()
    if form == "soccernet":
        assert "camera_5.json" in names and "camera_6.json" not in names
        rows = json.loads(archive.read("track.json"))["frames"]
        assert [row["outcome"] for row in rows][:3] == ["tracked", "tracked", "lost"]
    else:
        sample = json.loads(archive.read("sample_05.json"))
        assert sample["timing"]["sequenceNumber"] == 5
        assert sample["tracker"]["status"] == "tracked"


def test_the_pitch_that_is_shown_is_told_and_kept(
    api: Any, recording: str, finished: Finished, tracker: Tracker
) -> None:
    track(api, recording, finished)
    sigma = {"length": 0.2, "width": None, "crown": 0.01, "inward": 0.02, "tripod": 0.2}
    shown = {
        "length": 101.2,
        "width": None,
        "crown": 0.17,
        "inward": 0.07,
        "tripod": [0.2, 66.5, -15.7],
    }
    shown |= {"sigma": sigma, "frames": 24, "other": {"length": 101.2, "width": 68.0}}
    tracker.pitch = {**shown, "cameras": "plan"}
    track(api, recording, finished)
    (one,) = api.get(f"{recording}/cameras").json()["items"]
    assert one["summary"]["pitch"] == shown and one["before"]["pitch"] is None
    answer = api.get(f"{recording}/cameras/5/file?format=soccernet")
    archive = zipfile.ZipFile(io.BytesIO(answer.content))
    assert json.loads(archive.read("track.json"))["pitch"] == tracker.pitch


def test_no_camera_is_no_file(
    api: Any, recording: str, finished: Finished, tracker: Tracker
) -> None:
    tracker.lost = set(range(4, 12))
    assert track(api, recording, finished)["lost"] == 8
    answer = api.get(f"{recording}/cameras/5/file")
    assert answer.status_code == 409
