"""Paint of a dataset's pictures over HTTP."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import pytest

from app.features.imports.ingest import import_groups
from app.soccer.group import Media
from tests.waiting import SECONDS

PAINT = "/api/v1/datasets/broadcast/paint"
POLICY = "/api/v1/datasets/broadcast/policy"


@pytest.fixture
def using(app: Any, api: Any) -> None:
    """The dataset's policy uses paint."""
    answer = api.put(
        POLICY, json={"name": "touchline"}, headers={"If-Match": api.get(POLICY).headers["etag"]}
    )
    app.state.services.jobs.wait(answer.json()["id"], SECONDS)


def test_before_it_is_read_nothing_is_known(api) -> None:
    answer = api.get(PAINT).json()
    assert (answer["used"], {item["read"] for item in answer["items"]}) == (False, {0})
    assert "none of" in answer["items"][0]["sentence"]


def test_where_the_policy_does_not_use_it_it_is_refused(api) -> None:
    answer = api.post(PAINT, json={})
    assert (answer.status_code, "touchline" in answer.json()["hint"]) == (409, True)


def test_an_unknown_match_is_404(api, using) -> None:
    assert api.post(PAINT, json={"match": "nowhere"}).status_code == 404


def test_it_is_read_by_a_job_told_in_the_history_and_taken_back(app, api, using, group) -> None:
    lost = (replace(view, media=Media(f"/gone/{view.key}")) for view in group.views)
    with_pictures = replace(group, views=tuple(lost))
    import_groups(
        app.state.services.store, "broadcast", [with_pictures], source="test", actor="ann"
    )
    job = api.post(PAINT, json={}).json()
    assert job["kind"] == "paint"
    done = app.state.services.jobs.wait(job["id"], SECONDS)
    assert done.state == "done"
    assert done.result["read"] == sum(item["read"] for item in api.get(PAINT).json()["items"]) > 0
    *_, last = api.get("/api/v1/groups/1/history").json()["items"]
    assert (last["kind"], last["body"]["edit"]["edit"]) == ("paint", "set_paint")
    back = api.delete(PAINT)
    assert (back.status_code, back.json()["kind"]) == (202, "solve")
    assert {item["read"] for item in api.get(PAINT).json()["items"]} == {0}


def test_what_was_never_read_cannot_be_taken_back(api) -> None:
    assert api.delete(PAINT).status_code == 409
