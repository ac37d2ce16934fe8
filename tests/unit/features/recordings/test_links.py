"""Links of replays over HTTP."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from threading import Thread
from time import process_time
from typing import Any

import numpy as np
import pytest

from app.db.idempotency import without_pending_response
from app.db.log import read_log
from app.features.recordings.link_frames import find_nearest_frames
from tests.unit.features.recordings.test_routes import picture_of
from tests.videos import number_of, write_video

API = "/api/v1/recordings"
Finished = Callable[[Any], Any]
LIVE, REPLAY = {"first": 0, "last": 19}, {"first": 20, "last": 59}


@pytest.fixture
def link(api: Any, recording: str) -> str:
    """The address of a link of the film's frames 20 to 59 to those from 0 to 19."""
    replay = {"recording": int(recording.rpartition("/")[2]), **REPLAY}
    made = api.post(f"{recording}/links", json={"live": LIVE, "replay": replay})
    assert made.status_code == 201, made.text
    assert made.headers["location"] == f"{recording}/links/{made.json()['id']}"
    return str(made.headers["location"])


def instants(api: Any, link: str, *pairs: tuple[int, int], speed: float | None = None) -> Any:
    """The answer to linking instants, upon the link as it is."""
    body = {"instants": [{"live": a, "replay": b} for a, b in pairs], "assumed_speed": speed}
    tag = {"If-Match": api.get(link).headers["etag"]}
    return api.put(f"{link}/instants", json=body, headers=tag)


class TestAddLink:
    def test_it_has_no_map_yet_and_is_listed(self, app: Any, api: Any, link: str) -> None:
        found = api.get(link).json()
        assert (found["instants"], found["map"]["outcome"]) == ([], "none")
        assert found["live"] == {"recording": 1, "name": "final", **LIVE}
        assert found["replay"] == {"recording": 1, "name": "final", **REPLAY}
        at = link.rpartition("/")[0]
        assert api.get(at).json()["items"] == [found]
        replay = {"recording": 1, **REPLAY}
        again = api.post(at, json={"live": LIVE, "replay": replay})
        assert (again.status_code, again.json()) == (201, found)
        with app.state.services.store.read() as session:
            (event,) = [e for e in read_log(session) if e.body.get("did") == "replay linked"]
        assert (event.actor, event.body["replay_first"]) == ("local", 20)

    def test_links_are_a_table_too(self, api: Any, link: str) -> None:
        at = link.rpartition("/")[0]
        instants(api, link, (2, 25), (12, 45))
        columns, row = api.get(f"{at}.csv").text.splitlines()
        found = dict(zip(columns.split(","), row.split(","), strict=True))
        shown = api.get(link).json()["map"]
        assert (found["live"], found["replay"], found["instants"]) == ("final", "final", "2")
        assert (found["replay_first"], found["outcome"], found["first"]) == ("20", "linked", "20")
        assert float(found["speed"]) == shown["speed"] == pytest.approx(0.5)
        assert float(found["offset_s"]) == shown["offset_s"]

    @pytest.mark.parametrize(
        ("live", "replay", "pointer"),
        [
            ((0, 20), (20, 59), "/replay"),
            ((5, 4), (20, 59), "/live"),
            ((0, 19), (20, 60), "/replay"),
        ],
    )
    def test_shots_that_cannot_be_are_refused(
        self,
        api: Any,
        recording: str,
        live: tuple[int, int],
        replay: tuple[int, int],
        pointer: str,
    ) -> None:
        body = {
            "live": dict(zip(("first", "last"), live, strict=True)),
            "replay": {"recording": 1, **dict(zip(("first", "last"), replay, strict=True))},
        }
        answer = api.post(f"{recording}/links", json=body)
        assert (answer.status_code, answer.json()["pointer"]) == (400, pointer)

    def test_the_replay_may_be_another_recording_of_the_same_dataset_alone(
        self, api: Any, film: Path, recording: str, finished: Finished
    ) -> None:
        ids = []
        for dataset in ("cup", "league"):
            write_video(film.parent / f"{dataset}.mp4", "mp4v", 30)
            body = {"dataset": dataset, "source": {"folder": f"films/{dataset}.mp4"}}
            ids.append(finished(api.post(API, json=body)).result["recording"])
        for number, status in zip(ids, (201, 400), strict=True):
            replay = {"recording": number, "first": 0, "last": 29}
            answer = api.post(f"{recording}/links", json={"live": LIVE, "replay": replay})
            assert answer.status_code == status
        (listed,) = api.get(f"{API}/{ids[0]}/links").json()["items"]
        assert (listed["live"]["name"], listed["replay"]["name"]) == ("final", "cup")
        assert api.get(f"{API}/{ids[1]}/links").json()["items"] == []
        assert api.get(f"{API}/{ids[1]}/links/{listed['id']}").status_code == 404

    def test_it_goes_with_its_recording_and_with_another_film_in_its_place(
        self, api: Any, film: Path, recording: str, link: str, finished: Finished
    ) -> None:
        finished(api.post(f"{recording}/shots"))
        assert api.get(link).status_code == 200
        write_video(film, "mp4v", 50)
        finished(api.post(f"{recording}/shots"))
        assert api.get(link).status_code == 404
        replay = {"recording": 1, "first": 20, "last": 49}
        made = api.post(f"{recording}/links", json={"live": LIVE, "replay": replay}).json()
        assert api.delete(recording).status_code == 204
        assert api.get(f"{recording}/links/{made['id']}").status_code == 404


