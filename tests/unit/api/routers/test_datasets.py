"""Datasets over HTTP: what they are judged by."""

from __future__ import annotations

import time
from typing import Any

import pytest

from app.soccer.policy import PAPER, POLICIES, STRICT

API = "/api/v1"


def put(api, name: Any, dataset: str = "broadcast") -> Any:
    return api.put(f"{API}/datasets/{dataset}/policy", json={"name": name})


def wait_until_solved(api) -> None:
    deadline = time.monotonic() + 20
    while api.get(f"{API}/datasets/broadcast").json()["solved"] < 3:
        assert time.monotonic() < deadline, "nothing was solved in the background"
        time.sleep(0.05)


class TestPutPolicy:
    def test_answers_the_dataset_whose_groups_are_solved_again(self, api) -> None:
        answer = put(api, "strict")
        assert (answer.status_code, answer.json()["name"]) == (200, "broadcast")
        assert answer.json()["solved"] == 0
        policy = answer.json()["policy"]
        assert (policy["name"], policy["hash"]) == ("strict", STRICT.hash)
        assert policy["min_parallax_degrees"] == STRICT.min_parallax_degrees
        wait_until_solved(api)
        row = api.get(f"{API}/groups", params={"dataset": "broadcast"}).json()["items"][0]
        group = api.get(f"{API}/groups/{row['id']}").json()
        assert group["solution"]["policy_hash"] == STRICT.hash
        gates = {gate["name"]: gate["active"] for gate in group["solution"]["gates"]}
        assert gates["parallax"] and gates["sigma"]

    def test_a_kept_copy_of_a_group_is_out_of_date(self, api) -> None:
        row = api.get(f"{API}/groups", params={"dataset": "broadcast"}).json()["items"][0]
        path = f"{API}/groups/{row['id']}"
        kept = {"If-None-Match": api.get(path).headers["etag"]}
        assert api.get(path, headers=kept).status_code == 304
        put(api, "strict")
        assert api.get(path, headers=kept).json()["policy"]["name"] == "strict"

    def test_the_policy_that_it_has_changes_nothing(self, api) -> None:
        before = api.get(f"{API}/datasets/broadcast").json()
        assert before["policy"]["name"] == PAPER.name
        assert put(api, "paper").json() == before

    def test_every_named_policy_can_be_chosen(self, app) -> None:
        schema = app.openapi()["components"]["schemas"]["PolicyEdit"]
        assert set(schema["properties"]["name"]["enum"]) == set(POLICIES)

    @pytest.mark.parametrize("name", ["lenient", "STRICT", "", None, 1])
    def test_another_name_is_422_and_changes_nothing(self, api, name: Any) -> None:
        before = api.get(f"{API}/datasets/broadcast").json()
        assert put(api, name).status_code == 422
        assert api.get(f"{API}/datasets/broadcast").json() == before

    def test_thresholds_of_ones_own_are_422(self, api) -> None:
        body = {"name": "strict", "min_jac": 0.5}
        assert api.put(f"{API}/datasets/broadcast/policy", json=body).status_code == 422

    def test_a_dataset_that_is_not_there_is_404(self, api) -> None:
        assert put(api, "strict", "nothing").status_code == 404
