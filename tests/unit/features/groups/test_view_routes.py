"""Views over HTTP: lines, ball, inclusion."""

from __future__ import annotations

import asyncio
import json
import zipfile
from dataclasses import replace
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest

from app.errors import OverloadedError
from app.features.groups.view_routes import (
    CLIENT_GONE,
    MAX_WIDTH,
    MIN_WIDTH,
    get_frames_around,
    round_up_and_clamp_width,
)
from app.features.imports.ingest import import_groups
from app.soccer.group import Media
from app.worker_pool import PoolTask

API = "/api/v1"


@pytest.fixture
def document(api) -> dict[str, Any]:
    """A group of two broadcast views."""
    row = api.get(f"{API}/groups", params={"dataset": "broadcast"}).json()["items"][0]
    return api.get(f"{API}/groups/{row['id']}").json()


def patch(api, document: dict[str, Any], what: str, body: Any, view: int = 0) -> Any:
    path = f"{API}/views/{document['views'][view]['id']}{what}"
    # json=None would send no body at all.
    headers = {"If-Match": document["etag"], "Content-Type": "application/json"}
    return api.patch(path, content=json.dumps(body), headers=headers)


class TestNotVisible:
    def test_a_marking_that_the_picture_does_not_show_is_not_missing_and_undo_takes_it_back(
        self, api, document
    ) -> None:
        fits = document["solution"]["views"][0]["calibration"]["markings"]
        name = min(document["views"][0]["lines"])
        gone = patch(api, document, "/lines", {"lines": {name: None}}).json()
        said = {"lines": {name: None}, "not_visible": [name]}
        after = patch(api, gone, "/lines", said).json()
        assert after["views"][0]["not_visible"] == [name]
        markings = after["solution"]["views"][0]["calibration"]["markings"]
        assert len(markings) == len(fits) - 1
        assert name not in {fit["marking"] for fit in markings}
        jac = [one["solution"]["views"][0]["calibration"]["jac"]["0.5"] for one in (gone, after)]
        assert jac[0] < jac[1] == 1.0
        headers = {"If-Match": after["etag"]}
        back = api.post(f"{API}/groups/{document['id']}/undo", headers=headers).json()
        assert back["views"][0]["not_visible"] == []
        again = api.get(f"{API}/groups/{document['id']}").json()
        assert again["solution"]["views"][0]["calibration"]["jac"]["0.5"] == jac[0]

    @pytest.mark.parametrize(
        "lines", [{}, {"Circle left": [{"x": 1.0, "y": 2.0}, {"x": 3.0, "y": 4.0}]}]
    )
    def test_what_has_points_or_is_not_named_is_refused(self, api, document, lines) -> None:
        body = {"lines": lines, "not_visible": ["Circle left"]}
        refused = patch(api, document, "/lines", body)
        assert refused.status_code in (400, 422)
        assert "contains Circle left, so Circle left must be null" in refused.text


class TestPicture:
    def test_its_lines_say_what_was_done_and_the_edit_is_undone_like_others(
        self, api, document
    ) -> None:
        before = document["solution"]["views"][0]["calibration"]["camera"]
        after = patch(api, document, "", {"picture": {}}).json()
        station = after["views"][0]["station"]
        assert station["picture"] == {"aspect": 1.0, "shift": [0, 0], "sigma": [0.3, 0.4, 0.4]}
        camera = after["solution"]["views"][0]["calibration"]["camera"]
        assert camera["x_focal_length"] != camera["y_focal_length"]
        back = api.post(
            f"{API}/groups/{document['id']}/undo", headers={"If-Match": after["etag"]}
        ).json()
        assert back["views"][0]["station"]["picture"] is None
        assert back["solution"]["views"][0]["calibration"]["camera"] == before

    def test_a_what_if_saves_nothing(self, api, document) -> None:
        key, group = document["views"][0]["key"], f"{API}/groups/{document['id']}"
        body = {"views": {key: {"picture": {"aspect": 1.25, "sigma": [0, 0, 0]}}}}
        camera = api.post(f"{group}/preview", json=body).json()["solution"]["views"][0]
        camera = camera["calibration"]["camera"]
        assert camera["x_focal_length"] == pytest.approx(1.25 * camera["y_focal_length"])
        assert api.get(group).json()["etag"] == document["etag"]

    @pytest.mark.parametrize(
        "body",
        [
            {"picture": {"aspect": 3.0}},
            {"picture": {"shift": [0.9, 0.0]}},
            {"picture": {"sigma": [0.0, -1.0, 0.0]}},
            {"picture": {"width": 1.0}},
            {"picture": {}, "included": True},
        ],
    )
    def test_what_no_picture_can_be_is_refused(self, api, document, body) -> None:
        assert patch(api, document, "", body).status_code == 422


