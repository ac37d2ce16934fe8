"""Pitches of matches over HTTP."""

from __future__ import annotations

from typing import Any

import pytest

from tests.waiting import SECONDS

PITCHES = "/api/v1/datasets/broadcast/pitches"


@pytest.fixture
def match(api: Any) -> str:
    """The name of the dataset's match."""
    (item,) = api.get(PITCHES).json()["items"]
    return str(item["match"])


def patch(api: Any, body: Any, etag: str | None = None, **headers: str) -> Any:
    sent = {"If-Match": etag or api.get(PITCHES).headers["etag"], **headers}
    return api.patch(PITCHES, json=body, headers=sent)


class TestListPitches:
    def test_gives_the_size_in_use_and_says_when_none_is_estimated(self, api) -> None:
        answer = api.get(PITCHES)
        (item,) = answer.json()["items"]
        assert answer.headers["etag"] == answer.json()["etag"]
        assert (item["length"], item["width"], item["mixed"]) == (105.0, 68.0, False)
        assert (item["estimate"], item["proposed"], item["previous"]) == (None, None, None)

    def test_of_an_unknown_dataset_is_404(self, api) -> None:
        assert api.get("/api/v1/datasets/nothing/pitches").status_code == 404


class TestEstimatePitches:
    def test_what_is_not_estimated_yet_is_by_a_job(self, app, api) -> None:
        answer = api.post(PITCHES)
        job = answer.json()
        assert (answer.status_code, job["title"]) == (202, "Estimate the pitches of broadcast")
        assert app.state.services.jobs.wait(job["id"], SECONDS).state == "done"
        (item,) = api.get(PITCHES).json()["items"]
        assert item["estimate"]["length"] == pytest.approx(105.0, abs=0.2)
        assert api.post("/api/v1/datasets/nothing/pitches").status_code == 404


class TestSetPitch:
    def test_all_groups_get_it_and_are_solved_again_by_a_job(self, app, api, match) -> None:
        answer = patch(api, {"match": match, "length": 103.0, "width": 66.0})
        job = answer.json()
        assert answer.status_code == 202
        assert answer.headers["location"] == f"/api/v1/jobs/{job['id']}"
        (item,) = job["result"]["pitches"]["items"]
        assert (item["length"], item["width"]) == (103.0, 66.0)
        assert item["previous"] == {"length": 105.0, "width": 68.0}
        done = app.state.services.jobs.wait(job["id"], SECONDS)
        assert (done.state, done.result["solved"]) == ("done", item["groups"])
        group = api.get(f"/api/v1/groups/{item['group_id']}").json()
        assert group["pitch"] == {"length": 103.0, "width": 66.0}
        # The job estimates, too: the lines show the size that it was before.
        (item,) = api.get(PITCHES).json()["items"]
        assert item["estimate"]["length"] == pytest.approx(105.0, abs=0.2)
        assert item["proposed"]["length"] == pytest.approx(105.0, abs=0.2)

    def test_the_history_of_a_group_tells_the_size(self, api, match) -> None:
        patch(api, {"match": match, "length": 103.0, "width": 66.0})
        (item,) = api.get(PITCHES).json()["items"]
        *_, last = api.get(f"/api/v1/groups/{item['group_id']}/history").json()["items"]
        assert (last["kind"], last["body"]["edit"]["length"]) == ("pitch", 103.0)

    def test_an_older_state_is_412_with_the_present_one(self, api, match) -> None:
        etag = api.get(PITCHES).headers["etag"]
        body = {"match": match, "length": 103.0, "width": 66.0}
        assert patch(api, body, etag).status_code == 202
        answer = patch(api, {**body, "length": 100.0}, etag)
        assert answer.status_code == 412
        assert answer.json()["current"]["items"][0]["length"] == 103.0

    def test_the_same_request_is_carried_out_once(self, api, match) -> None:
        body, etag = {"match": match, "length": 103.0, "width": 66.0}, api.get(PITCHES)
        key = {"Idempotency-Key": "one"}
        first = patch(api, body, etag.headers["etag"], **key)
        assert patch(api, body, etag.headers["etag"], **key).content == first.content

    @pytest.mark.parametrize(
        ("body", "status"), [({"length": 300.0}, 422), ({"match": "nowhere"}, 404)]
    )
    def test_an_impossible_size_is_422_and_an_unknown_match_404(
        self, api, match, body, status
    ) -> None:
        whole = {"match": match, "length": 103.0, "width": 66.0, **body}
        assert patch(api, whole).status_code == status
