"""A ball followed over HTTP and on the command line: proposed, accepted as an edit of many views, taken back."""

from __future__ import annotations

import json
from collections.abc import Callable
from contextlib import closing
from pathlib import Path
from typing import Any

import pytest

from app.config import Settings
from app.db.store import Store
from app.features.imports.ingest import import_groups
from app.features.solutions.service import solve_dataset
from app.http.deps import Services
from tests.filmed_rigs import filmed_groups
from tests.flights import FIRST

API, COUNT, CLICKED = "/api/v1", 6, 2
SOURCE = f"followed from {FIRST + CLICKED}"
Run = Callable[..., tuple[int, str, str]]


@pytest.fixture
def services(app: Any, tmp_path: Path) -> Services:
    """The application's, with a camera's film in the dataset *rolling*."""
    services: Services = app.state.services
    (tmp_path / "film").mkdir()
    groups = filmed_groups(tmp_path / "film", COUNT, "cam1", said=[FIRST + CLICKED])
    import_groups(services.store, "rolling", groups, source="test", actor="ann")
    solve_dataset(services.store, "rolling")
    return services


def views(api: Any) -> list[dict[str, Any]]:
    """The camera's view in each group, with the group's ETag."""
    found = []
    for row in api.get(f"{API}/groups", params={"dataset": "rolling"}).json()["items"]:
        group = api.get(f"{API}/groups/{row['id']}").json()
        (view,) = (view for view in group["views"] if view["key"] == "cam1")
        found.append({**view, "group": group["id"], "etag": group["etag"]})
    return found


class TestRoute:
    def test_it_is_proposed_accepted_and_undone(self, api: Any, services: Services) -> None:
        before = views(api)
        answer = api.post(f"{API}/views/{before[CLICKED]['id']}/ball/follow")
        assert answer.status_code == 200, answer.text
        found = answer.json()
        assert (found["group"], found["camera"]) == (str(FIRST + CLICKED), "cam1")
        assert (found["before"], found["after"], found["sized"]) == ("end", "end", True)
        others = [view for place, view in enumerate(before) if place != CLICKED]
        assert [item["view"] for item in found["items"]] == [view["id"] for view in others]
        assert [item["etag"] for item in found["items"]] == [view["etag"] for view in others]
        assert views(api) == before

        items = [
            {
                "view": item["view"],
                "etag": item["etag"],
                "ball": {"box": item["box"], "followed_from": found["group"]},
            }
            for item in found["items"]
        ]
        done = api.post(f"{API}/datasets/rolling/edits", json={"items": items}).json()
        assert (done["changed"], done["refused"]) == (COUNT - 1, 0)
        balls = [view["balls"][0] for view in views(api)]
        assert [ball["predicted_by"] for ball in balls] == [
            None if place == CLICKED else SOURCE for place in range(COUNT)
        ]
        assert {ball["source"] for ball in balls} == {"dataset", "prediction"}
        assert balls[0]["box"] == found["items"][0]["box"]

        one = views(api)[0]
        api.post(f"{API}/groups/{one['group']}/undo", headers={"If-Match": one["etag"]})
        assert views(api)[0]["balls"] == []

    def test_as_far_as_asked_from_where_somebody_says(self, api: Any, services: Services) -> None:
        view = views(api)[CLICKED]
        box = view["balls"][0]
        x, y = box["point"]
        path = f"{API}/views/{view['id']}/ball/follow"
        found = api.post(path, json={"at": [x + 1, y], "frames": 1}).json()
        assert [item["frame"] - FIRST for item in found["items"]] == [1, 3]
        assert api.post(path, json={"at": [5.0, 5.0]}).status_code == 400
        assert api.post(path, json={"frames": 251}).status_code == 422
        assert api.post(path, json={"way": 1}).status_code == 422

    def test_a_view_without_a_ball_says_so(self, api: Any, services: Services) -> None:
        answer = api.post(f"{API}/views/{views(api)[0]['id']}/ball/follow")
        assert answer.status_code == 400 and "has no ball" in answer.json()["detail"]
        assert api.post(f"{API}/views/999999/ball/follow").status_code == 404

    def test_a_ball_that_is_out_of_view_was_followed_from_nowhere(
        self, api: Any, services: Services
    ) -> None:
        one = views(api)[0]
        body = {"out_of_view": True, "followed_from": "102"}
        head = {"If-Match": one["etag"]}
        answer = api.patch(f"{API}/views/{one['id']}/ball", json=body, headers=head)
        assert answer.status_code == 422

    def test_a_ball_is_followed_from_a_group_that_its_dataset_has(
        self, api: Any, services: Services
    ) -> None:
        one = views(api)[0]
        ball = {"box": [10.0, 10.0, 8.0, 8.0], "followed_from": "of another dataset"}
        head = {"If-Match": one["etag"]}
        alone = api.patch(f"{API}/views/{one['id']}/ball", json=ball, headers=head)
        item = {"view": one["id"], "etag": one["etag"], "ball": ball}
        many = api.post(f"{API}/datasets/rolling/edits", json={"items": [item]})
        for answer, pointer in ((alone, ""), (many, "/items/0/ball")):
            assert answer.status_code == 400, answer.text
            assert answer.json()["pointer"] == f"{pointer}/followed_from"
            assert "which this dataset does not have" in answer.json()["detail"]
        assert views(api)[0]["balls"] == []


class TestCommand:
    @pytest.fixture
    def home(self, tmp_path: Path) -> Path:
        home = tmp_path / "home"
        (tmp_path / "film").mkdir()
        groups = filmed_groups(tmp_path / "film", COUNT, "cam1", said=[FIRST + CLICKED])
        with closing(Store.open(Settings(home=home))) as store:
            import_groups(store, "rolling", groups, source="test", actor="ann")
        return home

    def test_it_tells_places_and_takes_back(self, touchline: Run, home: Path) -> None:
        words = ("follow", str(FIRST + CLICKED), "cam1", "--dataset", "rolling")
        code, out, err = touchline(*words, "--json")
        told = json.loads(out)
        assert (code, told["placed"], told["before"]) == (0, None, "end"), err
        assert [item["state"] for item in told["items"]] == ["followed"] * (COUNT - 1)
        code, out, _ = touchline(*words, "--accept")
        assert code == 0 and "5 balls placed." in out and "there are no more groups" in out
        code, out, _ = touchline(*words)
        assert code == 0 and "0 views without a ball" in out and "has a ball already" in out
        code, out, _ = touchline(*words, "--undo", "--json")
        assert (code, json.loads(out)) == (0, {"taken_back": COUNT - 1, "refused": 0})

    def test_what_is_not_there_is_said(self, touchline: Run, home: Path) -> None:
        code, _, err = touchline("follow", "7", "cam1", "--dataset", "rolling")
        assert code == 1 and "no view cam1 in a group 7" in err
        words = ("follow", str(FIRST), "cam1", "--dataset", "rolling")
        code, _, err = touchline(*words)
        assert code == 1 and "has no ball" in err
        assert touchline(*words, "--at", "seven")[0] == 2
        assert touchline(*words, "--accept", "--undo")[0] == 2