class TestSetInstants:
    def test_one_gives_the_offset_two_the_speed_and_none_takes_it_back(
        self, api: Any, link: str
    ) -> None:
        one = instants(api, link, (5, 30), speed=0.5).json()
        assert (one["map"]["outcome"], one["map"]["speed"]) == ("offset", 0.5)
        # Frame 30 is 0.4 s after the replay's first one, frame 5 0.2 s after the live one.
        assert one["map"]["offset_s"] == pytest.approx(0.2 - 0.5 * 0.4)
        assert "0.5 is assumed" in one["map"]["reason"]
        two = instants(api, link, (15, 50), (5, 30))
        found = two.json()
        assert two.headers["etag"] == found["etag"] != one["etag"]
        assert [(i["live"], i["replay"]) for i in found["instants"]] == [(5, 30), (15, 50)]
        assert [i["residual"] for i in found["instants"]] == pytest.approx([0, 0], abs=1e-9)
        assert (found["map"]["outcome"], found["map"]["found_by"]) == ("linked", "instants")
        assert (found["map"]["speed"], found["map"]["offset_s"]) == pytest.approx((0.5, 0.0))
        assert found["map"]["speed_sigma"] == pytest.approx(0.04 * 2**0.5 / 0.8)
        none = instants(api, link).json()
        assert (none["map"]["outcome"], none["instants"]) == ("none", [])

    def test_several_that_are_too_close_together_say_so_in_a_field(
        self, api: Any, link: str
    ) -> None:
        one = instants(api, link, (5, 30)).json()["map"]
        close = instants(api, link, (5, 30), (6, 32)).json()["map"]
        assert [one["too_close"], close["too_close"]] == [False, True]
        assert one["outcome"] == close["outcome"] == "offset"
        assert "The instants near frame 30 are too close together" in close["reason"]

    def test_two_that_leave_the_end_of_the_replay_unknown_are_not_linked(
        self, api: Any, link: str
    ) -> None:
        found = instants(api, link, (5, 22), (9, 30)).json()["map"]
        assert (found["outcome"], found["too_close"], found["speed"]) == ("offset", True, 0.5)
        assert "link one farther away, near that end" in found["reason"]

    def test_more_say_by_how_much_each_is_off(self, api: Any, link: str) -> None:
        found = instants(api, link, (0, 20), (5, 30), (11, 40), (15, 50)).json()
        assert found["map"]["pieces"] == []
        residuals = [one["residual"] for one in found["instants"]]
        assert sum(residuals) == pytest.approx(0, abs=1e-9)
        assert min(residuals) == residuals[2] == pytest.approx(-0.7)

    def test_a_change_of_speed_is_told_in_frames(self, api: Any, link: str) -> None:
        found = instants(api, link, (0, 20), (1, 30), (2, 40), (12, 50), (19, 57)).json()
        assert [(one["first"], one["last"]) for one in found["map"]["pieces"]] == [
            (20, 40),
            (40, 57),
        ]
        speeds = [one["speed"] for one in found["map"]["pieces"]]
        assert speeds == pytest.approx([0.1, 1.0], abs=0.02)
        assert (found["map"]["outcome"], found["map"]["speed"]) == ("linked", None)

    def test_those_that_run_backwards_are_kept_and_no_map(self, api: Any, link: str) -> None:
        found = instants(api, link, (15, 30), (5, 50)).json()
        assert found["map"]["outcome"] == "unobservable"
        assert "backwards" in found["map"]["reason"]
        assert [one["residual"] for one in found["instants"]] == [None, None]

    @pytest.mark.parametrize(
        ("pairs", "pointer"),
        [
            ([(20, 30)], "/instants/0/live"),
            ([(5, 30), (6, 19)], "/instants/1/replay"),
            ([(5, 30), (6, 30)], "/instants"),
        ],
    )
    def test_those_that_cannot_be_are_refused(
        self, api: Any, link: str, pairs: list[tuple[int, int]], pointer: str
    ) -> None:
        answer = instants(api, link, *pairs)
        assert (answer.status_code, answer.json()["pointer"]) == (400, pointer)

    def test_nobody_overwrites_another(self, api: Any, link: str) -> None:
        tag = {"If-Match": api.get(link).headers["etag"]}
        theirs = instants(api, link, (5, 30)).json()
        body = {"instants": [{"live": 6, "replay": 30}]}
        late = api.put(f"{link}/instants", json=body, headers=tag)
        assert (late.status_code, late.json()["current"]) == (412, theirs)
        assert api.put(f"{link}/instants", json=body).status_code == 428

    def test_it_is_removed(self, api: Any, link: str) -> None:
        assert api.delete(link).status_code == 204
        assert api.get(link).status_code == api.delete(link).status_code == 404

    def test_others_write_while_the_map_is_found(
        self, app: Any, api: Any, link: str, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        from app.features.recordings import links

        plain, store, written = links.fit_map_to_instants, app.state.services.store, []

        def write() -> None:
            with store.write(), without_pending_response():
                written.append(True)

        def slow(*arguments: Any) -> Any:
            other = Thread(target=write, daemon=True)
            other.start()
            other.join(20)
            return plain(*arguments)

        monkeypatch.setattr(links, "fit_map_to_instants", slow)
        assert instants(api, link, (5, 30), (15, 50)).status_code == 200
        assert written == [True]

    def test_of_two_at_once_the_later_is_refused(
        self, api: Any, link: str, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        from app.features.recordings import links

        plain, faster = links.fit_map_to_instants, iter([(4, 25)])

        def slow(*arguments: Any) -> Any:
            for pair in faster:
                assert instants(api, link, pair).status_code == 200
            return plain(*arguments)

        monkeypatch.setattr(links, "fit_map_to_instants", slow)
        assert instants(api, link, (5, 30), (15, 50)).status_code == 412
        assert [one["live"] for one in api.get(link).json()["instants"]] == [4]


class TestNearestFrames:
    def test_it_is_what_a_look_at_all_frames_finds(self) -> None:
        generator = np.random.default_rng(5)
        for _ in range(300):
            live = np.arange(generator.integers(1, 40)) * 0.04
            replay = np.sort(generator.integers(0, 60, generator.integers(1, 60)) * 0.02)
            marked = generator.random(len(replay)) < 0.4
            numbers, later = find_nearest_frames(live, replay, marked, 0.02)
            for time, number, off in zip(live, numbers, later, strict=True):
                apart = np.abs(replay - time)
                if replay[0] - time > 0.02 or replay[-1] - time < -0.02:
                    assert (number, off) == (-1, 0.0)
                    continue
                sound = np.flatnonzero((apart <= 0.02) & ~marked)
                choice = sound if len(sound) else np.arange(len(replay))
                assert apart[number] == apart[choice].min()
                assert number in choice and off == replay[number] - time

    def test_very_long_shots_take_no_time_to_speak_of(self) -> None:
        count = 67_000
        replay = np.arange(count) * 0.02
        began = process_time()
        numbers, _ = find_nearest_frames(
            np.arange(count) * 0.04, replay, np.zeros(count, bool), 0.02
        )
        assert process_time() - began < 2
        assert (numbers[:5].tolist(), numbers[-1]) == ([0, 2, 4, 6, 8], -1)


class TestLinkedFrames:
    def test_each_live_frame_has_the_nearest_of_the_replay_or_none(
        self, api: Any, link: str
    ) -> None:
        empty = api.get(f"{link}/frames").json()
        assert (empty["first"], set(empty["replay"])) == (0, {None})
        # Half as fast, and the replay begins with live frame 4.
        instants(api, link, (4, 20), (14, 40))
        found = api.get(f"{link}/frames").json()
        assert found["replay"] == [None] * 4 + [20 + 2 * at for at in range(16)]
        assert found["off_s"][3] is None
        assert found["off_s"][4:] == pytest.approx([0.0] * 16, abs=1e-9)

    def test_a_frame_that_is_repeated_or_blended_is_passed_over(
        self, api: Any, link: str, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        from app.features.recordings import link_frames

        def marks(_index: Path, first: int, last: int) -> Any:
            frames = range(first, last + 1)
            return link_frames.np.array([[n == 24 for n in frames], [n == 26 for n in frames]])

        monkeypatch.setattr(link_frames, "_read_repeat_and_blend_flags", marks)
        instants(api, link, (0, 20), (10, 50))
        found = api.get(f"{link}/frames").json()
        # Three frames of the replay are one live: 24 would be 1.33.
        assert (found["repeated"], found["blended"]) == ([24], [26])
        assert found["replay"][:4] == [20, 23, 27, 29]
        assert found["off_s"][2] == pytest.approx(0.04 / 3)


class TestLinkedGroups:
    @staticmethod
    def taken(api: Any, link: str, finished: Finished, *frames: int, linked: bool = True) -> Any:
        body = {"frames": list(frames), "propose": False, "linked": linked}
        job = finished(api.post(f"{link.partition('/links')[0]}/groups", json=body))
        assert job.state == "done", job.problem
        return job.result

    @staticmethod
    def views(api: Any) -> dict[str, list[str]]:
        rows = api.get("/api/v1/groups", params={"dataset": "cup"}).json()["items"]
        groups = [api.get(f"/api/v1/groups/{row['id']}").json() for row in rows]
        return {one["key"]: [view["key"] for view in one["views"]] for one in groups}

    def test_frames_of_the_replay_that_show_the_same_are_further_views(
        self, app: Any, api: Any, link: str, finished: Finished
    ) -> None:
        # Half as fast, and the replay begins with live frame 4.
        instants(api, link, (4, 20), (14, 41))
        result = self.taken(api, link, finished, 2, 10)
        assert (result["new"], result["linked_views"], result["outside"]) == (2, 1, 1)
        assert self.views(api) == {
            "final/2.png": ["2.png"],
            "final/10.png": ["10.png", "33.png"],
        }
        with app.state.services.store.read() as session:
            body = [entry for entry in read_log(session) if entry.kind == "import"][-1].body
        told = body["group"]["views"][1]["extras"]["metadata"]["recording"]
        assert (told["name"], told["frame"], told["live_frame"]) == ("final", 33, 10)
        assert told["off_s"] == pytest.approx((4 + 13 / 2.1 - 10) * 0.04)
        assert (told["repeated"], told["blended"]) == (False, False)
        # Frame 33 lies 13 frames after one instant and 8 before the other, of a live frame of 0.04 s each.
        assert told["sigma_s"] == pytest.approx(0.04 * np.hypot(8, 13) / 21)
        number = api.get("/api/v1/groups", params={"dataset": "cup"}).json()["items"][1]["id"]
        (_, view) = api.get(f"/api/v1/groups/{number}").json()["views"]
        assert number_of(picture_of(api.get(f"/api/v1/views/{view['id']}/image"))) == 33

    def test_a_replay_that_is_linked_later_joins_groups_that_have_one_and_a_dry_run_shows_it(
        self, api: Any, recording: str, finished: Finished
    ) -> None:
        replays = [{"recording": 1, "first": a, "last": b} for a, b in ((20, 39), (40, 59))]
        links = []
        for replay in replays:
            made = api.post(f"{recording}/links", json={"live": LIVE, "replay": replay})
            links.append(made.headers["location"])
        instants(api, links[0], (0, 20), (19, 39))
        self.taken(api, links[0], finished, 10)
        instants(api, links[1], (0, 40), (19, 59))
        body = {"frames": [10, 11], "linked": True, "dry_run": True}
        counted = finished(api.post(f"{recording}/groups", json=body)).result
        assert counted["dry_run"] and counted["solve_job"] is None
        assert (counted["new"], counted["changed"], counted["linked_views"]) == (1, 1, 3)
        assert self.views(api) == {"final/10.png": ["10.png", "30.png"]}
        ball = {"point": [63, 44]}
        (row,) = api.get("/api/v1/groups", params={"dataset": "cup"}).json()["items"]
        group = api.get(f"/api/v1/groups/{row['id']}")
        path = f"/api/v1/views/{group.json()['views'][1]['id']}/ball"
        tag = {"If-Match": group.headers["etag"]}
        assert api.patch(path, json=ball, headers=tag).status_code == 200
        result = self.taken(api, links[1], finished, 10, 11)
        names = ("new", "changed", "unchanged", "linked_views")
        assert [result[name] for name in names] == [1, 1, 0, 3]
        assert self.views(api) == {
            "final/10.png": ["10.png", "30.png", "50.png"],
            "final/11.png": ["11.png", "31.png", "51.png"],
        }
        views = api.get(f"/api/v1/groups/{row['id']}").json()["views"]
        assert [bool(view["balls"]) for view in views] == [False, True, False]
        result = self.taken(api, links[1], finished, 10, 11)
        assert (result["unchanged"], result["linked_views"]) == (2, 0)

    def test_a_group_of_one_view_gets_them_and_others_stay(
        self, api: Any, link: str, finished: Finished
    ) -> None:
        self.taken(api, link, finished, 10, linked=False)
        instants(api, link, (0, 20), (19, 58))
        result = self.taken(api, link, finished, 10, 11)
        assert (result["new"], result["changed"], result["unchanged"]) == (1, 1, 0)
        views = {"final/10.png": ["10.png", "40.png"], "final/11.png": ["11.png", "42.png"]}
        assert self.views(api) == views
        # Another map leaves what was taken as it is.
        instants(api, link, (0, 20), (10, 30))
        result = self.taken(api, link, finished, 10, 11)
        assert (result["new"], result["changed"], result["unchanged"]) == (0, 0, 2)
        assert (result["linked_views"], result["outside"]) == (0, 0)
        assert self.views(api) == views

    def test_a_replay_in_another_recording_is_read_from_there(
        self, api: Any, film: Path, recording: str, finished: Finished
    ) -> None:
        write_video(film.parent / "other.mp4", "mp4v", 30)
        body = {"dataset": "cup", "source": {"folder": "films/other.mp4"}}
        other = finished(api.post(API, json=body)).result["recording"]
        replay = {"recording": other, "first": 0, "last": 29}
        made = api.post(f"{recording}/links", json={"live": LIVE, "replay": replay})
        link = made.headers["location"]
        instants(api, link, (0, 0), (10, 20))
        result = self.taken(api, link, finished, 5, 6)
        assert (result["new"], result["linked_views"]) == (2, 2)
        assert self.views(api)["final/5.png"] == ["5.png", "other_10.png"]
        (film.parent / "other.mp4").unlink()
        body = {"frames": [7], "propose": False, "linked": True}
        job = finished(api.post(f"{recording}/groups", json=body))
        assert (
            "other.mp4 is no longer in the place that it was imported from" in job.problem["detail"]
        )
        assert "final/7.png" not in self.views(api)
        # Of frames that it does not show, and of those that have its views, it is not needed.
        result = self.taken(api, link, finished, 5, 30)
        assert (result["new"], result["unchanged"], result["linked_views"]) == (1, 1, 0)

    def test_kept_frames_of_a_replay_whose_file_is_gone_are_views(
        self, app: Any, api: Any, film: Path, recording: str, finished: Finished
    ) -> None:
        write_video(film.parent / "other.mp4", "mp4v", 30)
        body = {"dataset": "cup", "source": {"folder": "films/other.mp4"}}
        other = finished(api.post(API, json=body)).result["recording"]
        replay = {"recording": other, "first": 0, "last": 29}
        made = api.post(f"{recording}/links", json={"live": LIVE, "replay": replay})
        instants(api, made.headers["location"], (0, 0), (10, 20))
        # The group of its own that frame 10 of the replay is keeps its picture.
        self.taken(api, f"{API}/{other}/links", finished, 10, linked=False)
        (film.parent / "other.mp4").unlink()
        assert self.taken(api, made.headers["location"], finished, 5)["linked_views"] == 1
        assert self.views(api)["final/5.png"] == ["5.png", "other_10.png"]


class TestSuggestions:
    def test_shots_of_the_main_camera_before_the_replay_come_first(
        self, api: Any, film: Path, recording: str, finished: Finished
    ) -> None:
        write_video(film.parent / "other.mp4", "mp4v", 30)
        body = {"dataset": "cup", "source": {"folder": "films/other.mp4"}}
        other = finished(api.post(API, json=body)).result["recording"]
        ends = [(0, 9, "main"), (10, 19, "closeup"), (20, 29, "main"), (30, 49, "replay")]
        ends += [(50, 59, "main")]
        for at, shots in ((recording, ends), (f"{API}/{other}", [(0, 29, "main")])):
            tag = {"If-Match": api.get(f"{at}/shots").headers["etag"]}
            items = [{"first": a, "last": b, "kind": kind} for a, b, kind in shots]
            assert api.put(f"{at}/shots", json={"shots": items}, headers=tag).status_code == 200
        replay = {"recording": 1, "first": 30, "last": 49}
        made = {"live": {"first": 0, "last": 9}, "replay": replay}
        link = api.post(f"{recording}/links", json=made).json()["id"]
        found = api.get(f"{recording}/links/suggestions/35").json()["items"]
        told = [(one["recording"], one["first"], one["link"]) for one in found]
        assert told == [(1, 20, None), (1, 0, link), (other, 0, None)]
        assert found[0]["why"] == "Main camera, 0.4 s long, ends 0.0 s before the replay."
        assert found[2]["why"] == "Main camera of other; the time of this shot is not known."

    def test_a_frame_in_no_shot_is_refused(self, api: Any, recording: str) -> None:
        answer = api.get(f"{recording}/links/suggestions/60")
        assert (answer.status_code, answer.json()["pointer"]) == (400, "/frame")
