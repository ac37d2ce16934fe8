"""Practice over REST: made by a job, answered lesson by lesson, begun again, deleted."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np
import pytest
from sqlalchemy import update

from app.features.datasets.service import get_dataset
from app.features.datasets.tables import DatasetModel
from app.features.imports.ingest import ensure_dataset
from app.features.people.roles import Role
from app.features.practice.service import make_practice_dataset
from tests.security.apart import Apart, opened
from tests.waiting import SECONDS

Json = dict[str, Any]


@pytest.fixture(autouse=True)
def blank_frames(monkeypatch: pytest.MonkeyPatch) -> None:
    """What a frame looks like is the renderer's own test."""
    blank = np.zeros((720, 1280, 3), np.uint8)
    monkeypatch.setattr("app.features.practice.lessons.render_view", lambda _scene, _key: blank)


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


class TestTeam:
    """Where people log in: each has a practice of their own, and judges in it."""

    @pytest.fixture
    def apart(self, tmp_path) -> Iterator[Apart]:
        with opened(tmp_path) as made:
            made.add("admin", Role.ADMIN)
            made.add("ana", Role.ANNOTATOR)
            made.add("ben", Role.ANNOTATOR)
            made.add("cleo", Role.VIEWER)
            yield made

    def practise(self, apart: Apart, name: str, again: bool = False) -> Json:
        result: Json = apart.done(apart.ask(name, "POST", "/practice", {"again": again}))["result"]
        return result

    def judge(self, apart: Apart, name: str, group: int) -> int:
        etag = apart.ask(name, "GET", f"/groups/{group}").headers.get("etag", '"none"')
        at = f"/groups/{group}/verdict"
        answer = apart.ask(name, "PUT", at, {"state": "accepted"}, **{"If-Match": etag})
        return int(answer.status_code)

    def test_each_practises_alone(self, apart: Apart) -> None:
        """Annotators judge, in their own lessons only; whoever leads elsewhere sees none of it."""
        mine, theirs = self.practise(apart, "ana"), self.practise(apart, "ben")
        assert (mine["dataset"], theirs["dataset"]) == ("practice ana", "practice ben")
        assert self.judge(apart, "ana", mine["first"]) == 200
        assert self.judge(apart, "ana", theirs["first"]) == 404
        states = {
            name: [
                one["state"] for one in apart.ask(name, "GET", "/practice").json()["lessons"]
            ].count("right")
            for name in ("ana", "ben", "cleo", "admin")
        }
        assert states == {"ana": 1, "ben": 0, "cleo": 0, "admin": 0}
        listed = {
            name: [one["name"] for one in apart.ask(name, "GET", "/datasets").json()["items"]]
            for name in states
        }
        assert listed == {"ana": ["practice ana"], "ben": ["practice ben"], "cleo": [], "admin": []}
        assert apart.ask("ana", "GET", f"/groups/{mine['first']}/lesson").json()["state"] == "right"

        again = self.practise(apart, "ana", again=True)
        assert again["made"] is True
        assert self.judge(apart, "ana", again["first"]) == 200
        assert apart.ask("ben", "GET", f"/groups/{theirs['first']}").status_code == 200

    @pytest.mark.parametrize("filled", [False, True])
    def test_an_ordinary_dataset_of_that_name_is_left_alone(
        self, apart: Apart, filled: bool
    ) -> None:
        store = apart.store
        if filled:
            make_practice_dataset(store, store.settings, lambda *_: None, actor="local")
            with store.write() as session:
                mine = DatasetModel.name == "practice"
                session.execute(update(DatasetModel).where(mine).values(name="practice ana"))
        else:
            ensure_dataset(store, "practice ana", actor="local")
        before = get_dataset(store, "practice ana")
        answer = apart.ask("ana", "POST", "/practice", {"again": True})
        assert answer.status_code == 409
        assert answer.json()["detail"] == '"practice ana" is the name of an ordinary dataset'
        assert "rename or delete" in answer.json()["hint"]
        assert get_dataset(store, "practice ana") == before
        assert apart.ask("admin", "GET", "/practice").json()["lessons"] == []
        assert apart.ask("ana", "GET", "/practice").json()["lessons"] == []

    def test_it_gives_no_rights_elsewhere(self, apart: Apart) -> None:
        before = apart.ask("ana", "GET", "/session").json()
        self.practise(apart, "ana")
        after = apart.ask("ana", "GET", "/session").json()
        assert [(one["dataset"], one["role"]) for one in after["datasets"]] == [
            ("practice ana", "reviewer")
        ]
        assert (after["role"], after["may"]) == (before["role"], before["may"])
        people = apart.ask("admin", "GET", "/users").json()["items"]
        assert [one["datasets"] for one in people] == [[]] * len(people)
        assert apart.ask("cleo", "POST", "/practice", {}).status_code == 403
