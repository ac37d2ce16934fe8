"""Saved views and reviewers over HTTP."""

from __future__ import annotations

import pytest

DATASET = "/api/v1/datasets/broadcast"


class TestSavedViews:
    def test_is_saved_listed_opened_and_deleted(self, api) -> None:
        body = {"name": "Train", "q": "split:train"}
        answer = api.post(f"{DATASET}/saved-views", json=body)
        assert answer.status_code == 201
        saved = answer.json()
        assert (saved["name"], saved["q"], saved["by"], saved["groups"]) == (
            *body.values(),
            "local",
            3,
        )
        assert api.get(answer.headers["location"]).json() == saved
        assert api.get(f"{DATASET}/saved-views").json() == {"items": [saved], "next": None}
        assert api.post(f"{DATASET}/saved-views", json=body).status_code == 409
        assert api.delete(answer.headers["location"]).json() == saved
        assert api.delete(answer.headers["location"]).status_code == 404
        assert api.get(f"{DATASET}/saved-views").json() == {"items": [], "next": None}

    @pytest.mark.parametrize(
        ("body", "status"),
        [({"name": "x", "q": "a:b"}, 400), ({"name": "", "q": ""}, 422), ({"q": ""}, 422)],
    )
    def test_an_impossible_view_is_refused(self, api, body, status: int) -> None:
        assert api.post(f"{DATASET}/saved-views", json=body).status_code == status


class TestListReviewers:
    def test_tells_who_judged_how_much(self, api) -> None:
        assert api.get(f"{DATASET}/reviewers").json() == {"items": [], "next": None}
        api.post(f"{DATASET}/verdicts", json={"state": "deferred"})
        (item,) = api.get(f"{DATASET}/reviewers").json()["items"]
        assert (item["name"], item["deferred"], item["today"]) == ("local", 3, 3)
