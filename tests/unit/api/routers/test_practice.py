"""Practice over REST: made by a job, answered lesson by lesson, begun again, deleted."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from sqlalchemy import update

from app.store.tables.groups import DatasetModel
from tests.waiting import SECONDS

Json = dict[str, Any]


@pytest.fixture(autouse=True)
def blank_frames(monkeypatch: pytest.MonkeyPatch) -> None:
    """What a frame looks like is the renderer's own test."""
    blank = np.zeros((720, 1280, 3), np.uint8)
    monkeypatch.setattr("app.sample.practice.render", lambda _scene, _key: blank)


def make(app, client, **body: object) -> Json:
    answer = client.post("/api/v1/practice", json=body)
    assert answer.status_code == 202, answer.text
    app.state.services.jobs.wait(answer.json()["id"], SECONDS)
    job: Json = client.get(answer.headers["Location"]).json()
    assert job["state"] == "done", job
    return job


def verdict(client, group: int, **body: object) -> None:
    etag = client.get(f"/api/v1/groups/{group}").headers["etag"]
    answer = client.put(f"/api/v1/groups/{group}/verdict", json=body, headers={"If-Match": etag})
    assert answer.status_code == 200, answer.text


def test_practice_from_its_making_to_its_end(app, api) -> None:
    client = api
    assert client.get("/api/v1/practice").json()["lessons"] == []
    before = client.get("/api/v1/datasets").json()["items"]
    job = make(app, client)
    assert job["kind"] == "practice"
    assert job["result"]["groups"] == 8

    lessons = client.get("/api/v1/practice").json()["lessons"]
    assert [lesson["number"] for lesson in lessons] == list(range(1, 9))
    assert {lesson["state"] for lesson in lessons} == {"open"}
    # Nothing is given away before the group is judged.
    assert all(lesson["feedback"] is None and lesson["best"] is None for lesson in lessons)

    first, second = lessons[0]["group"], lessons[1]["group"]
    assert first == job["result"]["first"]
    verdict(client, first, state="accepted")
    verdict(client, second, state="rejected", reason="bad_field_lines")
    assert client.get(f"/api/v1/groups/{first}/lesson").json()["state"] == "right"
    wrong = client.get(f"/api/v1/groups/{second}/lesson").json()
    assert wrong["state"] == "wrong"
    assert wrong["feedback"].startswith("Look again: ")
    assert wrong["best"]

    # Sent again it changes nothing; other datasets have nothing of it.
    assert make(app, client)["result"]["made"] is False
    assert client.get(f"/api/v1/groups/{first}/lesson").json()["state"] == "right"
    after = client.get("/api/v1/datasets").json()["items"]
    assert [item for item in after if item["name"] != "practice"] == before
    other = client.get("/api/v1/groups/1/lesson")
    assert other.status_code == 404

    again = make(app, client, again=True)["result"]
    assert again["made"] is True
    lessons = client.get("/api/v1/practice").json()["lessons"]
    assert {lesson["state"] for lesson in lessons} == {"open"}
    assert again["first"] == lessons[0]["group"]

    gone = client.request("DELETE", "/api/v1/datasets/practice", json={"confirm": "practice"})
    assert gone.status_code == 200
    assert client.get("/api/v1/practice").json()["lessons"] == []


def test_a_dataset_of_that_name_with_other_groups_is_left_alone(app, api) -> None:
    with app.state.services.store.write() as session:
        session.execute(update(DatasetModel).where(DatasetModel.id == 1).values(name="practice"))
    answer = api.post("/api/v1/practice", json={"again": True})
    assert answer.status_code == 409
    assert "groups of your own" in answer.json()["detail"]
    assert api.get("/api/v1/datasets/practice").json()["groups"] > 0
