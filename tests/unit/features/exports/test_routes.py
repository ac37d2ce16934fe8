"""Exports over HTTP: asked for, waited for, listed, fetched and deleted."""

from __future__ import annotations

import io
import json
import threading
import zipfile
from dataclasses import replace
from datetime import datetime, timedelta
from pathlib import Path
from typing import Any

import pytest

from app.errors import StorageError
from app.features.datasets.service import dataset_id
from app.features.exports import routes as module
from app.features.exports.service import ExportReport
from app.features.imports.ingest import import_groups
from app.features.jobs import job_run
from app.features.jobs.service import Jobs
from app.features.maintenance.upkeep import clean_up
from app.features.solutions.service import solve_dataset
from app.features.versions.freeze import FreezeRequest, freeze_dataset
from app.formats.export_formats import FORMATS
from app.media.frames import EncodedPicture
from app.soccer.frames import ImageSize
from app.soccer.group import Group, Media, Station, View
from tests.waiting import SECONDS

API = "/api/v1/exports"
ORDER = {"dataset": "broadcast", "format": "cameras", "all": True}


@pytest.fixture
def busy(app: Any) -> Any:
    """The dataset's exports wait for a job of its own until the event is set."""
    started, finish = threading.Event(), threading.Event()

    def work(progress: Any) -> None:
        started.set()
        assert finish.wait(SECONDS)

    services = app.state.services
    own = dataset_id(services.store, ORDER["dataset"])
    services.jobs.submit("bulk", "Work", work, dataset_id=own, actor="bob")
    assert started.wait(SECONDS)
    yield finish
    finish.set()


class TestListFormats:
    def test_every_format_is_possible_or_says_why_not(self, api) -> None:
        items = api.get("/api/v1/datasets/broadcast/export-formats").json()["items"]
        assert {one["format"] for one in items} == set(FORMATS)
        for one in items:
            assert one["possible"] == (one["reason"] is None)
        assert not next(one for one in items if one["format"] == "issia")["possible"]
        assert api.get("/api/v1/datasets/none/export-formats").status_code == 404


class TestIncomplete:
    @pytest.mark.parametrize(("form", "lacks"), [("yolo", True), ("coco", False)])
    def test_yolo_without_its_pictures_says_what_is_missing(
        self, api, form: str, lacks: bool
    ) -> None:
        order = {**ORDER, "format": form, "views": "all"}
        job = api.post(API, json=order).json()
        api.get(job["content"])
        made = api.get(f"{API}/{job['id']}").json()
        assert (made["state"], made["incomplete"] is not None) == ("done", lacks)
        if lacks:
            assert "not in this export; frames.csv names their places" in made["incomplete"]