class TestLines:
    def test_absent_markings_stay_and_null_deletes(self, api, document) -> None:
        lines = document["views"][0]["lines"]
        first, second, *_ = lines
        moved = [{"x": point["x"] + 1.0, "y": point["y"]} for point in lines[first]]
        after = patch(api, document, "/lines", {"lines": {first: moved, second: None}}).json()
        assert after["views"][0]["lines"] == {
            name: moved if name == first else points
            for name, points in lines.items()
            if name != second
        }
        assert after["can_undo"] is True

    def test_more_points_than_anybody_draws_are_refused_with_their_count(
        self, api, document
    ) -> None:
        points = [{"x": 1.0, "y": float(place)} for place in range(1001)]
        refused = patch(api, document, "/lines", {"lines": {"Middle line": points}})
        assert refused.status_code == 422
        key = document["views"][0]["key"]
        assert f"view {key}: Middle line has 1001 points" in refused.json()["detail"]

    def test_a_name_with_spaces_around_it_is_the_same_name(self, api, document) -> None:
        name = next(iter(document["views"][0]["lines"]))
        after = patch(api, document, "/lines", {"lines": {f"{name} ": None}}).json()
        assert name not in after["views"][0]["lines"]

    @pytest.mark.parametrize(
        "body",
        [
            {},
            {"lines": {"Middle line": [{"x": "1", "y": 2}]}},
            {"lines": {"Middle line": [{"x": True, "y": 2}]}},
            {"lines": {"Middle line": [{"x": 1e6 + 1, "y": 2}]}},
            {"lines": {"Middle line": [{"x": 1, "y": 2, "z": 3}]}},
            {"lines": {"Middle line": [[1, 2]]}},
            {"lines": {"Middle line": [{"x": 1, "y": 2}] * 1001}},
            {"lines": {"Line unknown": None}},
            {"lines": {"Middle line": None, "Middle line ": None}},
            {"lines": {}, "more": 1},
            {"lines": {"Middle line": [{"x": 10**400, "y": 2}]}},
        ],
        ids=str,
    )
    def test_a_body_of_another_shape_is_422_and_changes_nothing(self, api, document, body) -> None:
        assert patch(api, document, "/lines", body).status_code == 422
        assert api.get(f"{API}/groups/{document['id']}").json() == document


