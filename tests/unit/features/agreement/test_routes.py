"""Agreement over HTTP, from two annotations to a decision."""

from __future__ import annotations

import csv
import io

import pytest

from app.features.independent_annotations.service import begin_annotation

DATASET = "/api/v1/datasets/broadcast"


def annotated(api, group: int, person: str, moved: float) -> None:
    """The annotation of a person who moves a ball and accepts."""
    take = begin_annotation(api.app.state.services.store, group, person=person)
    copy = api.get(f"/api/v1/groups/{take.group}").json()
    headers = {"If-Match": copy["etag"]}
    view = next(view for view in copy["views"] if view["balls"] and view["balls"][0]["box"])
    x, *rest = view["balls"][0]["box"]
    if moved:
        body = {"box": [x + moved, *rest]}
        edited = api.patch(f"/api/v1/views/{view['id']}/ball", json=body, headers=headers)
        headers["If-Match"] = edited.headers["etag"]
    body = {"state": "accepted", "note": "seen"}
    said = api.put(f"/api/v1/groups/{copy['id']}/verdict", json=body, headers=headers)
    assert said.status_code == 200, said.text


class TestAdjudication:
    def test_two_who_differ_are_decided_between(self, api) -> None:
        group = api.get("/api/v1/groups", params={"dataset": "broadcast"}).json()["items"][0]["id"]
        annotated(api, group, "ann", 0)
        annotated(api, group, "ben", 40)
        (waiting,) = api.get(f"{DATASET}/adjudications").json()["items"]
        assert (waiting["group"], waiting["people"]) == (group, ["ann", "ben"])
        case = api.get(f"/api/v1/groups/{group}/adjudication").json()
        (pair,) = case["comparison"]["pairs"]
        assert pair["distance"]["views"] and case["refused"] is None
        kinds = [item["kind"] for item in pair["disagreements"]]
        assert "ball_px" in kinds
        body = {"annotation": case["annotations"][1]["id"]}
        done = api.post(f"/api/v1/groups/{group}/adjudication", json=body)
        assert done.status_code == 200 and done.json()["verdict"]["by"] == "local"
        assert api.get(f"/api/v1/groups/{group}/adjudication").status_code == 404
        found = api.get(f"{DATASET}/agreement").json()
        assert (found["agreed"], found["open"], found["decided"]) == (0, 0, 1)
        assert found["groups"][0]["taken"] == "ben"
        (two,) = found["pairs"]
        assert two["spreads"]["ball_px"]["tail"] > 3
        table = api.get(f"{DATASET}/agreement/groups.csv").text
        (row,) = csv.DictReader(io.StringIO(table))
        spreads = found["groups"][0]["spreads"]
        for name, spread in spreads.items():
            for end in ("median", "tail"):
                told = row[f"{name}_{end}"]
                assert (float(told) if told else None) == pytest.approx(spread[end]), name
        assert any(spread["median"] != spread["tail"] for spread in spreads.values())
        assert api.get(f"{DATASET}/agreement", params={"of_batch": 7}).json()["groups"] == []

    def test_two_who_agree_without_a_verdict_leave_the_group_unreviewed_and_every_list_says_so(
        self, api
    ) -> None:
        group = api.get("/api/v1/groups", params={"dataset": "broadcast"}).json()["items"][0]["id"]
        for person in ("ann", "ben"):
            take = begin_annotation(api.app.state.services.store, group, person=person)
            assert api.post(f"/api/v1/groups/{take.group}/submission").is_success
        (one,) = api.get(f"{DATASET}/agreement").json()["groups"]
        assert (one["state"], one["status"]) == ("agreed", "unreviewed")
        found = api.get(
            "/api/v1/groups",
            params={"dataset": "broadcast", "q": "annotations:agreed status:unreviewed"},
        ).json()["items"]
        assert [row["id"] for row in found] == [group]

    def test_limits_are_changed_and_wrong_ones_refused(self, api) -> None:
        limits = api.get(f"{DATASET}/agreement").json()["limits"]
        changed = {**limits, "line_px": 8.0}
        assert api.put(f"{DATASET}/agreement/limits", json=changed).json() == changed
        assert api.get(f"{DATASET}/agreement").json()["limits"] == changed
        wrong = {**limits, "jac": 2}
        assert api.put(f"{DATASET}/agreement/limits", json=wrong).status_code == 422
