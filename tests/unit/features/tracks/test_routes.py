"""Tracks over HTTP."""

from __future__ import annotations

from typing import Any

import pytest

from app.features.imports.ingest import import_groups
from app.features.solutions.service import solve_dataset
from app.http.deps import Services
from tests.flights import FIRST, flight_groups
from tests.waiting import SECONDS

API = "/api/v1"
TRACKS = f"{API}/datasets/flight/tracks"


@pytest.fixture
def services(app: Any) -> Services:
    """The application's, with a dataset of a ball in flight."""
    services: Services = app.state.services
    import_groups(services.store, "flight", flight_groups(60), source="test", actor="ann")
    solve_dataset(services.store, "flight")
    return services


@pytest.fixture
def track(api: Any, services: Services) -> dict[str, Any]:
    """Its track."""
    answer = api.post(TRACKS, json={})
    assert answer.status_code == 202, answer.text
    job = services.jobs.wait(answer.json()["id"], SECONDS)
    assert (job.state, job.kind) == ("done", "ball"), job.problem
    assert job.sentence == "The ball was tracked over 1 stretch."
    (found,) = api.get(TRACKS).json()["items"]
    return dict(found)


class TestTracks:
    def test_are_made_by_a_job_and_listed(self, api, track) -> None:
        assert (track["key"], track["first"], track["last"]) == ("rig", FIRST, FIRST + 59)
        assert (track["stale"], track["verdict"], track["by"]) == (False, None, "local")
        assert track["summary"]["reason"] is None
        answer = api.get(f"{API}/tracks/{track['id']}")
        assert (track.pop("batches"), track.pop("assigned")) == ([], [])
        assert (answer.json(), answer.headers["etag"]) == (track, track["etag"])

    def test_are_listed_by_what_is_asked_for(self, api, track) -> None:
        def listed(**asked: Any) -> list[int]:
            return [item["id"] for item in api.get(TRACKS, params=asked).json()["items"]]

        assert listed(verdict="none", sort="worst") == [track["id"]]
        assert listed(verdict="accepted") == listed(stale=True) == listed(assigned="local") == []
        body = {"name": "all", "tracks": [track["id"]]}
        made = api.post(f"{API}/datasets/flight/batches", json=body).json()
        assert (made["kind"], made["groups"], made["waiting"]) == ("tracks", 1, 1)
        assert listed(assigned="local") == listed(batch=made["id"]) == [track["id"]]
        work = api.get(f"{API}/work").json()["items"]
        assert [(item["batch"]["id"], item["left"]) for item in work] == [(made["id"], 1)]

    def test_a_dataset_without_stretches_says_so(self, api, services) -> None:
        answer = api.post(f"{API}/datasets/broadcast/tracks", json={})
        job = services.jobs.wait(answer.json()["id"], SECONDS)
        assert "follow each other in time" in job.problem["detail"]

    def test_a_match_that_is_not_there_is_404(self, api, services) -> None:
        assert api.post(TRACKS, json={"match": "none"}).status_code == 404


class TestFrames:
    def test_come_in_columns_of_one_length(self, api, track) -> None:
        found = api.get(f"{API}/tracks/{track['id']}/frames").json()
        lists = {name: value for name, value in found.items() if isinstance(value, list)}
        columns = lists.keys() - {"events", "jumps", "contradicted"}
        assert {len(lists[name]) for name in columns} == {60}
        assert found["frame"] == list(range(FIRST, FIRST + 60))
        assert found["raw"][0] is not None
        group = api.get(f"{API}/groups/{found['group'][3]}").json()
        assert group["key"] == str(FIRST + 3)

    def test_a_part_of_them(self, api, track) -> None:
        part = {"first": FIRST + 10, "last": FIRST + 12}
        found = api.get(f"{API}/tracks/{track['id']}/frames", params=part).json()
        assert found["frame"] == [FIRST + 10, FIRST + 11, FIRST + 12]

    def test_around_one_as_groups_are_now(self, api, track) -> None:
        found = api.get(f"{API}/tracks/{track['id']}/around", params={"frame": FIRST + 30}).json()
        assert (found["frame"][0], found["frame"][-1]) == (FIRST + 5, FIRST + 55)
        assert found["reason"] is None
        assert found["x"][25] is not None
        refused = api.get(f"{API}/tracks/{track['id']}/around", params={"frame": 3})
        assert refused.status_code == 400

    def test_a_group_leads_to_its_track(self, api, track) -> None:
        group = api.get(f"{API}/tracks/{track['id']}/frames").json()["group"][4]
        (found,) = api.get(f"{API}/groups/{group}/tracks").json()["items"]
        assert (found["track"]["id"], found["frame"]) == (track["id"], FIRST + 4)

    def test_a_track_that_is_not_there_is_404(self, api) -> None:
        assert api.get(f"{API}/tracks/999/frames").status_code == 404


class TestChangeTrack:
    def test_is_accepted_under_its_etag(self, api, track) -> None:
        at = f"{API}/tracks/{track['id']}"
        body, etag = {"verdict": "accepted", "note": "good"}, {"If-Match": track["etag"]}
        assert api.patch(at, json=body).status_code == 428
        answer = api.patch(at, json=body, headers=etag)
        assert (answer.status_code, answer.json()["verdict"]) == (200, "accepted")
        assert answer.headers["etag"] == answer.json()["etag"] != track["etag"]
        refused = api.patch(at, json={"verdict": "rejected"}, headers=etag)
        assert refused.status_code == 412
        assert refused.json()["current"]["verdict"] == "accepted"

    def test_events_are_added_and_removed_by_frame(self, api, track) -> None:
        at = f"{API}/tracks/{track['id']}"
        wanted = [{"frame": FIRST + 44, "kind": "out", "added": True}]
        answer = api.patch(at, json={"corrections": wanted}, headers={"If-Match": track["etag"]})
        assert answer.json()["corrections"] == wanted
        events = api.get(f"{at}/frames").json()["events"]
        assert [item["frame"] for item in events if item["added"]] == [FIRST + 44]

    def test_a_frame_outside_of_it_is_named(self, api, track) -> None:
        wanted = [{"frame": 1, "kind": "out", "added": True}]
        answer = api.patch(
            f"{API}/tracks/{track['id']}",
            json={"corrections": wanted},
            headers={"If-Match": track["etag"]},
        )
        assert (answer.status_code, answer.json()["pointer"]) == (400, "/corrections/0/frame")
