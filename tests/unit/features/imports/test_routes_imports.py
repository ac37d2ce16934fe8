"""Imports over HTTP."""

from __future__ import annotations

import io
import json
import zipfile
from dataclasses import replace
from pathlib import Path
from typing import Any
from unittest.mock import ANY

import cv2
import numpy as np
import pytest

from app.db.log import read_log
from app.features.datasets.service import get_dataset
from app.features.imports.jobs import resume_imports
from app.features.imports.queries import list_shared_stations
from app.features.imports.upload_queries import get_upload
from app.features.jobs.queries import NewJob, insert_job, update_job
from app.features.solve.jobs import register_solve_resume
from app.formats.issia_writer import write_issia
from app.formats.soccernet_v3_writer import write_soccernet_v3
from app.soccer.group import Group
from app.soccer.policy import PAPER, STRICT, TOUCHLINE
from tests.rigs import groups
from tests.unit.features.jobs.steps import Gate, submit
from tests.waiting import SECONDS

API = "/api/v1/imports"


@pytest.fixture
def tree(app: Any, tmp_path: Path, group: Group) -> Path:
    """An allowed folder with one match in SoccerNet-v3 layout."""
    root = tmp_path / "data"
    root.mkdir()
    write_soccernet_v3(root, [group])
    object.__setattr__(app.state.services.settings, "import_folders", [root])
    return root


def body(**changes: Any) -> dict[str, Any]:
    return {"dataset": "fresh", "format": "soccernet-v3", "source": {"folder": "data"}} | changes


def add_pictures(tree: Path, group: Group) -> None:
    """Grey pictures of the group's views, beside its labels."""
    (labels,) = tree.rglob("Labels-v3.json")
    for view in group.views:
        picture = np.full((view.size.height, view.size.width, 3), 127, np.uint8)
        cv2.imwrite(str(labels.parent / view.key), picture)


def finished(app: Any, answer: Any) -> Any:
    assert answer.status_code == 202, answer.text
    assert answer.headers["location"] == f"/api/v1/jobs/{answer.json()['id']}"
    return app.state.services.jobs.wait(answer.json()["id"], SECONDS)


