"""Deleting a dataset over HTTP."""

from __future__ import annotations

PATH = "/api/v1/datasets/broadcast"


def delete(api, confirm: str, **params: object):
    return api.request("DELETE", PATH, params=params, json={"confirm": confirm})


class TestDeleteDataset:
    def test_says_what_would_go_and_then_it_goes(self, api) -> None:
        planned = delete(api, "", dry_run=True)
        assert (planned.status_code, planned.json()["dry_run"]) == (200, True)
        assert planned.json()["counts"]["groups"] == 3
        assert api.get(PATH).status_code == 200
        done = delete(api, "broadcast")
        assert done.json() == {**planned.json(), "dry_run": False}
        assert api.get(PATH).status_code == 404
        assert api.get("/api/v1/groups/1").status_code == 404
        assert api.get("/api/v1/groups/1/history").status_code == 404
        assert [item["name"] for item in api.get("/api/v1/datasets").json()["items"]] == ["static"]

    def test_another_name_is_409_and_deletes_nothing(self, api) -> None:
        answer = delete(api, "Broadcast")
        assert (answer.status_code, answer.json()["pointer"]) == (409, "/confirm")
        assert api.get(PATH).json()["groups"] == 3

    def test_its_yield_and_views_are_gone_too(self, api) -> None:
        saved = api.post(f"{PATH}/saved-views", json={"name": "All", "q": ""})
        api.get(f"{PATH}/yield")
        delete(api, "broadcast")
        assert api.get(f"{PATH}/yield").status_code == 404
        assert api.get(saved.headers["location"]).status_code == 404
