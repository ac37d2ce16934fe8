from __future__ import annotations

import json
import time
from typing import Any

import pytest

from app.formats.frame_names import frame_path_in_split
from app.soccer.frames import ImageSize
from app.soccer.group import Group, Station, View

API = "/api/v1"


@pytest.fixture
def running(app, client_of):
    """The application with its worker."""
    with client_of(app) as client:
        yield client


def upload(client, name: str, value: Any) -> str:
    content = value if isinstance(value, bytes) else json.dumps(value).encode()
    answer = client.post(
        f"{API}/uploads",
        params={"name": name},
        content=content,
        headers={"Content-Type": "application/octet-stream"},
    )
    assert answer.status_code == 201, answer.text
    return answer.json()["id"]


def views(client, dataset: str = "broadcast") -> list[dict[str, Any]]:
    """Every view with its group and its solved ball."""
    found = []
    for row in client.get(f"{API}/groups", params={"dataset": dataset}).json()["items"]:
        group = client.get(f"{API}/groups/{row['id']}").json()
        for view, solved in zip(group["views"], group["solution"]["views"], strict=True):
            found.append({"group": group, "view": view, "ball": solved["ball"]})
    return found


def name_of(group: str, view: str) -> str:
    """What a YOLO export calls the frame: the groups of this dataset share all other names."""
    found = View(view, Station(view, ImageSize(1280, 720)))
    return frame_path_in_split(Group(group, ()), found, "", ".jpg")


def results(client, factor: float = 1.0, score: float = 0.9) -> list[dict[str, Any]]:
    """The optimised box of every view, its size times a factor."""
    values = []
    for item in views(client):
        x, y, side, _ = item["ball"]["optimized_box"]
        more = side * (factor - 1) / 2
        name = name_of(item["group"]["key"], item["view"]["key"])
        # COCO counts from the corner of the first pixel.
        bbox = [x + 0.5 - more, y + 0.5 - more, side * factor, side * factor]
        values.append({"image_id": name, "category_id": 1, "bbox": bbox, "score": score})
    return values


def add(client, name: str, values: list[dict[str, Any]], **more: Any):
    body = {
        "name": name,
        "format": "coco",
        "upload": upload(client, f"{name}.json", values),
        **more,
    }
    return client.post(f"{API}/datasets/broadcast/predictions", json=body)


def wait(client, answer) -> dict[str, Any]:
    assert answer.status_code == 202, answer.text
    for _ in range(1200):
        job = client.get(answer.headers["Location"]).json()
        if job["state"] not in ("waiting", "running"):
            assert job["state"] == "done", job
            return job
        time.sleep(0.05)
    raise AssertionError(f"the job does not end: {job}")


def evaluate(client, **body: Any) -> int:
    answer = client.post(f"{API}/datasets/broadcast/evaluations", json=body)
    return wait(client, answer)["result"]["evaluation"]


@pytest.fixture
def exact(running) -> dict[str, Any]:
    """A set of predictions that is right."""
    answer = add(running, "exact", results(running))
    assert answer.status_code == 201, answer.text
    return answer.json()


class TestAddPredictions:
    def test_reads_an_upload_and_lists_frames_that_it_does_not_know(self, running) -> None:
        values = [*results(running), {**results(running)[0], "image_id": "99.png"}]
        answer = add(running, "yolo", values)
        body = answer.json()
        assert answer.status_code == 201
        assert (body["boxes"], body["unknown"]) == (6, 1)
        assert body["report"]["unknown_frames"][0]["frame"] == "99.png"
        assert running.get(answer.headers["Location"]).json() == body
        listed = running.get(f"{API}/datasets/broadcast/predictions").json()["items"]
        assert listed == [body]

    def test_problems_have_file_record_and_field(self, running) -> None:
        wrong = {**results(running)[0], "bbox": [1, 2, 3]}
        body = add(running, "yolo", [*results(running), wrong]).json()
        assert body["report"]["problems"] == [
            {"file": "yolo.json", "record": "result 6", "field": "bbox",
             "problem": "has 3 numbers, not 4"}
        ]  # fmt: skip

    def test_a_name_is_taken_once(self, running, exact) -> None:
        answer = add(running, "exact", results(running))
        assert answer.status_code == 409

    @pytest.mark.parametrize(
        ("change", "status"),
        [
            ({"upload": "0" * 32}, 404),
            ({"upload": None}, 422),
            ({"format": "xml"}, 422),
            ({"name": "../../x"}, 400),
            ({"size": [1280, 0]}, 422),
            ({"more": 1}, 422),
        ],
    )
    def test_an_impossible_upload_is_refused(self, running, change, status) -> None:
        body = {"name": "a", "upload": upload(running, "a.json", results(running)), **change}
        answer = running.post(f"{API}/datasets/broadcast/predictions", json=body)
        assert answer.status_code == status, answer.text

    def test_a_file_that_is_something_else_is_400_with_its_name(self, running) -> None:
        body = {"name": "a", "upload": upload(running, "notes.json", b"{]")}
        answer = running.post(f"{API}/datasets/broadcast/predictions", json=body)
        assert answer.status_code == 400
        assert "notes.json" in answer.json()["detail"]

    def test_no_group_changes(self, running, exact) -> None:
        for item in views(running):
            (ball,) = item["view"]["balls"]
            assert (ball["source"], ball["predicted_by"]) == ("dataset", None)

    def test_a_deleted_set_is_gone(self, running, exact) -> None:
        address = f"{API}/predictions/{exact['id']}"
        assert running.delete(address).status_code == 204
        assert running.get(address).status_code == 404
        assert running.delete(address).status_code == 404


