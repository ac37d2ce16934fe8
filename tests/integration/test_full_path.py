"""From files to a reviewed, exported dataset, over HTTP."""

from __future__ import annotations

import csv
import io
import json
import zipfile
from typing import Any

import httpx
import pytest

API = "/api/v1"


def first_group(client: httpx.Client) -> dict[str, Any]:
    page = client.get(f"{API}/groups", params={"dataset": "small", "limit": 1}).json()
    return client.get(f"{API}/groups/{page['items'][0]['id']}").json()


def moved(lines: list[dict[str, float]], by: float) -> list[dict[str, float]]:
    return [{"x": point["x"] + by, "y": point["y"]} for point in lines]


class TestFullPath:
    def test_the_server_lives_and_is_ready(self, client: httpx.Client) -> None:
        assert client.get("/healthz").json()["status"] == "ok"
        assert client.get("/readyz").json() == {"status": "ready"}
        assert "http_requests_total" in client.get("/metrics").text

    def test_the_datasets_tell_their_progress(self, client: httpx.Client) -> None:
        items = {item["name"]: item for item in client.get(f"{API}/datasets").json()["items"]}
        assert items["small"]["groups"] == items["small"]["solved"] == 4
        assert items["small"]["policy"]["name"] == "paper"
        by_name = client.get(f"{API}/datasets/small").json()
        assert by_name == client.get(f"{API}/datasets/{by_name['id']}").json()

    def test_a_list_goes_page_by_page_without_losing_anything(self, client: httpx.Client) -> None:
        query = {"dataset": "small", "q": "sort:sigma", "limit": 3}
        first = client.get(f"{API}/groups", params=query).json()
        rest = client.get(f"{API}/groups", params={**query, "cursor": first["next"]}).json()
        assert (len(first["items"]), len(rest["items"]), rest["next"]) == (3, 1, None)
        rows = first["items"] + rest["items"]
        assert first["total"] == rest["total"] == len({row["id"] for row in rows}) == 4
        assert [row["sigma_m"] for row in rows] == sorted(row["sigma_m"] for row in rows)

    def test_filters_are_those_of_the_browser(self, client: httpx.Client) -> None:
        def total(query: str) -> int:
            found = client.get(f"{API}/groups", params={"dataset": "small", "q": query})
            return found.json()["total"]

        assert total("passes:yes") == 4
        assert total("jac<0.1") == 0
        wrong = client.get(f"{API}/groups", params={"dataset": "small", "q": "jac<low"})
        assert wrong.status_code == 400
        assert wrong.json()["pointer"].startswith("/q")

    def test_a_summary_counts_what_matches(self, client: httpx.Client) -> None:
        summary = client.get(f"{API}/datasets/small/summary").json()
        assert summary["progress"]["groups"] == 4
        assert sum(summary["histograms"]["jac"]["counts"]) == 4
        assert len(summary["histograms"]["jac"]["counts"]) == 20

    def test_neighbours_stand_on_either_side(self, client: httpx.Client) -> None:
        group = first_group(client)
        found = client.get(f"{API}/groups/{group['id']}/neighbours").json()
        assert (found["index"], found["total"]) == (0, 4)
        assert (len(found["previous"]), len(found["next"])) == (0, 3)

    def test_a_frame_comes_in_the_width_that_is_asked_for(self, client: httpx.Client) -> None:
        view = first_group(client)["views"][0]
        small = client.get(view["image"], params={"width": 208})
        assert small.headers["content-type"] in ("image/jpeg", "image/webp", "image/png")
        assert small.headers["cache-control"].startswith("private, max-age")
        again = client.get(
            view["image"], params={"width": 208}, headers={"If-None-Match": small.headers["etag"]}
        )
        assert (again.status_code, again.content) == (304, b"")
        whole = client.get(view["image"])
        assert len(whole.content) > len(small.content)

    def test_an_edit_is_answered_with_the_new_solution_and_can_be_undone(
        self, client: httpx.Client
    ) -> None:
        group = first_group(client)
        view = group["views"][0]
        name = max(view["lines"], key=lambda marking: len(view["lines"][marking]))
        body = {"lines": {name: moved(view["lines"][name], 25.0)}}
        path, tag = f"{API}/views/{view['id']}/lines", {"If-Match": group["etag"]}
        edited = client.patch(path, json=body, headers=tag)
        document = edited.json()
        assert edited.status_code == 200
        assert edited.headers["etag"] == document["etag"] != group["etag"]
        assert document["revision"] == group["revision"] + 1
        assert document["views"][0]["lines"][name] == body["lines"][name]
        assert document["solution"] != group["solution"]

        stale = client.patch(path, json=body, headers=tag)
        problem = stale.json()
        assert stale.status_code == 412
        assert problem["current"]["etag"] == document["etag"] == stale.headers["etag"]
        assert problem["current"]["views"] == document["views"]

        undone = client.post(
            f"{API}/groups/{group['id']}/undo", headers={"If-Match": document["etag"]}
        ).json()
        assert undone["views"][0]["lines"] == view["lines"]
        assert undone["solution"] == group["solution"]
        assert (undone["can_undo"], undone["can_redo"]) == (False, True)
        redone = client.post(
            f"{API}/groups/{group['id']}/redo", headers={"If-Match": undone["etag"]}
        ).json()
        assert redone["views"][0]["lines"] == document["views"][0]["lines"]
        client.post(f"{API}/groups/{group['id']}/undo", headers={"If-Match": redone["etag"]})
        kinds = [
            e["kind"] for e in client.get(f"{API}/groups/{group['id']}/history").json()["items"]
        ]
        assert kinds[-4:] == ["edit", "undo", "redo", "undo"]

    def test_a_preview_saves_nothing(self, client: httpx.Client) -> None:
        group = first_group(client)
        changes = {"views": {group["views"][0]["key"]: {"included": False}}}
        answer = client.post(f"{API}/groups/{group['id']}/preview", json=changes)
        assert answer.json()["solution"]["passes"] is False
        assert first_group(client) == group

    def test_sent_twice_under_one_key_it_is_done_once(self, client: httpx.Client) -> None:
        group = first_group(client)
        headers = {"If-Match": group["etag"], "Idempotency-Key": "ball-of-view-0"}
        path = f"{API}/views/{group['views'][0]['id']}/ball"
        first = client.patch(path, json={"out_of_view": True}, headers=headers)
        second = client.patch(path, json={"out_of_view": True}, headers=headers)
        assert (first.status_code, second.json()) == (200, first.json())
        other = client.patch(path, json={"point": [1.0, 2.0]}, headers=headers)
        assert other.status_code == 422
        assert "Idempotency-Key" in other.json()["detail"]
        tag = {"If-Match": first.json()["etag"]}
        client.post(f"{API}/groups/{group['id']}/undo", headers=tag)

    def test_where_nothing_is_accepted_nothing_is_exported(self, client: httpx.Client) -> None:
        group = first_group(client)
        taken_back = client.put(
            f"{API}/groups/{group['id']}/verdict",
            json={"state": "unreviewed"},
            headers={"If-Match": group["etag"]},
        )
        assert taken_back.is_success, taken_back.text
        assert client.get(f"{API}/datasets/small").json()["accepted"] == 0
        order = {"dataset": "small", "format": "soccernet-v3d"}
        nothing = client.post(f"{API}/exports", json=order)
        assert (nothing.status_code, "nothing" in nothing.text) == (400, True)

    def test_accepted_groups_leave_as_a_zip_with_a_manifest(self, client: httpx.Client) -> None:
        order = {"dataset": "small", "format": "soccernet-v3d"}
        group = first_group(client)
        accepted = client.put(
            f"{API}/groups/{group['id']}/verdict",
            json={"state": "accepted"},
            headers={"If-Match": group["etag"]},
        )
        assert accepted.json()["verdict"]["state"] == "accepted"

        made = client.post(f"{API}/exports", json=order)
        export = made.json()
        assert made.status_code == 202, made.text
        assert made.headers["location"] == f"{API}/jobs/{export['id']}"
        # Asked for at once: it waits for the job.
        content = client.get(export["content"])
        assert client.get(made.headers["location"]).json()["state"] == "done"
        document = client.get(f"{API}/exports/{export['id']}").json()
        assert (document["status"], document["content"]) == ("ready", export["content"])
        assert document["counts"]["groups"] == 1
        assert content.headers["content-type"] == "application/zip"
        assert 'filename="touchline-soccernet-v3d-' in content.headers["content-disposition"]
        with zipfile.ZipFile(io.BytesIO(content.content)) as archive:
            names = archive.namelist()
            assert names == sorted(names)
            manifest = json.loads(archive.read("manifest.json"))
            rows = list(csv.DictReader(io.StringIO(archive.read("SNv3D.csv").decode("utf-8-sig"))))
            labels = f"{group['match']}/Labels-v3D.json"
            assert labels in names
        assert manifest["dataset"] == "small"
        assert len(rows) == len(group["views"])
        assert all("nan" not in value for row in rows for value in row.values() if value)

    def test_the_same_export_under_one_key_is_made_once(self, client: httpx.Client) -> None:
        order = {"dataset": "small", "format": "cameras", "all": True}
        headers = {"Idempotency-Key": "cameras-1"}
        first = client.post(f"{API}/exports", json=order, headers=headers)
        second = client.post(f"{API}/exports", json=order, headers=headers)
        assert first.json() == second.json()
        other = client.post(f"{API}/exports", json={**order, "all": False}, headers=headers)
        assert other.status_code == 422

    @pytest.mark.file_of_sqlite("several servers may work over one database of PostgreSQL")
    def test_a_second_server_over_the_same_home_is_refused(self, touchline, client) -> None:
        done = touchline("serve", "--port", "0")
        assert done.returncode == 1
        assert "another Touchline server" in done.stderr

    def test_the_command_line_works_beside_the_server(self, touchline, client, tree) -> None:
        done = touchline("import", "soccernet-v3", tree, "--dataset", "small", "--json")
        assert json.loads(done.stdout)["unchanged"] == 4
        assert json.loads(touchline("findings", "--dataset", "small", "--json").stdout) is not None


class TestFindings:
    def test_are_listed_by_group(self, client: httpx.Client) -> None:
        page = client.get(f"{API}/findings", params={"dataset": "small"}).json()
        assert page["total"] <= 4
        assert all(item["group_id"] for item in page["items"])

    @pytest.mark.parametrize("cursor", ["x", "-1", "9" * 19])
    def test_a_cursor_of_somebody_else_is_refused(self, client, cursor: str) -> None:
        found = client.get(f"{API}/findings", params={"dataset": "small", "cursor": cursor})
        assert found.status_code == 400
