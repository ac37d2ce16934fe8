"""Recordings over HTTP."""

from __future__ import annotations

import json
import zipfile
from collections.abc import Callable
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pyarrow.parquet
import pytest

import touchline
from app.db.log import read_log
from app.db.store import Store
from app.features.datasets.service import get_dataset
from app.features.imports.cameras import import_given_cameras
from app.features.recordings import index as module
from app.features.recordings import jobs
from app.features.recordings.service import remove_recording
from app.soccer.frames import ImageSize
from app.soccer.policy import TOUCHLINE
from tests.cameras import looking
from tests.films import Join, KnownShot, join, rendered, write_film
from tests.unit.features.conftest import FRAMES
from tests.videos import HEIGHT, WIDTH, number_of, write_video
from touchline.errors import DataError

API = "/api/v1/recordings"
Finished = Callable[[Any], Any]


def picture_of(answer: Any) -> np.ndarray:
    """The pixels of an answer."""
    picture = cv2.imdecode(np.frombuffer(answer.content, np.uint8), cv2.IMREAD_COLOR)
    assert picture is not None
    return picture


class TestAddRecording:
    def test_a_file_of_an_allowed_folder_is_indexed_by_a_job(
        self, app, api, recording: str
    ) -> None:
        found = api.get(recording).json()
        assert (found["dataset"], found["name"], found["indexed"]) == ("cup", "final", True)
        assert (found["frames"], found["fps"], found["seconds"]) == (FRAMES, 25.0, FRAMES / 25)
        assert (found["width"], found["height"], found["problem"]) == (WIDTH, HEIGHT, None)
        assert (found["variable"], found["groups"], found["by"]) == (False, 0, "local")
        assert get_dataset(app.state.services.store, "cup").policy == TOUCHLINE
        listed = api.get(API, params={"dataset": "cup"}).json()["items"]
        assert listed == api.get(API).json()["items"] == [found]
        assert api.get(API, params={"dataset": "broadcast"}).json()["items"] == []

    def test_the_same_file_again_is_the_same_recording(
        self, api, recording: str, finished: Finished
    ) -> None:
        body = {"dataset": "cup", "source": {"folder": "films/final.mp4"}}
        shots = api.get(f"{recording}/shots")
        job = finished(api.post(API, json=body))
        assert f"{API}/{job.result['recording']}" == recording
        assert api.get(f"{recording}/shots").headers["etag"] == shots.headers["etag"]

    def test_another_file_of_its_name_gets_a_name_of_its_own(
        self, api, film: Path, recording: str, finished: Finished
    ) -> None:
        (film.parent / "b").mkdir()
        write_video(film.parent / "b" / "final.mp4", "mp4v", 30)
        body = {"dataset": "cup", "source": {"folder": "films/b/final.mp4"}}
        assert finished(api.post(API, json=body)).result["name"] == "final-2"

    def test_a_file_that_is_sent_stays(self, api, film: Path, finished: Finished) -> None:
        kind = {"content-type": "application/octet-stream"}
        url = "/api/v1/uploads?name=final.mp4"
        sent = api.post(url, content=film.read_bytes(), headers=kind).json()
        body = {"dataset": "cup", "source": {"upload": sent["id"]}}
        assert finished(api.post(API, json=body)).result["frames"] == FRAMES
        assert api.get(f"/api/v1/uploads/{sent['id']}").json()["kept"]

    def test_a_file_that_is_sent_for_a_dataset_that_cannot_be_does_not_stay(
        self, api, film: Path
    ) -> None:
        kind = {"content-type": "application/octet-stream"}
        url = "/api/v1/uploads?name=final.mp4"
        sent = api.post(url, content=film.read_bytes(), headers=kind).json()
        body = {"dataset": "a/b", "source": {"upload": sent["id"]}}
        refused = api.post(API, json=body)
        assert (refused.status_code, refused.json()["pointer"]) == (400, "/dataset")
        upload = f"/api/v1/uploads/{sent['id']}"
        assert not api.get(upload).json()["kept"]
        assert api.delete(upload).status_code == 204

    @pytest.mark.parametrize(
        ("content", "problem"),
        [(b"", "final.mp4 is empty"), (b"no video at all", "is not a video that can be read")],
    )
    def test_what_is_no_video_is_one_message(
        self, api, film: Path, finished: Finished, content: bytes, problem: str
    ) -> None:
        film.write_bytes(content)
        body = {"dataset": "cup", "source": {"folder": "films/final.mp4"}}
        job = finished(api.post(API, json=body))
        assert (job.state, problem in job.problem["detail"]) == ("failed", True)
        (listed,) = api.get(API).json()["items"]
        assert (listed["indexed"], listed["frames"]) == (False, None)
        assert problem in listed["problem"]
        refused = api.get(f"{API}/{listed['id']}/frames/0")
        assert (refused.status_code, refused.json()["detail"]) == (409, listed["problem"])
        write_video(film, "mp4v", FRAMES)
        finished(api.post(f"{API}/{listed['id']}/shots"))
        found = api.get(f"{API}/{listed['id']}").json()
        assert (found["indexed"], found["problem"]) == (True, None)

    def test_one_that_is_removed_while_it_is_read_ends_its_job(
        self, api, film: Path, finished: Finished, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        read = jobs.index_recording_in_worker

        def remove_and_read(store: Store, recording_id: int, **more: Any) -> Any:
            remove_recording(store, recording_id, actor="ann")
            return read(store, recording_id, **more)

        monkeypatch.setattr(jobs, "index_recording_in_worker", remove_and_read)
        body = {"dataset": "cup", "source": {"folder": "films/final.mp4"}}
        job = finished(api.post(API, json=body))
        assert (job.state, job.sentence) == ("cancelled", "The recording was removed.")

    def test_an_absolute_path_is_refused_with_how_it_is_written(self, api, film: Path) -> None:
        body = {"dataset": "cup", "source": {"folder": str(film)}}
        refused = api.post(API, json=body)
        assert refused.status_code == 400
        assert refused.json()["hint"] == "Write FOLDER/FILE, where FOLDER is one of: films."

    def test_what_has_no_name_of_a_video_is_refused_at_once(self, api, film: Path) -> None:
        (film.parent / "notes.txt").write_text("x")
        for inside in ("films/notes.txt", "films"):
            body = {"dataset": "cup", "source": {"folder": inside}}
            assert api.post(API, json=body).status_code == 400


class TestGetFrame:
    def test_each_number_is_exactly_its_frame(self, api, recording: str) -> None:
        for number in (0, 1, 2, 40, 39, 38, 59, 7):
            answer = api.get(f"{recording}/frames/{number}")
            assert (answer.status_code, answer.headers["content-type"]) == (200, "image/jpeg")
            assert number_of(picture_of(answer)) == number

    def test_it_is_made_narrower_and_asked_for_once(self, api, recording: str) -> None:
        answer = api.get(f"{recording}/frames/5", params={"width": 80})
        assert picture_of(answer).shape[:2] == (HEIGHT // 2, WIDTH // 2)
        tag = {"If-None-Match": answer.headers["etag"]}
        again = api.get(f"{recording}/frames/5", params={"width": 80}, headers=tag)
        assert (again.status_code, again.content) == (304, b"")

    def test_it_is_kept_only_under_an_address_that_names_the_film(
        self, api, film: Path, recording: str, finished: Finished
    ) -> None:
        def caching(**asked: str) -> str:
            answer = api.get(f"{recording}/frames/5", params=asked)
            assert answer.status_code == 200 and answer.headers["etag"]
            return str(answer.headers["cache-control"])

        named = {"v": api.get(recording).json()["sha256"][:12]}
        assert caching(**named) == "private, max-age=3600"
        assert caching() == caching(v="") == caching(v=named["v"][:11]) == "private, no-cache"
        write_video(film, "mp4v", 30)
        finished(api.post(f"{recording}/shots"))
        assert caching(**named) == "private, no-cache"

    def test_a_frame_that_is_not_there_is_said_to_be(self, api, recording: str) -> None:
        answer = api.get(f"{recording}/frames/{FRAMES}")
        assert (answer.status_code, "has no frame 60" in answer.text) == (404, True)

    def test_of_a_file_that_changed_or_is_gone_nothing_is_shown(
        self, api, film: Path, recording: str, finished: Finished
    ) -> None:
        write_video(film, "mp4v", 30)
        answer = api.get(f"{recording}/frames/0")
        assert answer.status_code == 409
        assert "final.mp4 has changed since it was indexed" in answer.text
        assert "Index it again" in answer.json()["hint"]
        assert finished(api.post(f"{recording}/shots")).result["frames"] == 30
        assert number_of(picture_of(api.get(f"{recording}/frames/29"))) == 29
        film.unlink()
        assert (
            "no longer in the place that it was imported from"
            in api.get(recording).json()["problem"]
        )
        assert api.get(f"{recording}/frames/0").status_code == 409
        assert str(film.parent) not in api.get(f"{recording}/frames/0").text


class TestShots:
    def test_the_list_is_replaced_under_its_etag(self, app, api, recording: str) -> None:
        answer = api.get(f"{recording}/shots")
        tag = answer.headers["etag"]
        first = answer.json()["items"][0]
        assert (first["first"], first["entered_by"], first["start_s"]) == (0, "start", 0.0)
        shots = [
            {"first": 0, "last": 9, "kind": "main", "entered_by": "start", "kept": True},
            {"first": 12, "last": 59, "kind": "replay", "entered_by": "wipe", "kept": False},
        ]
        assert api.put(f"{recording}/shots", json={"shots": shots}).status_code == 428
        changed = api.put(f"{recording}/shots", json={"shots": shots}, headers={"If-Match": tag})
        assert changed.status_code == 200
        assert [{key: one[key] for key in shots[0]} for one in changed.json()["items"]] == shots
        assert changed.json()["items"][1]["start_s"] == pytest.approx(12 / 25)
        late = api.put(f"{recording}/shots", json={"shots": []}, headers={"If-Match": tag})
        assert (late.status_code, late.json()["current"]["items"]) == (412, changed.json()["items"])
        with app.state.services.store.read() as session:
            (told,) = [e for e in read_log(session) if e.body.get("did") == "shots changed"]
        assert (told.actor, told.body["shots"]) == ("local", 2)

    def test_they_are_a_table_too(self, api, recording: str) -> None:
        tag = {"If-Match": api.get(f"{recording}/shots").headers["etag"]}
        shots = [
            {"first": 0, "last": 9, "kind": "main", "entered_by": "start", "kept": True},
            {"first": 12, "last": 59, "kind": "replay", "entered_by": "wipe"},
        ]
        api.put(f"{recording}/shots", json={"shots": shots}, headers=tag)
        answer = api.get(f"{recording}/shots.csv")
        assert answer.headers["content-type"].startswith("text/csv")
        assert answer.text.splitlines() == [
            "recording,shot,first,last,start_s,end_s,kind,entered_by,kept",
            "final,1,0,9,0.0,0.4,main,start,True",
            "final,2,12,59,0.48,2.4,replay,wipe,",
        ]

    @pytest.mark.parametrize("places", [[(5, 4)], [(0, 60)], [(0, 9), (9, 20)], [(10, 20), (0, 5)]])
    def test_shots_that_cannot_be_are_refused(
        self, api, recording: str, places: list[tuple[int, int]]
    ) -> None:
        tag = {"If-Match": api.get(f"{recording}/shots").headers["etag"]}
        shots = [{"first": one, "last": two, "kind": "main"} for one, two in places]
        answer = api.put(f"{recording}/shots", json={"shots": shots}, headers=tag)
        assert (answer.status_code, answer.json()["pointer"][:7]) == (400, "/shots/")

    def test_they_are_found_anew(self, api, recording: str, finished: Finished) -> None:
        tag = {"If-Match": api.get(f"{recording}/shots").headers["etag"]}
        found = api.get(f"{recording}/shots").json()["items"]
        api.put(f"{recording}/shots", json={"shots": []}, headers=tag)
        assert api.get(f"{recording}/shots").json()["items"] == []
        assert finished(api.post(f"{recording}/shots")).result["shots"] == len(found) > 0
        assert api.get(f"{recording}/shots").json()["items"] == found

    def test_a_recording_whose_index_is_gone_is_indexed_again_and_keeps_its_shots(
        self, app, api, recording: str, finished: Finished
    ) -> None:
        shots = api.get(f"{recording}/shots").json()
        for index in app.state.services.settings.recordings.glob("*.npz"):
            index.write_bytes(b"of another version")
        module._read_frame_times.cache_clear()
        assert api.get(f"{recording}/shots").status_code == 409
        assert finished(api.post(f"{recording}/shots")).state == "done"
        assert api.get(f"{recording}/shots").json() == shots

    def test_cuts_of_a_film_are_found_when_it_is_added(
        self, api, film: Path, finished: Finished
    ) -> None:
        pictures, known = join([rendered(seed, 30) for seed in (1, 2, 3)], [Join("cut")] * 2)
        write_film(film.parent / "cuts.mp4", pictures)
        body = {"dataset": "cup", "source": {"folder": "films/cuts.mp4"}}
        job = finished(api.post(API, json=body))
        shots = api.get(f"{API}/{job.result['recording']}/shots").json()["items"]
        told = [KnownShot(shot["first"], shot["last"], shot["entered_by"]) for shot in shots]
        assert told == known


class TestMatchClock:
    def test_readings_are_kept_by_frame_and_groups_tell_the_time(
        self, app, api, recording: str, finished: Finished
    ) -> None:
        readings = [
            {"frame": 40, "half": 2, "seconds": 2700.0},
            {"frame": 10, "half": 1, "seconds": 760.0},
        ]
        changed = api.patch(recording, json={"clocks": readings})
        assert changed.json()["clocks"] == readings[::-1] == api.get(recording).json()["clocks"]
        finished(api.post(f"{recording}/groups", json={"frames": [5, 15, 50], "propose": False}))
        with app.state.services.store.read() as session:
            groups = [e.body["group"] for e in read_log(session) if e.kind == "import"][-3:]
            (told,) = [e.body for e in read_log(session) if e.body.get("did") == "match clock set"]
        shown = [one["views"][0]["extras"]["metadata"]["recording"] for one in groups]
        assert [one["match_half"] for one in shown] == [1, 1, 2]
        times = [one["match_seconds"] for one in shown]
        assert times == pytest.approx([759.8, 760.2, 2700.4])
        assert told["clocks"] == 2
        assert api.patch(recording, json={"clocks": []}).json()["clocks"] == []

    @pytest.mark.parametrize(
        ("clocks", "status"),
        [
            ([(60, 1, 0.0)], 400),
            ([(5, 1, 0.0), (5, 1, 1.0)], 400),
            ([(5, 2, 0.0), (9, 1, 1.0)], 400),
            ([(5, 5, 0.0)], 422),
            ([(5, 1, -1.0)], 422),
        ],
    )
    def test_readings_that_cannot_be_are_refused(
        self, api, recording: str, clocks: list[tuple[int, int, float]], status: int
    ) -> None:
        body = {"clocks": [{"frame": a, "half": b, "seconds": c} for a, b, c in clocks]}
        answer = api.patch(recording, json=body)
        assert answer.status_code == status
        assert api.get(recording).json()["clocks"] == []


class TestTakeInstants:
    def test_frames_become_groups_that_outlive_their_recording(
        self, app, api, film: Path, recording: str, finished: Finished
    ) -> None:
        body = {"frames": [40, 3, 40], "propose": False}
        job = finished(api.post(f"{recording}/groups", json=body))
        assert (job.state, job.result["new"], job.result["unchanged"]) == ("done", 2, 0)
        assert job.result["proposals_job"] is None
        assert api.get(recording).json()["groups"] == 2
        again = finished(api.post(f"{recording}/groups", json={"frames": [3]}))
        assert (again.result["new"], again.result["unchanged"]) == (0, 1)
        film.unlink()
        assert api.delete(recording).status_code == 204
        assert api.get(recording).status_code == 404
        rows = api.get("/api/v1/groups", params={"dataset": "cup"}).json()["items"]
        assert [row["key"] for row in rows] == ["final/3.png", "final/40.png"]
        group = api.get(f"/api/v1/groups/{rows[1]['id']}").json()
        picture = picture_of(api.get(f"/api/v1/views/{group['views'][0]['id']}/image"))
        assert (number_of(picture), picture.shape) == (40, (HEIGHT, WIDTH, 3))

    def test_where_a_group_is_from_goes_out_with_it(
        self, app, api, recording: str, finished: Finished
    ) -> None:
        finished(api.post(f"{recording}/groups", json={"frames": [12], "propose": False}))
        with app.state.services.store.read() as session:
            entries = [entry for entry in read_log(session) if entry.kind == "import"]
        (view,) = entries[-1].body["group"]["views"]
        told = view["extras"]["metadata"]["recording"]
        sha256 = api.get(recording).json()["sha256"]
        assert (told["name"], told["sha256"], told["frame"]) == ("final", sha256, 12)
        over, under = map(int, told["time_base"].split("/"))
        assert told["timestamp"] * over / under == pytest.approx(told["seconds"]) == 12 / 25

    def test_cameras_are_proposed_for_them(
        self, app, api, recording: str, finished: Finished
    ) -> None:
        job = finished(api.post(f"{recording}/groups", json={"frames": [0]}))
        sought = app.state.services.jobs.get(job.result["proposals_job"])
        assert (sought.kind, sought.dataset) == ("proposals", "cup")
        assert sought.request["match"] == "final"

    def test_cameras_of_a_track_are_given_to_them(
        self, app, api, recording: str, finished: Finished
    ) -> None:
        finished(api.post(f"{recording}/groups", json={"frames": [3, 40], "propose": False}))
        store, camera = (
            app.state.services.store,
            looking((0, 60, -15), (0, 0, 0), 160, size=ImageSize(WIDTH, HEIGHT)),
        )
        found = import_given_cameras(
            store, "cup", {"40": camera}, source="camera_40.json", actor="ann"
        )
        assert (found.changed, found.problems) == (1, [])
        number = api.get("/api/v1/groups", params={"dataset": "cup"}).json()["items"][1]["id"]
        (view,) = api.get(f"/api/v1/groups/{number}").json()["views"]
        assert (view["key"], view["station"]["has_given"]) == ("40.png", True)

    def test_a_frame_that_is_not_there_is_refused(self, api, recording: str) -> None:
        answer = api.post(f"{recording}/groups", json={"frames": [FRAMES]})
        assert (answer.status_code, answer.json()["pointer"]) == (400, "/frames")


class TestVersions:
    """What was frozen of a recording's groups needs neither the recording nor its index."""

    @pytest.fixture
    def frozen(self, api, recording: str, finished: Finished) -> int:
        """A version of the frames 3 and 40."""
        job = finished(api.post(f"{recording}/groups", json={"frames": [3, 40], "propose": False}))
        assert job.state == "done", job.problem
        for row in api.get("/api/v1/groups", params={"dataset": "cup"}).json()["items"]:
            group = api.get(f"/api/v1/groups/{row['id']}")
            tag = {"If-Match": group.json()["etag"]}
            body = {"state": "accepted", "note": "from a recording"}
            answer = api.put(f"/api/v1/groups/{row['id']}/verdict", json=body, headers=tag)
            assert answer.status_code == 200, answer.text
        body = {"name": "v1", "groups": "accepted"}
        made = finished(api.post("/api/v1/datasets/cup/versions", json=body))
        assert made.state == "done", made.problem
        return int(made.result["version"])

    def exported(self, api, finished: Finished, version: int, form: str, out: Path) -> Any:
        """The document of an export with pictures, which is written to a file."""
        asked = {"dataset": "cup", "format": form, "version": version, "images": "copy"}
        job = finished(api.post("/api/v1/exports", json=asked))
        assert job.state == "done", job.problem
        out.write_bytes(api.get(f"/api/v1/exports/{job.id}/content").content)
        return api.get(f"/api/v1/exports/{job.id}").json()

    def test_they_outlive_the_file_the_index_and_the_recording(
        self, app, api, film: Path, recording: str, frozen: int, finished: Finished, tmp_path: Path
    ) -> None:
        sha256 = api.get(recording).json()["sha256"]
        film.unlink()
        for index in app.state.services.settings.recordings.glob("*.npz"):
            index.unlink()
        assert api.delete(recording).status_code == 204
        verified = finished(api.post(f"/api/v1/versions/{frozen}/verify"))
        assert (verified.state, verified.result["equal"]) == ("done", 2)
        out = tmp_path / "v1.zip"
        told = self.exported(api, finished, frozen, "parquet", out)
        assert told["missing_images"] in ([], None)
        version = touchline.open(out)
        assert [view.key for view in version.views] == ["3.png", "40.png"]
        picture = cv2.imdecode(np.frombuffer(version.views[1].frame(), np.uint8), cv2.IMREAD_COLOR)
        assert (number_of(picture), picture.shape) == (40, (HEIGHT, WIDTH, 3))
        with zipfile.ZipFile(out) as packed, packed.open("views.parquet") as file:
            rows = pyarrow.parquet.read_table(pyarrow.BufferReader(file.read())).to_pylist()
        whence = [json.loads(row["extras"])["metadata"]["recording"] for row in rows]
        assert [(one["sha256"], one["frame"]) for one in whence] == [(sha256, 3), (sha256, 40)]
        assert [one["seconds"] for one in whence] == [3 / 25, 40 / 25]

    def test_pictures_that_are_gone_are_named(
        self, app, api, recording: str, frozen: int, finished: Finished, tmp_path: Path
    ) -> None:
        settings, sha256 = app.state.services.settings, api.get(recording).json()["sha256"]
        (settings.recordings / sha256 / "40.png").unlink()
        told = self.exported(api, finished, frozen, "parquet", tmp_path / "v1.zip")
        (missing,) = told["missing_images"]
        assert "40.png" in missing
        version = touchline.open(tmp_path / "v1.zip")
        assert version.views[0].frame().startswith(b"\x89PNG")
        with pytest.raises(DataError):
            version.views[1].frame()