class TestViewPredictions:
    def test_shows_what_was_predicted(self, running, exact) -> None:
        item = views(running)[0]
        found = running.get(f"{API}/views/{item['view']['id']}/predictions").json()["items"]
        assert [(row["name"], row["score"]) for row in found] == [("exact", 0.9)]
        assert found[0]["box"] == pytest.approx(item["ball"]["optimized_box"])
        assert running.get(f"{API}/views/9999/predictions").status_code == 404


class TestAccept:
    def test_a_dry_run_changes_nothing(self, running, exact) -> None:
        before = views(running)
        body = {"dataset": "broadcast", "predictions": exact["id"], "q": "", "dry_run": True}
        answer = running.post(f"{API}/predictions/accept", json=body).json()
        assert (answer["changed"], answer["refused"]) == (0, {"annotated": 6})
        assert views(running) == before

    def test_a_named_view_changes_at_once_and_says_its_source(self, running, exact) -> None:
        view = views(running)[0]["view"]
        body = {"dataset": "broadcast", "predictions": exact["id"], "views": [view["id"]]}
        answer = running.post(f"{API}/predictions/accept", json={**body, "replace": True})
        assert answer.status_code == 200
        assert answer.json()["changed"] == 1
        (ball,) = views(running)[0]["view"]["balls"]
        assert (ball["source"], ball["predicted_by"]) == ("prediction", "exact")

    @pytest.mark.usefixtures("wherever")
    def test_a_query_is_a_job_that_can_be_undone_group_by_group(self, running, exact) -> None:
        body = {"dataset": "broadcast", "predictions": exact["id"], "q": "number:2"}
        answer = running.post(f"{API}/predictions/accept", json={**body, "replace": True})
        assert wait(running, answer)["result"] == {"changed": 2, "groups": 1, "refused": {}}
        group = views(running)[2]["group"]
        undone = running.post(
            f"{API}/groups/{group['id']}/undo", headers={"If-Match": group["etag"]}
        )
        assert undone.json()["views"][1]["balls"][0]["source"] == "dataset"

    def test_a_person_who_moves_it_is_its_source(self, running, exact) -> None:
        item = views(running)[0]
        answer = running.patch(
            f"{API}/views/{item['view']['id']}/ball",
            json={"box": [600, 300, 12, 12]},
            headers={"If-Match": item["group"]["etag"]},
        )
        assert answer.json()["views"][0]["balls"][0]["source"] == "person"

    @pytest.mark.parametrize(
        ("change", "status"),
        [
            ({"views": [1], "q": ""}, 422),
            ({}, 422),
            ({"q": "no:field"}, 400),
            ({"q": "", "predictions": 999}, 404),
            ({"q": "", "dataset": "static"}, 404),
            ({"views": [9999]}, 404),
        ],
    )
    def test_an_impossible_request_is_refused(self, running, exact, change, status) -> None:
        body = {"dataset": "broadcast", "predictions": exact["id"], **change}
        assert running.post(f"{API}/predictions/accept", json=body).status_code == status