class TestBall:
    def test_a_box_replaces_the_ball(self, api, document) -> None:
        body = {"box": [600.25, 300.5, 12, 13], "occluded": True}
        after = patch(api, document, "/ball", body).json()
        assert after["views"][0]["balls"] == [
            {"box": [600.25, 300.5, 12.0, 13.0], "point": None, "occluded": True}
            | {"out_of_view": False, "source": "person", "predicted_by": None, "inferred": False}
        ]

    def test_a_point_is_a_ball_too(self, api, document) -> None:
        after = patch(api, document, "/ball", {"point": [600.5, 300.5]}).json()
        assert after["views"][0]["balls"][0]["point"] == [600.5, 300.5]

    def test_out_of_view_is_an_annotation_too(self, api, document) -> None:
        after = patch(api, document, "/ball", {"box": None, "out_of_view": True}).json()
        assert after["views"][0]["balls"] == [
            {"box": None, "point": None, "occluded": False, "out_of_view": True}
            | {"source": "person", "predicted_by": None, "inferred": False}
        ]

    @pytest.mark.parametrize(
        "body",
        [
            {"occluded": True},
            {"occluded": False},
            {"point": None},
            {"box": None},
            {"point": None, "occluded": False},
            {"out_of_view": False},
            {"box": [1, 2, 3, 4], "out_of_view": True},
            {"point": [1, 2], "out_of_view": True},
        ],
        ids=str,
    )
    def test_a_body_that_places_no_ball_or_contradicts_itself_deletes_no_ball(
        self, api, document, body
    ) -> None:
        assert patch(api, document, "/ball", body).status_code == 422
        what_if = {"views": {document["views"][0]["key"]: {"ball": body}}}
        group = f"{API}/groups/{document['id']}"
        assert api.post(f"{group}/preview", json=what_if).status_code == 422
        assert api.get(group).json() == document

    def test_the_body_null_deletes_the_ball(self, api, document) -> None:
        after = patch(api, document, "/ball", None).json()
        assert after["views"][0]["balls"] == []
        assert after["solution"]["ball"] is None

    @pytest.mark.parametrize(
        "body",
        [
            {},
            {"box": [1, 2, 3]},
            {"box": [1, 2, 0, 3]},
            {"box": [1, 2, -3, 3]},
            {"box": [1, 2, 3, 4], "point": [1, 2]},
            {"box": [1, 2, 3, "4"]},
            {"point": [1e9, 1]},
            {"out_of_view": "yes"},
            [1, 2, 3, 4],
        ],
        ids=str,
    )
    def test_a_body_of_another_shape_is_422(self, api, document, body) -> None:
        assert patch(api, document, "/ball", body).status_code == 422


class TestView:
    def test_a_view_can_be_left_out_and_taken_in_again(self, api, document) -> None:
        without = patch(api, document, "", {"included": False}).json()
        assert without["views"][0]["included"] is False
        assert without["solution"]["passes"] is False
        again = patch(api, without, "", {"included": True}).json()
        assert again["solution"]["passes"] is True

    def test_which_calibration_counts_can_be_switched(self, api, document) -> None:
        after = patch(api, document, "", {"calibration": "lines"}).json()
        assert after["views"][0]["station"]["calibration"] == "lines"

    @pytest.mark.parametrize(
        "body",
        [{}, {"included": None}, {"included": 1}, {"included": True, "calibration": "given"}],
    )
    def test_a_body_that_changes_two_things_is_refused(self, api, document, body) -> None:
        assert patch(api, document, "", body).status_code == 422


class TestPreconditions:
    def test_two_views_of_one_group_cannot_be_edited_past_each_other(self, api, document) -> None:
        assert patch(api, document, "/ball", None, view=0).status_code == 200
        late = patch(api, document, "/ball", None, view=1)
        assert late.status_code == 412
        assert late.json()["current"]["views"][0]["balls"] == []
        assert late.json()["current"]["views"][1]["balls"] != []

    def test_a_view_that_is_not_there_is_404(self, api) -> None:
        headers = {"If-Match": '"a"'}
        body = {"out_of_view": True}
        assert api.patch(f"{API}/views/999/ball", json=body, headers=headers).status_code == 404

    def test_labels_alone_have_no_frame(self, api, document) -> None:
        assert document["views"][0]["image"] is None
        answer = api.get(f"{API}/views/{document['views'][0]['id']}/image")
        assert answer.status_code == 404
        problem = answer.json()
        assert problem["detail"] == "this view has no readable frame"
        assert problem["hint"] == (
            "The report of the import gives the reason. Correct the files and import them again to attach "
            "the frames."
        )


