"""Over HTTP: why a view is left out, the frames around it, kept verifications, batches given again."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest

from app.features.imports.ingest import import_groups
from app.features.versions.freeze import FreezeRequest, freeze_dataset
from app.soccer.group import FARTHEST, Group, Media

API = "/api/v1"
DATASET = f"{API}/datasets/broadcast"


def first_group(api, dataset: str = "broadcast") -> dict[str, Any]:
    row = api.get(f"{API}/groups", params={"dataset": dataset}).json()["items"][0]
    return api.get(f"{API}/groups/{row['id']}").json()


def leave(api, document: dict[str, Any], **body: Any) -> Any:
    path = f"{API}/views/{document['views'][1]['id']}"
    return api.patch(path, json=body, headers={"If-Match": document["etag"]})


class TestReason:
    def test_it_is_in_the_group_and_undone_with_the_edit(self, api) -> None:
        body = {"included": False, "reason": "not_same_instant", "note": "a moment later"}
        after = leave(api, first_group(api), **body).json()
        view = after["views"][1]
        assert (view["included"], view["left_out"]) == (
            False,
            {"reason": "not_same_instant", "note": "a moment later"},
        )
        assert (after["views"][0]["left_out"], after["verdict"]["note"]) == (None, None)
        address = f"{API}/groups/{after['id']}"
        back = api.post(f"{address}/undo", headers={"If-Match": after["etag"]}).json()
        assert (back["views"][1]["included"], back["views"][1]["left_out"]) == (True, None)
        again = api.post(f"{address}/redo", headers={"If-Match": back["etag"]}).json()
        assert again["views"][1]["left_out"] == view["left_out"]
        entries = api.get(f"{address}/history").text
        assert "a moment later" in entries

    def test_leaving_a_view_out_needs_no_reason(self, api) -> None:
        after = leave(api, first_group(api), included=False).json()
        assert after["views"][1]["left_out"] is None

    @pytest.mark.parametrize(
        ("body", "status", "pointer"),
        [
            ({"included": False, "reason": "bored"}, 422, "/reason"),
            ({"included": False, "reason": "other"}, 400, "/note"),
            ({"included": False, "note": "why"}, 400, "/reason"),
            ({"included": True, "reason": "duplicate_view"}, 400, "/reason"),
            ({"calibration": "lines", "reason": "duplicate_view"}, 422, ""),
            ({"reason": "duplicate_view"}, 422, ""),
        ],
        ids=str,
    )
    def test_an_impossible_reason_changes_nothing(self, api, body, status, pointer) -> None:
        before = first_group(api)
        answer = leave(api, before, **body)
        assert (answer.status_code, answer.json()["pointer"] or "") == (status, pointer)
        assert first_group(api) == before


class TestNeighbours:
    @pytest.fixture
    def clip(self, app, tmp_path: Path, group: Group) -> dict[str, Any]:
        """A group whose first view has frames around it, its second one is none of a clip."""
        folder = tmp_path / "SNGS-001" / "img1"
        folder.mkdir(parents=True)
        for number in (9, 10, 11, 13):
            picture = np.full((90, 160, 3), 10 * number, np.uint8)
            cv2.imwrite(str(folder / f"{number:06d}.jpg"), picture)
        first, second, *_ = group.views
        views = (
            replace(first, media=Media(str(folder / "000010.jpg"))),
            replace(second, media=Media(str(folder.parent / "7.png"))),
        )
        store = app.state.services.store
        import_groups(store, "clip", [replace(group, views=views)], source="test", actor="local")
        return {}

    def test_lists_the_frames_that_there_are_with_their_addresses(self, api, clip) -> None:
        first, second = first_group(api, "clip")["views"]
        found = api.get(first["neighbours"]).json()
        assert [(item["offset"], item["label"]) for item in found["items"]] == [
            (-1, "1 frame before"),
            (1, "1 frame later"),
            (3, "3 frames later"),
        ]
        picture = api.get(found["items"][2]["image"])
        assert (picture.status_code, picture.headers["content-type"]) == (200, "image/jpeg")
        pixels = cv2.imdecode(np.frombuffer(picture.content, np.uint8), cv2.IMREAD_COLOR)
        assert abs(int(pixels.mean()) - 130) < 3
        assert second["neighbours"] is None
        none = api.get(f"{API}/views/{second['id']}/neighbours").json()
        assert none == {
            "items": [],
            "next": None,
            "sentence": "This dataset has no frames before or after this one.",
        }

    @pytest.mark.parametrize(("offset", "status"), [(2, 404), (FARTHEST + 1, 422), ("a", 422)])
    def test_a_frame_that_is_not_there_is_named(self, api, clip, offset, status) -> None:
        first, second = first_group(api, "clip")["views"]
        answer = api.get(first["image"], params={"offset": offset})
        assert answer.status_code == status
        if status == 404:
            assert answer.json()["detail"].endswith("there is no frame 2 frames later")
            other = api.get(second["image"], params={"offset": offset}).json()
            assert "no frames before or after" in other["detail"]


class TestVerified:
    def test_the_result_stays_with_the_version(self, api, app) -> None:
        services = app.state.services
        request = FreezeRequest("v1", groups="passing")
        version = freeze_dataset(services.store, "broadcast", request, actor="local")
        address = f"{API}/versions/{version.id}"
        assert api.get(address).json()["verified"] is None
        job = api.post(f"{address}/verify").json()
        services.jobs.wait(job["id"], 60)
        kept = api.get(address).json()["verified"]
        assert (kept["ok"], kept["equal"], kept["groups"], kept["differences"]) == (True, 3, 3, [])
        assert kept["sentence"] == "All 3 groups and the hash came out as they were frozen."
        assert api.get(f"{DATASET}/versions").json()["items"][0]["verified"] == kept


class TestRedoBatch:
    def test_gives_the_verdicts_again_as_a_new_batch(self, api) -> None:
        batch = api.post(f"{DATASET}/verdicts", json={"state": "deferred"}).json()["batch"]
        path = f"{API}/verdict-batches/{batch}/redo"
        assert api.post(path).status_code == 409
        api.post(f"{API}/verdict-batches/{batch}/undo")
        done = api.post(path).json()
        assert (done["changed"], done["kept"], done["refused"]) == (3, 0, [])
        newest, old = api.get(f"{DATASET}/verdict-batches").json()["items"]
        assert (newest["id"], old["redone"]) == (done["batch"], done["batch"])
        again = api.post(path)
        assert (again.status_code, json.loads(again.text)["detail"]) == (
            409,
            "the verdicts of this batch were redone already",
        )

    def test_an_unknown_batch_is_404(self, api) -> None:
        assert api.post(f"{API}/verdict-batches/7/redo").status_code == 404