class TestMakeExport:
    def test_is_a_job_and_its_zip_can_be_asked_for_at_once(self, app, api) -> None:
        answer = api.post(API, json=ORDER)
        job = answer.json()
        assert answer.status_code == 202
        assert answer.headers["location"] == f"/api/v1/jobs/{job['id']}"
        assert (job["kind"], job["dataset"], job["content"]) == (
            "export",
            "broadcast",
            f"{API}/{job['id']}/content",
        )
        content = api.get(job["content"])
        assert content.headers["content-type"] == "application/zip"
        with zipfile.ZipFile(io.BytesIO(content.content)) as archive:
            assert "manifest.json" in archive.namelist()
        document = api.get(f"{API}/{job['id']}").json()
        assert (document["status"], document["counts"]["cameras"]) == ("ready", 6)
        assert document["state"] == "done"
        assert document["bytes"] == len(content.content)
        done = api.get(f"/api/v1/jobs/{job['id']}").json()
        assert (done["state"], done["done"], done["total"]) == ("done", 3, 3)
        assert done["result"]["content"] == document["content"]

    def test_whether_detectors_learn_from_every_view_is_asked_for(self, api) -> None:
        for order, said in ((ORDER, "valid"), ({**ORDER, "format": "coco", "views": "all"}, "all")):
            job = api.post(API, json=order).json()
            api.get(job["content"])
            assert api.get(f"{API}/{job['id']}").json()["request"]["views"] == said
        assert api.post(API, json={**ORDER, "views": "some"}).status_code == 422

    def test_an_impossible_export_is_refused_before_a_job_starts(self, app, api) -> None:
        nothing = api.post(API, json={**ORDER, "all": False})
        assert (nothing.status_code, "accepted" in nothing.json()["detail"]) == (400, True)
        assert api.post(API, json={**ORDER, "dataset": "x"}).status_code == 404
        assert api.post(API, json={**ORDER, "all": False, "version": 7}).status_code == 404
        assert app.state.services.jobs.find() == []

    @pytest.mark.parametrize("called_by", ["id", "hash", "name"])
    def test_an_export_of_a_version_says_it_as_it_was_asked_for(
        self, app, api, called_by: str
    ) -> None:
        request = FreezeRequest("v1", groups="passing")
        version = freeze_dataset(app.state.services.store, "broadcast", request, actor="local")
        called = {"id": version.id, "hash": version.hash[:12], "name": "v1"}[called_by]
        answer = api.post(API, json={**ORDER, "all": False, "version": called})
        assert answer.status_code == 202
        assert api.get(answer.json()["content"]).status_code == 200
        (row,) = api.get(API).json()["items"]
        assert row["request"]["version"] == called

    @pytest.mark.parametrize(
        ("order", "status", "pointer", "words"),
        [
            ({"images": "copy"}, 400, "/images", "no image file of"),
            ({"version": "v1"}, 400, "/all", "its own groups"),
            ({"format": "touchline", "version": 1}, 400, "/version", "whole dataset"),
            ({"format": "issia-3d"}, 400, None, "cannot be from ISSIA"),
            ({"all": False, "version": "v9"}, 404, None, "no version"),
        ],
    )
    def test_what_could_only_fail_is_refused_and_no_job_begins(
        self, app, api, order, status, pointer, words
    ) -> None:
        answer = api.post(API, json={**ORDER, **order})
        assert (answer.status_code, answer.json()["pointer"]) == (status, pointer)
        assert words in answer.json()["detail"]
        assert app.state.services.jobs.find() == []

    def test_the_images_of_many_groups_are_looked_for_beyond_the_first(
        self, app, api, group, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        monkeypatch.setattr("app.features.exports.service.TRIED", 1)
        framed = [
            replace(group, key=f"{n}.png", views=tuple(
                replace(view, media=Media(str(tmp_path / f"{n}.png"))) for view in group.views
            ))
            for n in range(3)
        ]  # fmt: skip
        import_groups(app.state.services.store, "many", framed, source="test", actor="local")
        order = {**ORDER, "dataset": "many", "images": "copy"}
        assert api.post(API, json=order).status_code == 400
        (tmp_path / "2.png").write_bytes(b"a picture")
        assert api.post(API, json=order).status_code == 202

    def test_a_format_without_room_for_anything_that_is_there_is_refused(self, app, api) -> None:
        services = app.state.services
        bare = Group("1.png", (View("1.png", Station("1.png", ImageSize(1280, 720))),), "m")
        import_groups(services.store, "bare", [bare], source="test", actor="local")
        answer = api.post(API, json={**ORDER, "dataset": "bare"})
        assert (answer.status_code, "camera" in answer.json()["detail"]) == (400, True)
        assert services.jobs.find() == []

    def test_what_fails_while_it_is_written_says_why_and_leaves_nothing(
        self, app, api, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        def broken(*arguments: object, **options: object) -> None:
            raise OSError(28, "No space left on device")

        monkeypatch.setattr("app.formats.output.write_zip", broken)
        job = api.post(API, json=ORDER).json()
        failed = app.state.services.jobs.wait(job["id"], SECONDS)
        assert failed.state == "failed"
        document = api.get(f"{API}/{job['id']}").json()
        assert (document["status"], document["content"]) == ("failed", None)
        assert "No space left" in document["error"]
        content = api.get(job["content"])
        assert content.status_code == 409
        assert "No space left" in content.json()["detail"]
        assert list(app.state.services.exports.folder.iterdir()) == []
        assert api.delete(f"{API}/{job['id']}").status_code == 204
        assert api.get(f"{API}/{job['id']}").status_code == 404
        assert api.get(API).json()["items"] == []


class TestListExports:
    def test_gives_the_newest_first_with_those_under_way(self, app, api, busy) -> None:
        ids = [str(api.post(API, json=ORDER).json()["id"]) for _ in range(3)]
        page = api.get(API, params={"limit": 2}).json()
        assert [item["id"] for item in page["items"]] == ids[:0:-1]
        assert {item["status"] for item in page["items"]} == {"waiting"}
        rest = api.get(API, params={"limit": 2, "cursor": page["next"]}).json()
        assert ([item["id"] for item in rest["items"]], rest["next"]) == ([ids[0]], None)
        assert api.get(API, params={"dataset": "static"}).json()["items"] == []
        busy.set()
        app.state.services.jobs.wait(int(ids[2]), SECONDS)
        assert {item["status"] for item in api.get(API).json()["items"]} == {"ready"}


class TestGetContent:
    def test_a_request_for_the_content_does_not_wait_forever(
        self, api, busy, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        monkeypatch.setattr(module, "PATIENCE", 0.1)
        job = api.post(API, json=ORDER).json()
        answer = api.get(job["content"])
        assert (answer.status_code, "still being written" in answer.text) == (409, True)

    def test_the_content_of_an_unknown_export_is_404(self, app, api, busy) -> None:
        (other,) = app.state.services.jobs.find()
        for name in (other.id, 99, "x", "0" * 32, "1" * 30):
            assert api.get(f"{API}/{name}/content").status_code == 404
            assert api.get(f"{API}/{name}").status_code == 404


class TestDeleteDataset:
    def test_leaves_no_export_where_it_is_stopped_half_way(
        self, app, api, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        job = api.post(API, json=ORDER).json()
        assert api.get(job["content"]).status_code == 200

        def fail(*_arguments: Any, **_options: Any) -> None:
            raise StorageError("the disk is full")

        monkeypatch.setattr("app.features.datasets.service.delete_dataset", fail)
        confirmed = {"confirm": ORDER["dataset"]}
        answer = api.request("DELETE", f"/api/v1/datasets/{ORDER['dataset']}", json=confirmed)
        assert not answer.is_success
        assert list(app.state.services.exports.folder.iterdir()) == []


class TestExportsOfEarlierJobs:
    """What lies in the folder under the id of another job, as where a restore took job ids back."""

    def leave(self, app: Any, number: int) -> None:
        folder = app.state.services.exports
        folder.folder.mkdir(exist_ok=True)
        path = folder.get_zip_path(str(number))
        path.write_bytes(b"PK\x05\x06" + b"\0" * 18)
        report = ExportReport(path, "cameras", 2, {"cameras": 2}, {}, ())
        folder.save_entry(str(number), {**ORDER, "dataset": "secret"}, report)

    def test_are_not_served_under_the_id_of_a_job_of_another_kind(self, app, api, busy) -> None:
        (other,) = app.state.services.jobs.find()
        self.leave(app, other.id)
        for address in (f"{API}/{other.id}", f"{API}/{other.id}/content"):
            assert api.get(address).status_code == 404
        assert api.delete(f"{API}/{other.id}").status_code == 404

    def test_are_not_taken_for_what_a_job_left_that_waits(
        self, app, api, busy, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        monkeypatch.setattr(module, "PATIENCE", 0.1)
        job = api.post(API, json=ORDER).json()
        self.leave(app, job["id"])
        assert api.get(f"{API}/{job['id']}").json()["request"]["dataset"] == ORDER["dataset"]
        assert [item["state"] for item in api.get(API).json()["items"]] == ["waiting"]
        assert api.get(job["content"]).status_code == 409

    def test_are_not_taken_for_what_a_job_of_another_dataset_left(self, app, api) -> None:
        job = api.post(API, json=ORDER).json()
        assert api.get(job["content"]).status_code == 200
        self.leave(app, job["id"])
        assert api.get(job["content"]).status_code == 404
        assert api.get(f"{API}/{job['id']}").json()["state"] == "gone"
        assert [item["state"] for item in api.get(API).json()["items"]] == ["gone"]


class TestCancel:
    def test_a_cancelled_export_leaves_no_file(
        self, app, api, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        from app.features.exports import service as export

        jobs: Jobs = app.state.services.jobs
        plain, started, calls = export.write_format, threading.Event(), list[Any]()

        def slow(*arguments: Any, **options: Any) -> Any:
            calls.append(arguments)
            # The first call is that of the request, which tries whether it can be.
            if len(calls) > 1:
                started.set()
                assert cancelled.wait(SECONDS)
            return plain(*arguments, **options)

        cancelled = threading.Event()
        monkeypatch.setattr(export, "write_format", slow)
        job = api.post(API, json=ORDER).json()
        assert started.wait(SECONDS)
        assert api.delete(f"/api/v1/jobs/{job['id']}").status_code == 200
        cancelled.set()
        assert jobs.wait(job["id"], SECONDS).state == "cancelled"
        assert list(app.state.services.exports.folder.iterdir()) == []
        assert api.get(f"{API}/{job['id']}").json()["status"] == "cancelled"
        assert api.delete(f"{API}/{job['id']}").status_code == 204
        assert api.get(API).json()["items"] == []


class TestDeleteExport:
    def test_deleting_an_export_deletes_its_file(self, app, api) -> None:
        job = api.post(API, json=ORDER).json()
        assert api.get(job["content"]).status_code == 200
        assert api.delete(f"{API}/{job['id']}").status_code == 204
        assert api.get(job["content"]).status_code == 404
        assert api.get(f"{API}/{job['id']}").json()["status"] == "gone"
        assert api.delete(f"{API}/{job['id']}").status_code == 404
        assert list(app.state.services.exports.folder.iterdir()) == []

    def test_deleting_an_export_that_is_being_written_is_409(self, api, busy) -> None:
        job = api.post(API, json=ORDER).json()
        assert api.delete(f"{API}/{job['id']}").status_code == 409


class TestExpiry:
    def test_they_stay_where_nothing_is_set(self, app, api) -> None:
        job = api.post(API, json=ORDER).json()
        assert api.get(f"{API}/{job['id']}").json()["expires"] is None
        assert clean_up(app.state.services.store).expired_exports == 0
        assert api.get(job["content"]).status_code == 200

    def test_an_expired_export_stays_listed_says_so_and_can_be_made_again(
        self, app, api, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        for settings in (app.state.services.settings, app.state.services.store.settings):
            monkeypatch.setattr(settings, "export_days", 30)
        job = api.post(API, json=ORDER).json()
        assert api.get(job["content"]).status_code == 200
        ready = api.get(f"{API}/{job['id']}").json()
        lasts = datetime.fromisoformat(ready["expires"]) - datetime.fromisoformat(ready["created"])
        assert timedelta(days=30) <= lasts < timedelta(days=30, minutes=1)

        exports = app.state.services.exports
        record = exports.folder / f"{job['id']}.json"
        values = {**json.loads(record.read_bytes()), "created": "2020-01-01T00:00:00.000+00:00"}
        record.write_text(json.dumps(values))
        assert clean_up(app.state.services.store).expired_exports == 1
        (row,) = api.get(API).json()["items"]
        assert (row["state"], row["status"]) == ("expired", "expired")
        assert (row["content"], row["expires"]) == (None, None)
        assert row["counts"] == ready["counts"]
        gone = api.get(job["content"])
        assert gone.status_code == 404
        assert gone.json()["detail"] == "the file of this export has expired"
        assert gone.json()["hint"] == (
            "Files of exports are kept for 30 days here. Make the export again."
        )
        again = api.post(API, json=row["request"]).json()
        assert api.get(again["content"]).status_code == 200


class TestRestart:
    def test_its_frames_are_read_by_other_processes(
        self, app, api, group, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        services, read = app.state.services, list[str]()
        views = [replace(view, media=Media(str(tmp_path / view.key))) for view in group.views]
        for view in views:
            (tmp_path / view.key).write_bytes(b"a picture")
        framed = replace(group, views=tuple(views))
        import_groups(services.store, "framed", [framed], source="test", actor="local")
        solve_dataset(services.store, "framed")

        def reader(media: Media, *_: object) -> EncodedPicture:
            read.append(media.path)
            return EncodedPicture.of("image/png", b"a picture")

        monkeypatch.setattr(services.frames, "read", reader)
        order = {**ORDER, "dataset": "framed", "all": True, "images": "copy"}
        job = api.post(API, json=order).json()
        done = services.jobs.wait(job["id"], SECONDS)
        assert done.state == "done", done.problem
        assert done.result["missing_images"] == 0
        assert read == [str(tmp_path / "7.png"), str(tmp_path / "7_1.png")]
        here = api.get(job["content"]).content

        # A process of its own asks for the same frames, and writes the same bytes.
        monkeypatch.setattr(job_run, "SMALL", 0)
        again = api.post(API, json=order).json()
        assert services.jobs.wait(again["id"], SECONDS).state == "done"
        assert read[2:] == read[:2]
        assert api.get(again["content"]).content == here

    def test_an_export_that_was_under_way_is_written_by_the_next_server(
        self, app, api, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        # The first server still believes that it is to write it.
        monkeypatch.setattr(module, "PATIENCE", 0.1)
        from app.features.exports.jobs import resume_exports

        services = app.state.services
        services.jobs._closing.set()
        job = api.post(API, json=ORDER).json()
        again = Jobs(services.store)
        resume_exports(again, services.store, services.exports, services.frames)
        again.start()
        assert again.wait(job["id"], SECONDS).state == "done"
        again.close()
        assert api.get(job["content"]).status_code == 200
