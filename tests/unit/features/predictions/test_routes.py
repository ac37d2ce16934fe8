from __future__ import annotations

import json
from typing import Any

import pytest

from app.errors import TooLargeError
from app.features.predictions.reader import LIMITS_HINT, PredictionReader
from app.formats.frame_names import frame_path_in_split
from app.soccer.frames import ImageSize
from app.soccer.group import Group, Station, View

API = "/api/v1"


@pytest.fixture
def emptied(api) -> dict[str, Any]:
    """The first group, its first view without a ball."""
    row = api.get(f"{API}/groups", params={"dataset": "broadcast"}).json()["items"][0]
    found = api.get(f"{API}/groups/{row['id']}").json()
    answer = api.patch(
        f"{API}/views/{found['views'][0]['id']}/ball",
        content="null",
        headers={"If-Match": found["etag"], "Content-Type": "application/json"},
    )
    assert answer.status_code == 200, answer.text
    return answer.json()


@pytest.fixture
def predicted(api, emptied, tmp_path) -> list[dict[str, Any]]:
    """What is predicted for the group: two balls in its first view, one in its second."""
    first, second = emptied["views"][:2]
    rows = [(first, 100, 0.4), (first, 600, 0.9), (second, 200, 0.7)]
    lines = [f"{name_of(emptied, view)},{x},300,14,14,{score}" for view, x, score in rows]
    content = "\n".join(["image,x,y,w,h,score", *lines]).encode()
    made = api.post(f"{API}/datasets/broadcast/predictions", json=uploaded(api, content))
    assert made.status_code == 201, made.text
    items: list[dict[str, Any]] = asked(api, emptied)["items"]
    return items


def uploaded(api, content: bytes) -> dict[str, Any]:
    """A request for what is uploaded now."""
    answer = api.post(
        f"{API}/uploads",
        params={"name": "p.csv"},
        content=content,
        headers={"Content-Type": "application/octet-stream"},
    )
    return {"name": "yolo", "format": "csv", "upload": answer.json()["id"]}


def name_of(emptied: dict[str, Any], view: dict[str, Any]) -> str:
    """What a YOLO export calls the frame: the groups of this dataset share all other names."""
    found = View(view["key"], Station(view["key"], ImageSize(1280, 720)))
    return frame_path_in_split(Group(emptied["key"], ()), found, "", ".jpg")


def asked(api, emptied: dict[str, Any]) -> dict[str, Any]:
    answer = api.get(f"{API}/groups/{emptied['id']}/predictions")
    assert answer.status_code == 200, answer.text
    found: dict[str, Any] = answer.json()
    return found


def accept(api, emptied: dict[str, Any], item: dict[str, Any], **query: Any):
    return api.post(
        f"{API}/views/{item['view']}/predictions/{item['id']}/accept",
        params=query,
        headers={"If-Match": emptied["etag"]},
    )


class TestAddPredictions:
    def test_what_goes_beyond_the_limits_of_reading_is_413_and_leaves_nothing(
        self, api, emptied, monkeypatch
    ) -> None:
        def beyond(*_: object) -> None:
            raise TooLargeError("p.csv needs more than 300 MiB of memory", hint=LIMITS_HINT)

        monkeypatch.setattr(PredictionReader, "read", beyond)
        answer = api.post(f"{API}/datasets/broadcast/predictions", json=uploaded(api, b"image"))
        assert (answer.status_code, answer.json()["hint"]) == (413, LIMITS_HINT)
        assert api.get(f"{API}/datasets/broadcast/predictions").json()["items"] == []

    def test_without_a_name_the_same_file_again_is_the_same_set(self, api, emptied) -> None:
        content = f"image,x,y,w,h,score\n{name_of(emptied, emptied['views'][0])},1,2,14,14,0.5"
        place = f"{API}/datasets/broadcast/predictions"
        body = {**uploaded(api, content.encode()), "name": None, "format": "auto"}
        first, again = (api.post(place, json=body) for _ in range(2))
        assert (first.status_code, again.status_code) == (201, 201)
        assert (first.json()["name"], first.json()["format"]) == ("p", "csv")
        assert again.json() == first.json()
        assert len(api.get(place).json()["items"]) == 1


class TestGroupPredictions:
    def test_all_views_are_answered_at_once(self, api, emptied, predicted) -> None:
        views = [view["id"] for view in emptied["views"]]
        assert [(item["view"], item["score"]) for item in predicted] == [
            (views[0], 0.9),
            (views[0], 0.4),
            (views[1], 0.7),
        ]
        assert {item["name"] for item in predicted} == {"yolo"}
        alone = api.get(f"{API}/views/{views[0]}/predictions").json()["items"]
        assert [item["id"] for item in alone] == [item["id"] for item in predicted[:2]]

    def test_a_dataset_without_prediction_sets_says_so(self, api, emptied) -> None:
        assert asked(api, emptied) == {
            "sets": 0,
            "items": [],
            "accepted": [],
            "next": None,
        }

    def test_an_accepted_ball_says_where_it_is_from(self, api, emptied, predicted) -> None:
        assert accept(api, emptied, predicted[0]).status_code == 200
        (ball,) = asked(api, emptied)["accepted"]
        assert (ball["view"], ball["name"], ball["score"]) == (predicted[0]["view"], "yolo", 0.9)
        assert ball["by"] and ball["at"]

    def test_an_unknown_group_is_404(self, api) -> None:
        assert api.get(f"{API}/groups/999/predictions").status_code == 404


class TestAccept:
    def test_answers_the_group_with_the_ball_that_was_named(self, api, emptied, predicted) -> None:
        answer = accept(api, emptied, predicted[1])
        assert answer.status_code == 200
        (ball,) = answer.json()["views"][0]["balls"]
        assert ball["box"] == predicted[1]["box"] == [100.0, 300.0, 14.0, 14.0]
        assert (ball["source"], ball["predicted_by"]) == ("prediction", "yolo")
        assert answer.headers["ETag"] == answer.json()["etag"]
        undone = api.post(
            f"{API}/groups/{emptied['id']}/undo", headers={"If-Match": answer.json()["etag"]}
        )
        assert undone.json()["views"][0]["balls"] == []

    def test_an_existing_ball_is_replaced_only_on_request(self, api, emptied, predicted) -> None:
        refused = accept(api, emptied, predicted[2])
        assert refused.status_code == 409
        assert "has a ball already" in refused.json()["detail"]
        assert "Delete that ball first" in refused.json()["hint"]
        answer = accept(api, emptied, predicted[2], replace=True)
        assert answer.json()["views"][1]["balls"][0]["predicted_by"] == "yolo"

    def test_an_accept_on_an_older_state_gets_the_present_one(
        self, api, emptied, predicted
    ) -> None:
        after = accept(api, emptied, predicted[0]).json()
        late = accept(api, emptied, predicted[1])
        assert late.status_code == 412
        assert late.json()["current"]["etag"] == after["etag"]

    @pytest.mark.parametrize("change", [{"id": 999}, {"view": 999}])
    def test_an_unknown_view_or_prediction_is_404(self, api, emptied, predicted, change) -> None:
        answer = accept(api, emptied, {**predicted[0], **change})
        assert answer.status_code == 404, json.dumps(answer.json())
