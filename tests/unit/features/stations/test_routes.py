"""Static cameras over HTTP: one edit for all their views."""

from __future__ import annotations

import time
from typing import Any

import pytest

from tests.waiting import SECONDS

API = "/api/v1"


@pytest.fixture
def document(api) -> dict[str, Any]:
    """A group of two static cameras."""
    row = api.get(f"{API}/groups", params={"dataset": "static"}).json()["items"][1]
    return api.get(f"{API}/groups/{row['id']}").json()


def moved(lines: dict[str, Any]) -> dict[str, Any]:
    name = next(iter(lines))
    return {"lines": {name: [{"x": p["x"] + 2.0, "y": p["y"]} for p in lines[name]]}}


class TestStations:
    def test_lines_of_a_static_view_belong_to_its_station(self, api, document) -> None:
        view = document["views"][0]
        answer = api.patch(
            f"{API}/views/{view['id']}/lines",
            json=moved(view["lines"]),
            headers={"If-Match": document["etag"]},
        )
        assert answer.status_code == 409
        assert answer.json()["station"] == view["station"]["id"]
        assert f"static camera {view['station']['id']}" in answer.json()["hint"]

    def test_an_edit_of_a_station_is_seen_in_every_group(self, api, document) -> None:
        view = document["views"][0]
        station, body = view["station"], moved(view["lines"])
        answer = api.patch(
            f"{API}/stations/{station['id']}/lines",
            params={"group": document["id"]},
            json=body,
            headers={"If-Match": station["etag"]},
        )
        after = answer.json()
        assert (answer.status_code, after["id"]) == (200, document["id"])
        name = next(iter(body["lines"]))
        assert after["views"][0]["lines"][name] == body["lines"][name]
        assert after["views"][0]["station"]["etag"] != station["etag"]
        assert after["solution"] != document["solution"]
        rows = api.get(f"{API}/groups", params={"dataset": "static"}).json()["items"]
        for row in rows:
            other = api.get(f"{API}/groups/{row['id']}").json()
            assert other["views"][0]["lines"][name] == body["lines"][name]
            assert other["solution"]["views"][0] == after["solution"]["views"][0]

    def test_lines_that_were_proposed_say_so_until_they_are_undone(self, api, document) -> None:
        path = f"{API}/stations/{document['views'][0]['station']['id']}"
        body = moved(document["views"][0]["lines"])
        names = [*body["lines"]]
        tag = {"If-Match": api.get(path).headers["etag"]}
        answer = api.patch(f"{path}/lines", json={**body, "proposed": names}, headers=tag)
        assert answer.json()["views"][0]["proposed"] == names
        assert api.get(path).json()["proposed"] == names
        back = {"If-Match": api.get(path).headers["etag"]}
        assert api.post(f"{path}/undo", headers=back).json()["views"][0]["proposed"] == []

    def test_the_other_groups_are_solved_in_the_background(self, api, document) -> None:
        view = document["views"][0]
        api.patch(
            f"{API}/stations/{view['station']['id']}/lines",
            json=moved(view["lines"]),
            headers={"If-Match": view["station"]["etag"]},
        )
        deadline = time.monotonic() + SECONDS
        solved = 0
        while solved < 3 and time.monotonic() < deadline:
            time.sleep(0.05)
            solved = api.get(f"{API}/datasets/static").json()["solved"]
        assert solved == 3

    def test_a_station_can_be_read_undone_and_redone(self, api, document) -> None:
        view = document["views"][0]
        path = f"{API}/stations/{view['station']['id']}"
        before = api.get(path)
        assert before.headers["etag"] == before.json()["etag"] == view["station"]["etag"]
        assert (before.json()["groups"], before.json()["lines"]) == (3, view["lines"])
        for step, expected in (("lines", None), ("undo", view["lines"]), ("redo", None)):
            tag = {"If-Match": api.get(path).json()["etag"]}
            if step == "lines":
                answer = api.patch(f"{path}/lines", json=moved(view["lines"]), headers=tag)
            else:
                answer = api.post(f"{path}/{step}", headers=tag)
            assert answer.status_code == 200, answer.text
            assert (api.get(path).json()["lines"] == view["lines"]) == (expected is not None)

    def test_a_stale_edit_is_refused_with_the_present_group(self, api, document) -> None:
        station = document["views"][0]["station"]
        answer = api.patch(
            f"{API}/stations/{station['id']}",
            json={"calibration": "lines"},
            headers={"If-Match": '"old"'},
        )
        assert answer.status_code == 412
        assert answer.json()["current"]["views"][0]["station"]["etag"] == station["etag"]

    def test_which_calibration_counts_is_a_switch_of_the_station(self, api, document) -> None:
        station = document["views"][0]["station"]
        answer = api.patch(
            f"{API}/stations/{station['id']}",
            json={"calibration": "lines"},
            headers={"If-Match": station["etag"]},
        )
        assert answer.json()["views"][0]["station"]["calibration"] == "lines"

    def test_a_station_of_one_view_is_edited_there(self, api) -> None:
        row = api.get(f"{API}/groups", params={"dataset": "broadcast"}).json()["items"][0]
        station = api.get(f"{API}/groups/{row['id']}").json()["views"][0]["station"]
        answer = api.patch(
            f"{API}/stations/{station['id']}",
            json={"calibration": "lines"},
            headers={"If-Match": station["etag"]},
        )
        assert answer.status_code == 409

    def test_a_group_without_that_station_is_not_found(self, api, document) -> None:
        station = document["views"][0]["station"]
        answer = api.patch(
            f"{API}/stations/{station['id']}",
            params={"group": 10**6},
            json={"calibration": "lines"},
            headers={"If-Match": station["etag"]},
        )
        assert answer.status_code == 404
        rows = api.get(f"{API}/groups", params={"dataset": "broadcast"}).json()["items"]
        foreign = next(row["id"] for row in rows if row["id"] != document["id"])
        answer = api.patch(
            f"{API}/stations/{station['id']}",
            params={"group": foreign},
            json={"calibration": "lines"},
            headers={"If-Match": station["etag"]},
        )
        assert (answer.status_code, "no view in that group" in answer.text) == (404, True)
        assert api.get(f"{API}/stations/{10**6}").status_code == 404