class TestEvaluations:
    @pytest.mark.usefixtures("wherever")
    def test_from_upload_to_tables_figures_and_frames(self, running, exact) -> None:
        number = evaluate(running, predictions=exact["id"], name="first")
        document = running.get(f"{API}/evaluations/{number}").json()
        assert document["headline"]["ap_50"]["value"] == 1
        assert document["headline"]["mae_m"]["of"] == document["counts"]["balls"] == 6
        assert document["pins"]["predictions"]["digest"] == exact["digest"]
        listed = running.get(f"{API}/datasets/broadcast/evaluations").json()["items"]
        assert [item["name"] for item in listed] == ["first"]
        for name in document["figures"]:
            address = f"{API}/evaluations/{number}/figures/{name}"
            assert running.get(f"{address}.json").json()["name"] == name
            assert running.get(f"{address}.csv").text.startswith("panel,series,kind,")
            assert running.get(f"{address}.png").content[:4] == b"\x89PNG"
        for table in document["tables"]:
            address = f"{API}/evaluations/{number}/tables/{table['name']}"
            assert running.get(f"{address}.json").json() == table
            lines = running.get(f"{address}.csv").text.splitlines()
            assert lines[0].startswith(f"row,{table['columns'][0]['name']},")
            assert len(lines) == 1 + len(table["rows"])
            for row in table["rows"]:
                if row["frames"] is None:
                    continue
                query = {name: value for name, value in row["frames"].items() if value is not None}
                page = running.get(f"{API}/evaluations/{number}/frames", params=query).json()
                assert page["total"] >= row["cells"][0]["count"] > 0

    def test_frames_come_in_pages(self, running, exact) -> None:
        number = evaluate(running, predictions=exact["id"])
        address = f"{API}/evaluations/{number}/frames"
        first = running.get(address, params={"limit": 4, "sort": "error_m-desc"}).json()
        rest = running.get(
            address, params={"limit": 4, "sort": "error_m-desc", "cursor": first["next"]}
        ).json()
        assert (len(first["items"]), len(rest["items"]), rest["next"]) == (4, 2, None)
        errors = [item["error_m"] for item in first["items"] + rest["items"]]
        assert errors == sorted(errors, reverse=True)
        for field, value, status in (
            ("cursor", "x", 400),
            ("limit", 0, 422),
            ("sort", "group", 422),
            ("field", "x", 422),
        ):
            assert running.get(address, params={field: value}).status_code == status, field

    def test_two_runs_are_compared(self, running, exact) -> None:
        loose = add(running, "loose", results(running, 1.25)).json()
        first, second = (evaluate(running, predictions=item["id"]) for item in (loose, exact))
        found = running.get(f"{API}/evaluations/{second}/compare", params={"with": first}).json()
        assert (found["first"]["id"], found["second"]["id"]) == (first, second)
        assert found["same_truth"] is True
        assert (found["better"], found["worse"]) == (6, 0)
        assert found["mean_change"] < -5

    def test_careful_boxes_alone_are_enough(self, running, exact) -> None:
        number = evaluate(running, careful=exact["id"])
        document = running.get(f"{API}/evaluations/{number}").json()
        assert [table["name"] for table in document["tables"]] == ["boxes", "sensitivity"]
        missing = running.get(f"{API}/evaluations/{number}/figures/jac.json")
        assert missing.status_code == 404
        tables = f"{API}/evaluations/{number}/tables"
        assert running.get(f"{tables}/detection.csv").status_code == 404
        assert running.get(f"{tables}/other.csv").status_code == 404

    def test_the_points_of_figures_open_what_they_count(self, running) -> None:
        loose = add(running, "loose", results(running, 1.1)).json()
        address = f"{API}/evaluations/{evaluate(running, predictions=loose['id'])}"
        for name in ("error_by_distance", "precision_recall", "precision_distance"):
            (panel,) = running.get(f"{address}/figures/{name}.json").json()["panels"]
            for series in panel["series"]:
                assert len(series["frames"]) == len(series["x"]) > 0
                # Groups of this dataset share their cameras: some frames are equally far.
                behind, count = series["frames"][-1], (series["count"] or [3])[-1]
                query = {name: value for name, value in behind.items() if value is not None}
                page = running.get(f"{address}/frames", params=query).json()
                assert page["total"] == count

    def test_a_deleted_one_is_gone(self, running, exact) -> None:
        number = evaluate(running, predictions=exact["id"])
        assert running.delete(f"{API}/evaluations/{number}").status_code == 204
        assert running.get(f"{API}/evaluations/{number}").status_code == 404

    @pytest.mark.parametrize(
        ("body", "status"),
        [
            ({}, 422),
            ({"predictions": 999}, 404),
            ({"predictions": "1"}, 422),
            ({"predictions": 1, "version": 999}, 404),
            ({"predictions": 1, "boxes": "round"}, 422),
        ],
    )
    def test_an_impossible_evaluation_is_refused_before_a_job_starts(
        self, running, exact, body, status
    ) -> None:
        answer = running.post(f"{API}/datasets/broadcast/evaluations", json=body)
        assert answer.status_code == status, answer.text
