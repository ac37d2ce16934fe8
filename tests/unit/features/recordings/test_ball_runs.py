"""Balls followed from a click in a recording, over HTTP: mended, accepted into groups, and taken back."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from app.db.store import Store
from app.features.groups.replay import replay_log
from app.features.groups.state_snapshot_queries import read_state_snapshot
from app.features.recordings import ball_runs as module
from app.features.recordings.ball_runs import get_ball_run
from app.features.recordings.follow import collect_follow_hints
from app.features.recordings.queries import update_recording
from app.features.recordings.service import get_recording
from tests.drawn_balls import FRAMES, WALL, place, write_film

Finished = Callable[[Any], Any]


@pytest.fixture(scope="module")
def ball_film(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return write_film(tmp_path_factory.mktemp("ball") / "ball.avi")


@pytest.fixture
def recording(app: Any, api: Any, ball_film: Path, finished: Finished) -> str:
    object.__setattr__(app.state.services.settings, "import_folders", [ball_film.parent])
    body = {"dataset": "cup", "source": {"folder": f"{ball_film.parent.name}/{ball_film.name}"}}
    job = finished(api.post("/api/v1/recordings", json=body))
    assert job.state == "done", job.problem
    path = f"/api/v1/recordings/{job.result['recording']}"
    shots = {"shots": [{"first": 0, "last": FRAMES - 1, "kind": "main"}]}
    tag = {"If-Match": api.get(f"{path}/shots").headers["etag"]}
    assert api.put(f"{path}/shots", json=shots, headers=tag).status_code == 200
    return path


@pytest.fixture
def store(app: Any) -> Store:
    found: Store = app.state.services.store
    return found


def follow(api: Any, recording: str, frame: int = 5) -> Any:
    x, y = place(frame)
    made = api.post(f"{recording}/ball-runs", json={"frame": frame, "x": x + 1, "y": y - 1})
    assert made.status_code == 201, made.text
    return made


def change(api: Any, run: Any, **said: Any) -> Any:
    path = f"/api/v1/recordings/{run['recording']}/ball-runs/{run['id']}"
    return api.patch(path, json=said, headers={"If-Match": run["etag"]})


def balls(api: Any) -> dict[int, Any]:
    """The balls of all groups, by frame."""
    found = {}
    for row in api.get("/api/v1/groups?dataset=cup").json()["items"]:
        for view in api.get(f"/api/v1/groups/{row['id']}").json()["views"]:
            found[int(view["key"].removesuffix(".png"))] = view["balls"]
    return found


def etags_of_before(_: Any, groups: Any) -> dict[int, str]:
    """As if somebody had edited the groups since they were read."""
    return dict.fromkeys(groups, '"older"')


def take(api: Any, recording: str, finished: Finished, *frames: int) -> None:
    body = {"frames": frames, "propose": False}
    assert finished(api.post(f"{recording}/groups", json=body)).state == "done"


class TestFollow:
    def test_a_click_snaps_and_is_followed_both_ways(self, api: Any, recording: str) -> None:
        made = follow(api, recording)
        run = made.json()
        assert made.headers["location"] == f"{recording}/ball-runs/{run['id']}"
        assert (run["first"], run["last"], run["before"], run["after"]) == (0, 29, "limit", "limit")
        assert run["frame"] == list(range(FRAMES))
        assert "".join(run["state"][n] for n in WALL) == "UUU"
        seen = [n for n in range(FRAMES) if n not in WALL]
        off = [np.hypot(run["x"][n] - place(n)[0], run["y"][n] - place(n)[1]) for n in seen]
        assert np.median(off) < 0.3 and max(off) < 2
        assert abs(run["diameter"][5] - 9) < 1.5 and run["sigma_px"][5] < 1
        listed = api.get(f"{recording}/ball-runs").json()["items"]
        assert [(one["id"], one["uncertain"]) for one in listed] == [(run["id"], run["uncertain"])]
        again = api.get(made.headers["location"])
        assert again.json() == run and again.headers["etag"] == run["etag"]

    def test_a_click_is_told_while_it_is_followed_and_kept(
        self, app: Any, api: Any, recording: str, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        follower = app.state.services.balls
        number, whole, told = int(recording.rpartition("/")[2]), follower.follow, []

        def watched(*asked: Any) -> Any:
            told.append(
                (
                    follower.list_frames_being_followed(number),
                    follower.list_frames_being_followed(number + 1),
                )
            )
            return whole(*asked)

        monkeypatch.setattr(follower, "follow", watched)
        run = follow(api, recording).json()
        path, tag = f"{recording}/ball-runs/{run['id']}/clicks", {"If-Match": run["etag"]}
        x, y = place(20)
        assert api.post(path, json={"frame": 20, "x": x, "y": y}, headers=tag).status_code == 200
        refused = api.post(f"{recording}/ball-runs", json={"frame": 7, "x": 250, "y": 150})
        assert refused.status_code == 400
        assert told == [([5], []), ([20], []), ([7], [])]
        assert api.get(f"{recording}/ball-runs").json()["following"] == []

    def test_where_no_ball_is_nothing_is_kept(self, api: Any, recording: str) -> None:
        refused = api.post(f"{recording}/ball-runs", json={"frame": 5, "x": 250, "y": 150})
        assert refused.status_code == 400
        assert "looks like a ball" in refused.json()["detail"]
        beyond = api.post(f"{recording}/ball-runs", json={"frame": FRAMES, "x": 1, "y": 1})
        assert beyond.json()["pointer"] == "/frame"
        assert api.get(f"{recording}/ball-runs").json()["items"] == []

    def test_another_click_mends_it(self, api: Any, recording: str) -> None:
        run = follow(api, recording).json()
        x, y = place(20)
        path, tag = f"{recording}/ball-runs/{run['id']}/clicks", {"If-Match": run["etag"]}
        mended = api.post(path, json={"frame": 20, "x": x, "y": y}, headers=tag)
        assert mended.status_code == 200
        assert [one["frame"] for one in mended.json()["clicks"]] == [5, 20]
        late = api.post(path, json={"frame": 20, "x": x, "y": y}, headers=tag)
        assert late.status_code == 412
        assert late.json()["current"]["etag"] == mended.headers["etag"]

    def test_a_run_that_is_deleted_is_gone_and_unknown_ones_are_404(
        self, api: Any, recording: str
    ) -> None:
        run = follow(api, recording).json()
        path = f"{recording}/ball-runs/{run['id']}"
        assert api.delete(path).status_code == 204
        assert api.get(path).status_code == api.delete(path).status_code == 404
        assert api.get("/api/v1/recordings/99/ball-runs").status_code == 404


class TestAccept:
    def test_groups_get_the_ball_and_give_it_back(
        self, api: Any, recording: str, finished: Finished, store: Store
    ) -> None:
        take(api, recording, finished, 3, 13, 20)
        run = follow(api, recording).json()
        accepted = change(api, run, accepted=True).json()
        assert accepted["accepted_by"] and (accepted["placed"], accepted["kept"]) == (2, 0)
        found = balls(api)
        assert found[13] == []
        (ball,) = found[20]
        x, y, width, height = ball["box"]
        assert np.hypot(x + width / 2 - place(20)[0], y + height / 2 - place(20)[1]) < 1
        assert (ball["source"], ball["predicted_by"]) == ("prediction", f"ball run {run['id']}")
        again = change(api, accepted, accepted=True).json()
        assert (again["placed"], again["kept"]) == (2, 0)
        back = change(api, again, accepted=False).json()
        assert back["accepted_by"] is None and back["placed"] is None
        assert balls(api) == {3: [], 13: [], 20: []}
        with store.read() as session:
            assert replay_log(session).groups == read_state_snapshot(session).groups

    def test_groups_that_are_made_after_it_get_the_ball_and_give_it_back(
        self, api: Any, recording: str, finished: Finished, store: Store
    ) -> None:
        take(api, recording, finished, 3)
        accepted = change(api, follow(api, recording).json(), accepted=True).json()
        take(api, recording, finished, 3, 13, 20)
        found = balls(api)
        assert found[13] == []
        ((mine,), (ball,)) = found[3], found[20]
        assert ball["predicted_by"] == mine["predicted_by"] and ball["source"] == mine["source"]
        number = accepted["id"]
        now = api.get(f"{recording}/ball-runs/{number}").json()
        assert (now["placed"], now["kept"]) == (2, 0) and now["etag"] == accepted["etag"]
        assert change(api, now, accepted=False).json()["accepted_by"] is None
        assert balls(api) == {3: [], 13: [], 20: []}
        take(api, recording, finished, 22)
        assert balls(api)[22] == []
        with store.read() as session:
            assert replay_log(session).groups == read_state_snapshot(session).groups

    def test_uncertain_frames_take_part_once_they_are_confirmed(
        self, api: Any, recording: str, finished: Finished
    ) -> None:
        take(api, recording, finished, 13)
        run = follow(api, recording).json()
        assert change(api, run, confirmed=[3]).json()["pointer"] == "/confirmed/0"
        sure = change(api, run, confirmed=[13, 12]).json()
        assert sure["confirmed"] == [12, 13]
        assert change(api, sure, accepted=True).json()["placed"] == 1
        assert len(balls(api)[13]) == 1

    def test_a_ball_that_a_person_set_stays_both_ways(
        self, api: Any, recording: str, finished: Finished
    ) -> None:
        take(api, recording, finished, 3, 20)
        rows = api.get("/api/v1/groups?dataset=cup").json()["items"]
        groups = [api.get(f"/api/v1/groups/{row['id']}") for row in rows]
        mine = {view["id"]: (view["key"], g) for g in groups for view in g.json()["views"]}
        view = next(number for number, (key, _) in mine.items() if key == "3.png")
        tag = {"If-Match": mine[view][1].headers["etag"]}
        box = {"box": [10, 10, 9, 9]}
        assert api.patch(f"/api/v1/views/{view}/ball", json=box, headers=tag).status_code == 200
        run = follow(api, recording).json()
        accepted = change(api, run, accepted=True).json()
        assert (accepted["placed"], accepted["kept"]) == (1, 1)
        assert balls(api)[3][0]["box"] == [10, 10, 9, 9]
        change(api, accepted, accepted=False)
        assert balls(api)[3][0]["box"] == [10, 10, 9, 9] and balls(api)[20] == []

    def test_an_accepted_run_is_taken_back_before_it_changes(
        self, api: Any, recording: str
    ) -> None:
        run = change(api, follow(api, recording).json(), accepted=True).json()
        x, y = place(20)
        tag = {"If-Match": run["etag"]}
        path = f"{recording}/ball-runs/{run['id']}/clicks"
        refused = api.post(path, json={"frame": 20, "x": x, "y": y}, headers=tag)
        assert refused.status_code == 409
        assert change(api, run, confirmed=[13]).status_code == 409
        assert change(api, run).status_code == 400

    def test_of_another_video_nothing_is_accepted(
        self, api: Any, recording: str, store: Store
    ) -> None:
        run = follow(api, recording).json()
        number = run["recording"]
        with store.write() as session:
            update_recording(session, number, sha256="0" * 64)
        assert get_ball_run(store, number, run["id"]).stale
        assert change(api, run, accepted=True).status_code == 409

    def test_a_run_of_another_video_is_taken_back(
        self, api: Any, recording: str, finished: Finished, store: Store
    ) -> None:
        take(api, recording, finished, 3, 20)
        run = change(api, follow(api, recording).json(), accepted=True).json()
        assert run["placed"] == 2
        with store.write() as session:
            update_recording(session, run["recording"], sha256="0" * 64)
        back = change(api, run, accepted=False)
        assert back.status_code == 200 and back.json()["accepted_by"] is None
        assert balls(api) == {3: [], 20: []}

    def test_views_that_cannot_be_edited_are_counted_and_keep_the_run_accepted(
        self, api: Any, recording: str, finished: Finished, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        take(api, recording, finished, 3, 20)
        run = follow(api, recording).json()
        with monkeypatch.context() as patch:
            patch.setattr(module, "read_etags", etags_of_before)
            refused = change(api, run, accepted=True).json()
        counts = ("placed", "kept", "refused")
        assert [refused[name] for name in counts] == [0, 0, 2] and refused["accepted_by"]
        accepted = change(api, refused, accepted=True).json()
        assert [accepted[name] for name in counts] == [2, 0, 0]
        with monkeypatch.context() as patch:
            patch.setattr(module, "read_etags", etags_of_before)
            refused = change(api, accepted, accepted=False).json()
        assert [refused[name] for name in counts] == [2, 0, 2] and refused["accepted_by"]
        assert all(balls(api).values())
        assert change(api, refused, accepted=False).json()["accepted_by"] is None
        assert balls(api) == {3: [], 20: []}

    @pytest.mark.parametrize("kind", ["confirmed", "extended", "accepted", "taken back", "deleted"])
    def test_what_others_do_to_a_run_while_it_is_accepted_fits_its_balls(
        self,
        api: Any,
        recording: str,
        finished: Finished,
        monkeypatch: pytest.MonkeyPatch,
        kind: str,
    ) -> None:
        take(api, recording, finished, 3, 20)
        run, whole, answers = follow(api, recording).json(), module.edit_views, list[Any]()
        path = f"{recording}/ball-runs/{run['id']}"

        def act() -> Any:
            if kind == "confirmed":
                return change(api, run, confirmed=[13])
            if kind == "extended":
                x, y = place(20)
                click, tag = {"frame": 20, "x": x, "y": y}, {"If-Match": run["etag"]}
                return api.post(f"{path}/clicks", json=click, headers=tag)
            if kind == "accepted":
                return change(api, run, accepted=True)
            if kind == "taken back":
                return change(api, api.get(path).json(), accepted=False)
            return api.delete(path)

        def edit_views(*asked: Any, **more: Any) -> Any:
            monkeypatch.setattr(module, "edit_views", whole)
            answers.append(act())
            return whole(*asked, **more)

        monkeypatch.setattr(module, "edit_views", edit_views)
        mine = change(api, run, accepted=True)
        (answer,) = answers
        present = api.get(path)
        if kind == "taken back":
            assert (answer.status_code, mine.status_code) == (200, 412)
            assert present.json()["accepted_by"] is None and not any(balls(api).values())
        elif kind == "deleted":
            assert (answer.status_code, mine.status_code, present.status_code) == (204, 404, 404)
        else:
            said = 200 if kind == "accepted" else 412
            assert (answer.status_code, mine.status_code) == (said, 200)
            assert present.json() == mine.json() and mine.json()["placed"] == 2
            assert all(balls(api).values())

    @pytest.mark.parametrize("accepted", [True, False])
    def test_what_a_server_did_not_finish_the_same_request_finishes(
        self,
        api: Any,
        recording: str,
        finished: Finished,
        monkeypatch: pytest.MonkeyPatch,
        accepted: bool,
    ) -> None:
        take(api, recording, finished, 3, 20)
        run = follow(api, recording).json()
        if not accepted:
            run = change(api, run, accepted=True).json()
        path, tag = f"{recording}/ball-runs/{run['id']}", {"If-Match": run["etag"]}
        headers = {**tag, "Idempotency-Key": "once"}

        def stop(*_: Any, **__: Any) -> Any:
            raise SystemError("stopped")

        with monkeypatch.context() as patch:
            patch.setattr(module, "edit_views", stop)
            sent = api.patch(path, json={"accepted": accepted}, headers=headers)
            assert sent.status_code == 500
        assert change(api, run, accepted=not accepted).status_code == 412
        done, again = (
            api.patch(path, json={"accepted": accepted}, headers=headers) for _ in range(2)
        )
        assert (done.status_code, again.headers["idempotency-replayed"]) == (200, "true")
        assert done.json() == again.json() == api.get(path).json()
        assert (done.json()["placed"] == 2) is accepted
        assert all(bool(found) is accepted for found in balls(api).values())

    def test_boxes_of_detectors_are_candidates(
        self, api: Any, recording: str, finished: Finished, store: Store
    ) -> None:
        take(api, recording, finished, 8)
        text = "image,x,y,w,h,score\n8.png,104,62,9,9,0.8\n"
        kind = {"Content-Type": "application/octet-stream"}
        sent = api.post("/api/v1/uploads?name=seen.csv", content=text.encode(), headers=kind)
        body = {"name": "seen", "format": "csv", "upload": sent.json()["id"]}
        made = api.post("/api/v1/datasets/cup/predictions", json=body)
        assert made.status_code == 201, made.text
        hints = collect_follow_hints(store, get_recording(store, 1), range(FRAMES))
        (one,) = hints.detected[8]
        assert (one.x, one.y, one.diameter, one.score) == (108.5, 66.5, 9.0, 0.8)
