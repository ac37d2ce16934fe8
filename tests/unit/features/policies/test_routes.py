"""Policies over HTTP."""

from __future__ import annotations

from typing import Any

import pytest

from app.features.policies.service import policy_to_yaml
from app.soccer.policy import PAPER, STRICT
from tests.waiting import SECONDS

POLICY = "/api/v1/datasets/broadcast/policy"


def put(api: Any, body: Any, etag: str | None = None, **headers: str) -> Any:
    sent = {"If-Match": etag or api.get(POLICY).headers["etag"], **headers}
    return api.put(POLICY, json=body, headers=sent)


class TestListPolicies:
    def test_gives_what_is_shipped_and_what_can_be_set(self, api) -> None:
        body = api.get("/api/v1/policies").json()
        assert [item["name"] for item in body["items"]] == ["paper", "strict", "touchline"]
        assert body["items"][1]["values"]["max_sigma_m"] == 0.5
        fields = {field["name"]: field for field in body["fields"]}
        assert fields["tau_percent"] == {
            "name": "tau_percent",
            "label": "Largest reprojection error",
            "unit": "% of diagonal",
            "default": 1.0,
            "minimum": 0.05,
            "maximum": 5.0,
            "choices": [],
            "gate": "reprojection",
            "comparison": "at most",
            "optional": False,
        }
        assert fields["calibration.check_labels"]["default"] is True
        assert (fields["max_sigma_m"]["default"], fields["max_sigma_m"]["optional"]) == (None, True)


class TestGetPolicy:
    def test_gives_every_threshold_its_text_and_its_history(self, api) -> None:
        answer = api.get(POLICY)
        body = answer.json()
        assert answer.headers["etag"] == body["etag"]
        assert (body["name"], body["version"], body["hash"]) == ("paper", 1, PAPER.hash)
        assert body["values"]["calibration"]["check_labels"] is True
        assert body["yaml"] == policy_to_yaml(PAPER)
        (first,) = body["history"]
        assert (first["version"], first["name"], first["actor"]) == (1, "paper", "local")

    def test_of_an_unknown_dataset_is_404(self, api) -> None:
        assert api.get("/api/v1/datasets/nothing/policy").status_code == 404


class TestSetPolicy:
    def test_a_shipped_one_by_its_name_is_solved_by_a_job(self, app, api) -> None:
        answer = put(api, {"name": "strict"})
        job = answer.json()
        assert answer.status_code == 202
        assert answer.headers["location"] == f"/api/v1/jobs/{job['id']}"
        assert (job["kind"], job["dataset"]) == ("solve", "broadcast")
        assert job["result"]["policy"]["hash"] == STRICT.hash
        assert job["result"]["policy"]["etag"] == answer.headers["etag"]
        done = app.state.services.jobs.wait(job["id"], SECONDS)
        assert (done.state, done.result["solved"], done.total) == ("done", 3, 3)
        body = api.get("/api/v1/datasets/broadcast").json()
        assert (body["solved"], body["policy"]["name"]) == (3, "strict")
        assert [item["name"] for item in api.get(POLICY).json()["history"]] == ["paper", "strict"]

    def test_thresholds_build_on_the_policy_there_is(self, api) -> None:
        assert put(api, {"values": {"tau_percent": 0.5}}).status_code == 202
        body = {"name": "ours", "values": {"calibration": {"check_labels": False}}}
        assert put(api, body).status_code == 202
        found = api.get(POLICY).json()
        assert (found["name"], found["version"]) == ("ours", 3)
        assert found["values"]["tau_percent"] == 0.5
        assert found["values"]["calibration"]["check_labels"] is False
        assert [item["name"] for item in found["history"]] == ["paper", "custom", "ours"]

    def test_the_text_of_one_dataset_sets_another(self, api) -> None:
        put(api, {"name": "ours", "values": {"min_jac": 0.5, "max_sigma_m": 0.25}})
        text = api.get(POLICY).json()["yaml"]
        other = "/api/v1/datasets/static/policy"
        etag = api.get(other).headers["etag"]
        assert api.put(other, json={"yaml": text}, headers={"If-Match": etag}).status_code == 202
        assert api.get(other).json()["hash"] == api.get(POLICY).json()["hash"]

    def test_every_group_is_judged_by_it_and_a_kept_copy_is_out_of_date(self, app, api) -> None:
        path = "/api/v1/groups/1"
        kept = {"If-None-Match": api.get(path).headers["etag"]}
        assert api.get(path, headers=kept).status_code == 304
        job = put(api, {"name": "strict"}).json()
        app.state.services.jobs.wait(job["id"], SECONDS)
        group = api.get(path, headers=kept).json()
        assert group["solution"]["policy_hash"] == STRICT.hash
        gates = {gate["name"]: gate["active"] for gate in group["solution"]["gates"]}
        assert gates["parallax"] and gates["sigma"]

    def test_needs_if_match_and_refuses_a_change_of_an_older_policy(self, api) -> None:
        assert api.put(POLICY, json={"name": "strict"}).status_code == 428
        etag = api.get(POLICY).headers["etag"]
        put(api, {"name": "strict"}, etag)
        stale = put(api, {"name": "paper"}, etag)
        assert stale.status_code == 412
        assert stale.json()["current"]["name"] == "strict"
        assert stale.json()["current"]["etag"] == stale.headers["etag"]

    def test_a_name_that_does_not_exist_is_answered_with_the_nearest(self, api) -> None:
        answer = put(api, {"name": "strictt"}).json()
        assert "did you mean strict?" in answer["detail"]
        assert "there are paper, strict" in put(api, {"name": "mine"}).json()["detail"]

    def test_its_own_name_alone_changes_nothing(self, api) -> None:
        put(api, {"name": "ours", "values": {"tau_percent": 0.5}})
        assert put(api, {"name": "ours"}).status_code == 202
        assert api.get(POLICY).json()["version"] == 2

    @pytest.mark.parametrize(
        ("body", "pointer"),
        [
            ({"values": {"tau": 1}}, "/values/tau"),
            ({"values": {"tau_percent": "1"}}, "/values/tau_percent"),
            ({"values": {"tau_percent": 99}}, "/values/tau_percent"),
            ({"values": {"calibration": {"x": 1}}}, "/values/calibration/x"),
            ({"name": "paper", "values": {"tau_percent": 2}}, "/name"),
            ({"name": "<b>"}, "/name"),
            ({"name": "strictt"}, "/name"),
            ({"name": "strictt", "values": {}}, "/name"),
            ({"yaml": "tau: 1"}, "/yaml"),
            ({"yaml": "name: x", "name": "x"}, "/yaml"),
            ({}, None),
        ],
    )
    def test_an_impossible_policy_is_refused_with_its_place(self, api, body, pointer) -> None:
        answer = put(api, body)
        assert (answer.status_code, answer.json()["pointer"]) == (400, pointer)
        assert api.get(POLICY).json()["version"] == 1
