"""Paint of views over HTTP: what a frame shows, lines that it proposes, and nothing saved."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest

from app.features.imports.ingest import import_groups
from app.soccer.group import Media
from app.soccer.pitch import Pitch
from tests.cameras import SIZE
from tests.unit.applications import lines_of
from tests.unit.paint.lawns import TRUE, drawn, lawn
from tests.waiting import SECONDS

API = "/api/v1"


CAMERA = TRUE.scaled(4 / 3, 4 / 3)
"""Of the annotated size; the picture is smaller."""


@pytest.fixture
def document(app, api, group, tmp_path: Path) -> dict[str, Any]:
    """A group whose frames show its markings; the second one has no file."""
    path = tmp_path / "7.png"
    assert cv2.imwrite(str(path), lawn(drawn(TRUE, 3))[:, :, ::-1])
    first, second = group.views
    station = replace(first.station, lines=lines_of(CAMERA))
    views = (replace(first, media=Media(str(path)), station=station), second)
    store = app.state.services.store
    import_groups(store, "painted", [replace(group, views=views)], source="test", actor="local")
    row = api.get(f"{API}/groups", params={"dataset": "painted"}).json()["items"][0]
    return api.get(f"{API}/groups/{row['id']}").json()


def ask(api, document: dict[str, Any], what: str, body: Any = None, view: int = 0) -> Any:
    return api.post(f"{API}/views/{document['views'][view]['id']}/{what}", json=body)


class TestPaint:
    def test_says_where_the_paint_is_and_saves_nothing(self, api, document) -> None:
        found = ask(api, document, "paint", {}).json()
        assert (found["outcome"], found["reason"], found["sentence"]) == ("snapped", None, "")
        assert found["supported"] > 0.9
        x, y, sigma = found["points"]["Side line right"][0]
        assert 0 <= x < SIZE.width and 0 <= y < SIZE.height and 0 < sigma < 1
        assert api.get(f"{API}/groups/{document['id']}").json()["etag"] == document["etag"]

    def test_lines_that_are_not_saved_count(self, api, document) -> None:
        gone = dict.fromkeys(document["views"][0]["lines"])
        found = ask(api, document, "paint", {"lines": gone}).json()
        assert found["outcome"] == "nothing" and found["points"] == {}
        assert found["line_like"]

    def test_a_view_without_a_frame_says_so_by_name(self, api, document) -> None:
        answer = ask(api, document, "paint", {}, view=1)
        assert answer.status_code == 404
        assert answer.json()["detail"].startswith("view 7_1.png: ")

    def test_a_marking_that_is_none_is_refused(self, api, document) -> None:
        answer = ask(api, document, "paint", {"lines": {"Halfway": []}})
        assert answer.status_code == 422
        assert "Halfway" in answer.text


class TestPropose:
    def test_lines_that_determine_no_camera_stay_and_choose_the_half(self, api, document) -> None:
        points = document["views"][0]["lines"]["Side line right"]
        gone = dict.fromkeys(document["views"][0]["lines"])
        few = {"lines": {**gone, "Side line left": points}}
        found = ask(api, document, "propose", few).json()
        assert (found["outcome"], found["sentence"]) == ("proposed", "")
        assert "Side line left" not in found["lines"] and "Big rect. left main" in found["lines"]
        assert ask(api, document, "propose", {"lines": {"Halfway": []}}).status_code == 422

    def test_lines_lie_where_the_view_s_own_lie(self, api, document) -> None:
        gone = dict.fromkeys(document["views"][0]["lines"])
        found = ask(api, document, "propose", {"lines": gone}).json()
        assert (found["outcome"], found["sentence"]) == ("proposed", "")
        curve = CAMERA.project(Pitch().sample("Side line right", 0.05, 0.05))
        for point in found["lines"]["Side line right"]:
            assert np.hypot(*(curve - (point["x"], point["y"])).T).min() < 1.5
        assert api.get(f"{API}/groups/{document['id']}").json()["etag"] == document["etag"]

    def test_lines_that_determine_a_camera_stay_too(self, api, document) -> None:
        one = "Big rect. right main"
        assert one in document["views"][0]["lines"]
        found = ask(api, document, "propose", {"lines": {one: None}}).json()
        assert (found["outcome"], [*found["lines"]]) == ("proposed", [one])

    def test_a_frame_that_is_gone_is_named(self, api, document, tmp_path: Path) -> None:
        (tmp_path / "7.png").unlink()
        answer = ask(api, document, "propose")
        assert answer.status_code == 404
        assert "7.png" in answer.json()["detail"]


class TestFollowing:
    def test_an_edit_of_lines_and_its_preview_stay_on_the_paint(self, app, api, document) -> None:
        jobs, policy = app.state.services.jobs, f"{API}/datasets/painted/policy"
        present = {"If-Match": api.get(policy).headers["etag"]}
        solving = api.put(policy, json={"name": "touchline"}, headers=present)
        jobs.wait(solving.json()["id"], SECONDS)
        read = api.post(f"{API}/datasets/painted/paint", json={})
        assert jobs.wait(read.json()["id"], SECONDS).state == "done"
        own = f"{API}/groups/{document['id']}"
        before = api.get(own)
        assert source(before.json()) == "paint"
        lines = {"Side line right": None}
        wanted = {"views": {"7.png": {"lines": lines}}}
        assert source(api.post(f"{own}/preview", json=wanted).json()) == "paint"
        view = document["views"][0]["id"]
        changed = api.patch(
            f"{API}/views/{view}/lines",
            json={"lines": lines},
            headers={"If-Match": before.headers["etag"]},
        )
        assert source(changed.json()) == "paint"
        back = api.post(f"{own}/undo", headers={"If-Match": changed.headers["etag"]})
        assert back.json()["solution"] == before.json()["solution"]


def source(answer: dict[str, Any]) -> str:
    """Of the first view's calibration."""
    found: str = answer["solution"]["views"][0]["calibration"]["source"]
    return found