class TestImage:
    @pytest.mark.parametrize(("query", "flipped"), [("", False), ("?width=16", False), ("", True)])
    def test_it_says_whether_it_is_sent_as_its_file_holds_it(
        self, app, api, tmp_path, group, query, flipped
    ) -> None:
        path = tmp_path / "7.png"
        cv2.imwrite(str(path), np.full((72, 128, 3), 90, dtype=np.uint8))
        view = group.views[0]
        station = replace(view.station, flipped=flipped)
        seen = replace(view, station=station, media=Media(str(path)))
        store = app.state.services.store
        import_groups(store, "framed", [group.with_view(seen)], source="test", actor="local")
        row = api.get(f"{API}/groups", params={"dataset": "framed"}).json()["items"][0]
        shown = api.get(f"{API}/groups/{row['id']}").json()["views"][0]
        answer = api.get(f"{API}/views/{shown['id']}/image{query}")
        as_stored = answer.headers.get("Touchline-As-Stored") == "true"
        assert as_stored is (answer.content == path.read_bytes()) is (not query and not flipped)

    @pytest.fixture
    def frames(self, app, tmp_path, group) -> Path:
        """A match's archive: its first frame is no image, its second is not there."""
        path = tmp_path / "Frames-v3.zip"
        with zipfile.ZipFile(path, "w") as archive:
            archive.writestr("7.png", b"GIF89a")
        views = tuple(replace(view, media=Media(str(path), view.key)) for view in group.views)
        store = app.state.services.store
        import_groups(store, "framed", [replace(group, views=views)], source="test", actor="local")
        return path

    @pytest.mark.parametrize("width", [None, 208])
    def test_what_is_no_image_is_named_with_its_view(self, api, frames, width) -> None:
        row = api.get(f"{API}/groups", params={"dataset": "framed"}).json()["items"][0]
        first, second = api.get(f"{API}/groups/{row['id']}").json()["views"]
        params = {} if width is None else {"width": width}
        answer = api.get(first["image"], params=params)
        assert (answer.status_code, answer.json()["detail"]) == (
            422,
            "view 7.png: frame 7.png of Frames-v3.zip is not a JPEG, PNG or WebP image",
        )
        missing = api.get(second["image"], params=params)
        assert (missing.status_code, missing.json()["detail"]) == (
            404,
            "view 7_1.png: Frames-v3.zip has no member 7_1.png",
        )
        assert str(frames.parent) not in answer.text + missing.text

    def test_a_frame_that_is_one_comes_with_its_type_and_etag(self, api, frames) -> None:
        picture = cv2.imencode(".png", np.full((90, 160, 3), 90, np.uint8))[1].tobytes()
        with zipfile.ZipFile(frames, "w") as archive:
            archive.writestr("7.png", picture)
        row = api.get(f"{API}/groups", params={"dataset": "framed"}).json()["items"][0]
        first = api.get(f"{API}/groups/{row['id']}").json()["views"][0]
        answer = api.get(first["image"])
        assert (answer.status_code, answer.headers["content-type"]) == (200, "image/png")
        assert answer.content == picture
        again = api.get(first["image"], headers={"If-None-Match": answer.headers["etag"]})
        assert again.status_code == 304

    def test_more_pictures_than_may_wait_are_503(self, app, api, frames, monkeypatch) -> None:
        def refuse(*_: object, **__: object) -> None:
            raise OverloadedError("68 requests for pictures already run or wait")

        monkeypatch.setattr(app.state.services.frames._pool, "submit", refuse)
        row = api.get(f"{API}/groups", params={"dataset": "framed"}).json()["items"][0]
        first = api.get(f"{API}/groups/{row['id']}").json()["views"][0]
        answer = api.get(first["image"])
        assert (answer.status_code, answer.headers["retry-after"]) == (503, "5")

    def test_frames_around_that_nobody_waits_for_are_given_up(
        self, app, api, frames, monkeypatch
    ) -> None:
        task = PoolTask(lambda error: error)
        monkeypatch.setattr(app.state.services.frames, "request_neighbours", lambda *_: task)
        row = api.get(f"{API}/groups", params={"dataset": "framed"}).json()["items"][0]
        view = api.get(f"{API}/groups/{row['id']}").json()["views"][0]["id"]

        class Gone:
            async def is_disconnected(self) -> bool:
                return True

        async def ask() -> int:
            answer = await get_frames_around(view, app.state.services, Gone())
            return answer.status_code

        assert asyncio.run(asyncio.wait_for(ask(), 20)) == CLIENT_GONE
        assert task.future.cancelled()


class TestClampWidth:
    def test_widths_are_rounded_up_to_few_sizes(self) -> None:
        assert {round_up_and_clamp_width(width) for width in range(200, 210)} == {208, 224}
        assert round_up_and_clamp_width(None) is None
        assert (round_up_and_clamp_width(1), round_up_and_clamp_width(10**5)) == (
            MIN_WIDTH,
            MAX_WIDTH,
        )
