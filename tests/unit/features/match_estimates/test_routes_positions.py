"""Shared positions of matches over HTTP."""

from __future__ import annotations

from typing import Any

import pytest

from app.errors import OverloadedError
from app.http import idempotency
from tests.waiting import SECONDS

POSITIONS = "/api/v1/datasets/broadcast/positions"
POLICY = "/api/v1/datasets/broadcast/policy"


@pytest.fixture
def match(api: Any) -> str:
    """The name of the dataset's match."""
    (item,) = api.get(POSITIONS).json()["items"]
    return str(item["match"])


@pytest.fixture
def sharing(app: Any, api: Any) -> None:
    """The dataset's policy uses shared positions."""
    body = {"values": {"calibration.share_position": True}}
    answer = api.put(POLICY, json=body, headers={"If-Match": api.get(POLICY).headers["etag"]})
    app.state.services.jobs.wait(answer.json()["id"], SECONDS)


def test_before_it_is_shared_no_picture_uses_it(api) -> None:
    answer = api.get(POSITIONS).json()
    (item,) = answer["items"]
    assert (answer["used"], item["shared"], item["current"], item["mean"]) == (False, 0, None, None)
    assert "none of" in item["sentence"]


def test_where_the_policy_does_not_use_it_it_is_refused(api) -> None:
    answer = api.post(POSITIONS, json={})
    assert answer.status_code == 409
    assert "share_position" in answer.json()["hint"]


def test_it_is_shared_by_a_job_told_in_the_history_and_taken_back(app, api, sharing, match) -> None:
    answer = api.post(POSITIONS, json={"match": match})
    job = answer.json()
    assert (answer.status_code, job["kind"]) == (202, "positions")
    done = app.state.services.jobs.wait(job["id"], SECONDS)
    assert done.state == "done"
    (item,) = api.get(POSITIONS).json()["items"]
    assert (item["shared"], item["current"]) == (done.result["shared"], True)
    *_, last = api.get("/api/v1/groups/1/history").json()["items"]
    assert (last["kind"], last["body"]["edit"]["edit"]) == ("position", "set_positions")
    back = api.delete(POSITIONS, params={"match": match})
    assert (back.status_code, back.json()["kind"]) == (202, "solve")
    assert api.get(POSITIONS).json()["items"][0]["current"] is None


@pytest.mark.parametrize("method", ("post", "delete"))
def test_an_unknown_match_is_404(api, sharing, method) -> None:
    how = {"json": {"match": "nowhere"}} if method == "post" else {"params": {"match": "nowhere"}}
    assert getattr(api, method)(POSITIONS, **how).status_code == 404


def test_what_was_never_shared_cannot_be_taken_back(api, match) -> None:
    assert api.delete(POSITIONS, params={"match": match}).status_code == 409


@pytest.fixture
def shared(app: Any, api: Any, sharing: None, match: str) -> str:
    """The dataset's match, its position shared."""
    job = api.post(POSITIONS, json={"match": match}).json()
    app.state.services.jobs.wait(job["id"], SECONDS)
    return match


def test_a_take_back_that_is_sent_again_is_answered_as_the_first_time(
    api, shared, monkeypatch
) -> None:
    # As where the server stops between the work and its answer.
    monkeypatch.setattr(idempotency, "store_sent_response", lambda *_: None)
    how = {"params": {"match": shared}, "headers": {"Idempotency-Key": "one"}}
    first = api.delete(POSITIONS, **how)
    again = api.delete(POSITIONS, **how)
    assert (again.status_code, again.content) == (202, first.content)
    assert api.get(POSITIONS).json()["items"][0]["current"] is None


def test_a_second_take_back_is_refused(api, shared) -> None:
    assert api.delete(POSITIONS, params={"match": shared}).status_code == 202
    answer = api.delete(POSITIONS, params={"match": shared})
    assert (answer.status_code, "share no camera position" in answer.json()["detail"]) == (
        409,
        True,
    )


def test_where_solving_cannot_be_asked_for_nothing_is_taken_back(
    app, api, shared, monkeypatch
) -> None:
    def refuse(*_: Any, **__: Any) -> None:
        raise OverloadedError("no room")

    monkeypatch.setattr(app.state.services.jobs, "submit", refuse)
    assert api.delete(POSITIONS, params={"match": shared}).status_code == 503
    assert api.get(POSITIONS).json()["items"][0]["current"] is True
