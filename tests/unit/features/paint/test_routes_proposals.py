"""Proposals over HTTP: looked for, shown with their scores, accepted as lines, forgotten."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import cv2
import pytest

from app.features.imports.ingest import import_groups
from app.soccer.group import Media
from app.soccer.pitch import Pitch
from tests.unit.paint.lawns import TRUE, drawn, lawn
from tests.waiting import SECONDS

API = "/api/v1"
PROPOSALS = f"{API}/datasets/bare/proposals"


@pytest.fixture
def group_id(app, api, group, tmp_path: Path) -> int:
    """A group without lines, of whose two views the first has a picture."""
    path = tmp_path / "7.png"
    assert cv2.imwrite(str(path), lawn(drawn(TRUE, 3))[:, :, ::-1])
    first, second = (
        replace(view, station=replace(view.station, lines={}, given=None)) for view in group.views
    )
    views = (replace(first, media=Media(str(path))), replace(second, media=None))
    store = app.state.services.store
    import_groups(store, "bare", [replace(group, views=views)], source="test", actor="local")
    found = api.get(f"{API}/groups", params={"dataset": "bare"}).json()["items"][0]["id"]
    assert isinstance(found, int)
    return found


def propose(app, api) -> dict[str, Any]:
    """Let the job run; its result."""
    asked = api.post(PROPOSALS, json={})
    assert asked.status_code == 202, asked.text
    job = app.state.services.jobs.wait(asked.json()["id"], SECONDS)
    assert job.state == "done"
    result: dict[str, Any] = job.result
    return result


def proposal(api, group_id: int) -> dict[str, Any]:
    (item,) = api.get(f"{API}/groups/{group_id}/proposals").json()["items"]
    assert isinstance(item, dict)
    return item


def test_it_is_counted_looked_for_accepted_and_forgotten(app, api, group_id: int) -> None:
    before = api.get(f"{API}/groups/{group_id}")
    plan = api.post(PROPOSALS, json={"dry_run": True})
    assert (plan.status_code, plan.json()) == (200, {"views": 1, "looked": 0})
    assert propose(app, api)["proposed"] == 1
    assert api.post(PROPOSALS, params={"dry_run": "true"}, json={}).json()["looked"] == 1
    (row,) = api.get(PROPOSALS).json()["items"]
    assert (row["views"], row["proposed"], row["accepted"]) == (1, 1, 0)
    # A prediction: the group is what it was.
    again = api.get(f"{API}/groups/{group_id}")
    assert again.headers["etag"] == before.headers["etag"]
    item = proposal(api, group_id)
    assert (item["open"], item["outcome"], item["key"]) == (True, "proposed", "7.png")
    assert item["supported"] > 0.9 and item["points"] > 100 and item["error_px"] < 1
    lines = item["lines"]
    changed = api.patch(
        f"{API}/views/{item['view']}/lines",
        json={"lines": lines, "proposed": [*lines]},
        headers={"If-Match": again.headers["etag"]},
    ).json()
    view = changed["views"][0]
    assert view["proposed"] == sorted(lines)
    assert changed["solution"]["views"][0]["calibration"]["camera"] is not None
    assert proposal(api, group_id)["open"] is False
    log = api.get(f"{API}/groups/{group_id}/history").json()["items"]
    edits = [entry for entry in log if entry["kind"] == "edit"]
    assert set(edits[-1]["body"]["edit"]["source"].values()) == {"proposed"}
    assert api.get(PROPOSALS).json()["items"][0]["accepted"] == 1
    assert api.delete(PROPOSALS).json() == {"forgotten": 1}
    assert api.get(f"{API}/groups/{group_id}/proposals").json() == {"items": [], "next": None}


def test_lines_that_were_not_proposed_have_no_source(api, group_id: int) -> None:
    group = api.get(f"{API}/groups/{group_id}")
    camera = TRUE.scaled(4 / 3, 4 / 3)
    curve = camera.project(Pitch().sample("Side line right", 1.0, 1.0))
    points = [{"x": float(x), "y": float(y)} for x, y in curve[[0, -1]]]
    changed = api.patch(
        f"{API}/views/{group.json()['views'][0]['id']}/lines",
        json={"lines": {"Side line right": points}},
        headers={"If-Match": group.headers["etag"]},
    ).json()
    assert changed["views"][0]["proposed"] == []


def test_unknown_matches_datasets_groups_and_markings_are_refused(api, group_id: int) -> None:
    assert api.post(PROPOSALS, json={"match": "final"}).status_code == 404
    assert api.post(f"{API}/datasets/none/proposals", json={}).status_code == 404
    assert api.get(f"{API}/groups/{group_id + 90}/proposals").status_code == 404
    group = api.get(f"{API}/groups/{group_id}")
    view = group.json()["views"][0]["id"]
    bad = api.patch(
        f"{API}/views/{view}/lines",
        json={"lines": {}, "proposed": ["Halfway"]},
        headers={"If-Match": group.headers["etag"]},
    )
    assert bad.status_code == 422 and "Halfway" in bad.text