class TestStartImport:
    def test_a_folder_becomes_a_dataset_and_the_job_reports(self, app, api, tree) -> None:
        (tree / "x").mkdir()
        (tree / "x" / "Labels-v3.json").write_text("{")
        job = finished(app, api.post(API, json=body()))
        result = job.result
        assert (job.state, job.kind) == ("done", "import")
        assert (result["read"], result["imported"], result["new"]) == (1, 1, 1)
        (skipped,) = result["skipped"]
        assert skipped["file"] == "x/Labels-v3.json"
        assert str(tree) not in str(result)
        assert get_dataset(app.state.services.store, "fresh").groups == 1

    def test_what_is_new_is_solved_afterwards(self, app, api, tree) -> None:
        finished(app, api.post(API, json=body()))
        jobs = app.state.services.jobs
        (solving,) = jobs.find(kinds=["solve"])
        jobs.wait(solving.id, SECONDS)
        (job,) = jobs.find(kinds=["import"])
        assert job.result["solve_job"] == solving.id
        again = finished(app, api.post(API, json=body()))
        assert again.result["solve_job"] is None
        assert get_dataset(app.state.services.store, "fresh").solved == 1

    def test_without_pictures_the_dataset_is_judged_as_in_the_paper(self, app, api, tree) -> None:
        job = finished(app, api.post(API, json=body()))
        assert job.result["paint_job"] is None
        assert get_dataset(app.state.services.store, "fresh").policy == PAPER
        named = finished(app, api.post(API, json=body(dataset="named", policy="touchline")))
        assert (named.result["solve_job"], named.result["paint_job"]) == (ANY, None)
        assert get_dataset(app.state.services.store, "named").policy == TOUCHLINE

    def test_with_pictures_their_paint_is_read_next_and_solved_with(
        self, app, api, tree, group
    ) -> None:
        add_pictures(tree, group)
        result = finished(app, api.post(API, json=body())).result
        services = app.state.services
        assert get_dataset(services.store, "fresh").policy == TOUCHLINE
        assert services.jobs.wait(result["solve_job"], SECONDS).result["policy"] == "touchline"
        read = services.jobs.wait(result["paint_job"], SECONDS)
        assert (read.kind, read.result["views"]) == ("paint", len(group.views))
        assert read.result["without_picture"] == 0 < read.result["read"]
        assert finished(app, api.post(API, json=body())).result["paint_job"] is None

    def test_what_follows_is_asked_for_however_many_jobs_wait(
        self, app, api, tree, group, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        add_pictures(tree, group)
        jobs, gate = app.state.services.jobs, Gate()
        submit(jobs, gate)
        assert gate.started.wait(SECONDS)
        answer = api.post(API, json=body())
        submit(jobs, lambda _: None)
        monkeypatch.setattr(jobs, "_capacity", 1)
        gate.finish.set()
        job = finished(app, answer)
        assert (job.state, job.result["paint_job"] is not None) == ("done", True)

    def test_for_pictures_alone_cameras_are_proposed(self, app, api, tree) -> None:
        for path in tree.rglob("*.json"):
            path.unlink()
        for name in ("a.png", "b.png"):
            cv2.imwrite(str(tree / name), np.full((360, 640, 3), 127, np.uint8))
        result = finished(app, api.post(API, json=body(format="frames"))).result
        assert (result["outcome"], result["new"], result["paint_job"]) == ("complete", 2, None)
        services = app.state.services
        sought = services.jobs.wait(result["proposals_job"], SECONDS)
        assert (sought.kind, sought.result["views"]) == ("proposals", 2)
        again = finished(app, api.post(API, json=body(format="frames"))).result
        assert (again["unchanged"], again["proposals_job"]) == (2, None)
        off = body(dataset="off", format="frames", options={"propose": False})
        left = finished(app, api.post(API, json=off)).result
        assert (left["new"], left["proposals_job"]) == (2, None)

    def test_the_policy_that_is_named_judges_what_is_made_and_nothing_else(
        self, app, api, tree, group
    ) -> None:
        finished(app, api.post(API, json=body(policy="strict")))
        store = app.state.services.store
        assert get_dataset(store, "fresh").policy == STRICT
        add_pictures(tree, group)
        again = finished(app, api.post(API, json=body(policy="touchline")))
        assert (again.result["changed"], again.result["paint_job"]) == (1, None)
        assert get_dataset(store, "fresh").policy == STRICT
        assert api.post(API, json=body(policy="lenient")).status_code == 422

    def test_its_job_carries_the_dataset_from_the_beginning(self, app, api, tree) -> None:
        answer = api.post(API, json=body())
        assert answer.json()["dataset"] == "fresh"
        job = finished(app, answer)
        found = get_dataset(app.state.services.store, "fresh")
        assert (job.dataset, job.dataset_id) == ("fresh", found.id)
        kinds = [item["kind"] for item in api.get("/api/v1/jobs?dataset=fresh").json()["items"]]
        assert "import" in kinds
        dry = finished(app, api.post(API, json=body(dataset="tried", dry_run=True)))
        assert (dry.dataset, dry.dataset_id) == ("tried", None)

    def test_a_dry_run_says_the_same_and_keeps_nothing(self, app, api, tree) -> None:
        dry = finished(app, api.post(API, json=body(dry_run=True))).result
        assert [item["name"] for item in api.get("/api/v1/datasets").json()["items"]] == [
            "broadcast", "static",
        ]  # fmt: skip
        done = finished(app, api.post(API, json=body())).result
        assert {**dry, "dry_run": False, "solve_job": done["solve_job"]} == done
        assert get_dataset(app.state.services.store, "fresh").policy == PAPER
        assert (dry["solve_job"], done["solve_job"]) == (None, ANY)

    @pytest.mark.parametrize("content", ["labels", "nothing"])
    def test_an_upload_from_which_no_frame_is_read_may_expire(
        self, app, api, tree, content: str
    ) -> None:
        packed = io.BytesIO()
        with zipfile.ZipFile(packed, "w") as archive:
            if content == "labels":
                (labels,) = tree.rglob("Labels-v3.json")
                archive.write(labels, labels.relative_to(tree))
        job = uploaded(app, api, packed.getvalue())
        assert job.state == ("done" if content == "labels" else "failed")
        (upload,) = api.get("/api/v1/uploads").json()["items"]
        assert not upload["kept"]
        assert api.delete(f"/api/v1/uploads/{upload['id']}").status_code == 204

    def test_an_upload_is_read_in_place_and_stays(self, app, api, tree, group) -> None:
        add_pictures(tree, group)
        packed = io.BytesIO()
        with zipfile.ZipFile(packed, "w") as archive:
            for path in [*tree.rglob("*.json"), *tree.rglob("*.png")]:
                archive.write(path, path.relative_to(tree))
        headers = {"Content-Type": "application/octet-stream"}
        upload = api.post(
            "/api/v1/uploads", params={"name": "m.zip"}, content=packed.getvalue(), headers=headers
        ).json()
        source = {"upload": upload["id"]}
        job = finished(app, api.post(API, json=body(source=source)))
        assert job.result["new"] == 1
        services = app.state.services
        assert get_upload(services.settings, upload["id"]).kept
        with services.store.read() as session:
            sources = {e.body.get("source") for e in read_log(session) if e.kind == "import"}
        assert "m.zip" in sources

    def test_the_same_key_gives_the_same_job(self, app, api, tree) -> None:
        headers = {"Idempotency-Key": "once"}
        first = api.post(API, json=body(), headers=headers)
        again = api.post(API, json=body(), headers=headers)
        other = api.post(API, json=body(dataset="other"), headers=headers)
        assert first.json()["id"] == again.json()["id"]
        assert other.status_code == 422
        finished(app, first)
        later = api.post(API, json=body(), headers=headers)
        assert later.json()["id"] == first.json()["id"]
        assert len(app.state.services.jobs.find(kinds=["import"])) == 1

    @pytest.mark.parametrize(
        ("changes", "status"),
        [
            ({"source": {"folder": "nowhere"}}, 404),
            ({"source": {"folder": "data/../x"}}, 400),
            ({"source": {"upload": "a" * 32}}, 404),
            ({"source": {"upload": "../../etc"}}, 422),
            ({"source": {}}, 422),
            ({"source": {"folder": "data", "upload": "a" * 32}}, 422),
            ({"source": {"url": "http://169.254.169.254/"}}, 422),
            ({"format": "yolo"}, 422),
            ({"dataset": "a/b"}, 400),
            ({"options": {"size": [0, 5]}}, 422),
            ({"options": {"calibration": "guess"}}, 422),
            ({"options": {"lines": {"folder": "nowhere"}}, "format": "issia"}, 404),
            ({"options": {"size": [960, 540]}}, 400),
            ({"options": {"calibration": "lines"}}, 400),
            ({"options": {"flipped": [2]}}, 400),
            ({"options": {"frame_offset": 9}, "format": "issia-3d"}, 400),
            ({"format": "cameras", "policy": "strict"}, 400),
        ],
    )
    def test_an_impossible_import_is_refused_before_a_job_starts(
        self, app, api, tree, changes, status
    ) -> None:
        answer = api.post(API, json=body(**changes))
        assert answer.status_code == status, answer.text
        assert app.state.services.jobs.find(kinds=["import"]) == []

    def test_an_import_that_a_server_left_is_taken_up(self, app, api, tree) -> None:
        services = app.state.services
        request = {
            "dataset": "fresh", "format": "soccernet-v3", "source": {"folder": "data"},
            "lines": None, "options": {}, "dry_run": False,
        }  # fmt: skip
        with services.store.write() as session:
            identity = insert_job(session, NewJob("import", "Import", "ann", None, request))
            update_job(session, identity, state="running")
        resume_imports(services.jobs, services.store, services.settings)
        register_solve_resume(services.jobs, services.store)
        services.jobs.start()
        job = services.jobs.wait(identity, SECONDS)
        assert (job.state, job.result["new"]) == ("done", 1)

    def test_one_that_was_killed_when_all_was_read_asks_for_what_follows(
        self, app, api, tree, group
    ) -> None:
        add_pictures(tree, group)
        services = app.state.services
        request = finished(app, api.post(API, json=body())).request
        with services.store.write() as session:
            identity = insert_job(session, NewJob("import", "Import", "ann", None, request))
            update_job(session, identity, state="running", begun=1)
        resume_imports(services.jobs, services.store, services.settings)
        register_solve_resume(services.jobs, services.store)
        services.jobs.start()
        job = services.jobs.wait(identity, SECONDS)
        assert (job.result["new"], job.result["paint_job"] is not None) == (0, True)


class TestListImportFolders:
    def test_walks_what_the_operator_allows(self, api, tree) -> None:
        roots = api.get(f"{API}/folders").json()
        assert roots == {
            "path": "",
            "format": None,
            "items": [{"path": "data", "name": "data", "folder": True}],
            "more": False,
            "next": None,
        }
        inside = api.get(f"{API}/folders", params={"path": "data"}).json()
        assert [item["path"] for item in inside["items"]] == ["data/league"]
        assert inside["format"] == "soccernet-v3"

    @pytest.mark.parametrize("path", ["data/..", "..", "data/%2e%2e", "/etc", "data\\.."])
    def test_a_path_outside_the_allowed_folders_is_refused(self, api, tree, path: str) -> None:
        answer = api.get(f"{API}/folders", params={"path": path})
        assert answer.status_code == 400
        assert "/tmp" not in answer.text

    def test_without_allowed_folders_the_list_is_empty(self, api) -> None:
        assert api.get(f"{API}/folders").json()["items"] == []


class TestNestedFrames:
    @pytest.mark.parametrize("compression", [zipfile.ZIP_STORED, zipfile.ZIP_DEFLATED])
    def test_an_uploaded_tree_serves_the_pictures_of_its_inner_zip(
        self, app, api, tree, group: Group, compression: int
    ) -> None:
        picture = cv2.imencode(".png", np.full((72, 128, 3), 90, np.uint8))[1].tobytes()
        frames = io.BytesIO()
        with zipfile.ZipFile(frames, "w") as inner:
            for view in group.views:
                inner.writestr(view.key, picture)
        packed = io.BytesIO()
        with zipfile.ZipFile(packed, "w", compression) as archive:
            for path in tree.rglob("Labels-v3.json"):
                place = path.relative_to(tree)
                archive.write(path, place)
                archive.writestr(str(place.parent / "Frames-v3.zip"), frames.getvalue())
        job = uploaded(app, api, packed.getvalue())
        assert (job.state, job.result["outcome"]) == ("done", "complete")
        assert (job.result["without_picture"], job.result["skipped"]) == (0, [])
        (row,) = api.get("/api/v1/groups", params={"dataset": "fresh"}).json()["items"]
        assert row["pictures"] == 2
        for view in api.get(f"/api/v1/groups/{row['id']}").json()["views"]:
            answer = api.get(view["image"])
            assert (answer.status_code, answer.content) == (200, picture)
        assert api.get(row["thumbnail"]).headers["content-type"] == "image/jpeg"


class TestOutcome:
    def test_labels_alone_are_an_import_in_part(self, app, api, tree) -> None:
        job = finished(app, api.post(API, json=body()))
        assert (job.state, job.result["outcome"]) == ("done", "partial")
        assert job.result["without_picture"] == 1

    def test_an_import_that_reads_nothing_has_failed_and_says_why(self, app, api, tree) -> None:
        packed = io.BytesIO()
        with zipfile.ZipFile(packed, "w") as archive:
            archive.writestr("readme.txt", "nothing")
        job = uploaded(app, api, packed.getvalue())
        assert job.state == "failed"
        assert "nothing could be imported from m.zip as soccernet-v3" in job.problem["detail"]
        assert "Labels-v3.json" in job.problem["detail"]
        assert "docs/formats.md" in job.problem["hint"]
        assert (job.result["outcome"], job.result["read"]) == ("nothing", 0)
        assert "fresh" not in api.get("/api/v1/datasets").text

    def test_a_list_of_frames_that_is_none_is_called_by_its_own_name(self, app, api, tree) -> None:
        (tree / "list.json").write_text('{"x": 1}')
        asked = body(options={"frames": {"folder": "data/list.json"}})
        job = finished(app, api.post(API, json=asked))
        assert job.state == "failed"
        assert job.problem["detail"].startswith("data/list.json")
        assert str(tree) not in str(job.problem)

    def test_problems_of_a_list_of_frames_name_it_and_not_the_source(self, app, api, tree) -> None:
        (tree / "list.json").write_text('{"frames": [{"group": "a"}]}')
        asked = body(options={"frames": {"folder": "data/list.json"}})
        (skipped,) = finished(app, api.post(API, json=asked)).result["skipped"]
        assert (skipped["file"], skipped["record"]) == ("data/list.json", "frames/0")

    def test_another_format_that_it_looks_like_is_named(self, app, api, tree) -> None:
        job = finished(app, api.post(API, json=body(format="coco")))
        assert (job.state, "soccernet-v3" in job.problem["hint"]) == ("failed", True)
        assert str(tree) not in str((job.problem, job.result))

    def test_the_category_of_the_ball_is_named_for_coco(self, app, api, tree) -> None:
        value = {
            "images": [{"id": 1, "file_name": "a.jpg", "width": 1280, "height": 720}],
            "annotations": [{"id": 1, "image_id": 1, "category_id": 7, "bbox": [1, 2, 3, 4]}],
            "categories": [{"id": 7, "name": "thing"}],
        }
        (tree / "c").mkdir()
        (tree / "c/x.json").write_text(json.dumps(value))
        asked = body(format="coco", source={"folder": "data/c"}, dataset="things")
        job = finished(app, api.post(API, json=asked))
        assert [item["field"] for item in job.result["skipped"]] == ["categories"]
        job = finished(app, api.post(API, json=asked | {"options": {"ball_category": "Thing"}}))
        assert (job.result["skipped"], job.result["changed"]) == ([], 1)
        assert 'x.json: category "thing" is the ball (1 annotation)' in job.result["remarks"]
        assert str(tree) not in str(job.result)

    def test_a_dry_run_that_reads_nothing_fails_alike(self, app, api, tree) -> None:
        job = finished(app, api.post(API, json=body(format="coco", dry_run=True)))
        assert job.state == "failed"

    def test_importing_the_same_files_again_is_no_failure(self, app, api, tree) -> None:
        finished(app, api.post(API, json=body()))
        again = finished(app, api.post(API, json=body()))
        assert (again.state, again.result["unchanged"]) == ("done", 1)


def uploaded(app: Any, api: Any, content: bytes) -> Any:
    """The job that imports a file that is uploaded first."""
    headers = {"Content-Type": "application/octet-stream"}
    params = {"name": "m.zip"}
    sent = api.post("/api/v1/uploads", params=params, content=content, headers=headers).json()
    return finished(app, api.post(API, json=body(source={"upload": sent["id"]})))


class TestRig:
    def test_an_adjustment_of_static_cameras_is_proposed_once_and_changes_nothing(
        self, app, api, tmp_path: Path
    ) -> None:
        store = app.state.services.store
        root = tmp_path / "rig"
        root.mkdir()
        write_issia(root, [replace(group, match="issia") for group in groups(120)])
        object.__setattr__(app.state.services.settings, "import_folders", [root])
        wanted = {
            "dataset": "fresh",
            "format": "issia",
            "source": {"folder": "rig"},
            "options": {"size": [1280, 720]},
        }
        result = finished(app, api.post(API, json=wanted)).result
        proposed = app.state.services.jobs.wait(result["rig_job"], SECONDS)
        assert (proposed.state, proposed.kind) == ("done", "rig"), proposed.problem
        assert (proposed.result["accepted"], len(proposed.result["cameras"])) == (None, 4)
        with store.read() as session:
            given = [item.station for item in list_shared_stations(session, proposed.dataset_id)]
        assert all(station.given_covariance is None for station in given)
        assert finished(app, api.post(API, json=wanted)).result["rig_job"] is None
