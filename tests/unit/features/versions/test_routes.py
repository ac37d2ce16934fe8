from __future__ import annotations

import io
import json
import zipfile
from typing import Any

import pytest

from app.features.jobs.service import Jobs
from app.features.versions.freeze import FreezeRequest, freeze_dataset
from app.features.versions.jobs import register_version_jobs, request_freeze
from app.http.deps import Services

API = "/api/v1"


@pytest.fixture
def services(app) -> Services:
    return app.state.services


@pytest.fixture
def version(services: Services):
    request = FreezeRequest("v1", note="first", groups="passing")
    return freeze_dataset(services.store, "broadcast", request, actor="local")


def ended(services: Services, answer) -> dict[str, Any]:
    """The job that an answer started, once it is over."""
    assert answer.status_code == 202, answer.text
    assert answer.headers["location"] == f"{API}/jobs/{answer.json()['id']}"
    services.jobs.wait(answer.json()["id"], 60)
    return vars(services.jobs.get(answer.json()["id"]))


class TestFreezeVersion:
    @pytest.mark.usefixtures("wherever")
    def test_a_job_freezes_and_its_result_names_the_version(self, api, services) -> None:
        body = {"name": "v1", "groups": "passing", "split": {"kind": "given"}, "licence": "mine"}
        job = ended(services, api.post(f"{API}/datasets/broadcast/versions", json=body))
        assert job["state"] == "done", job
        document = api.get(f"{API}/versions/{job['result']['version']}").json()
        assert (document["name"], document["hash"]) == ("v1", job["result"]["hash"])
        assert (document["licence"], document["counts"]["groups"]) == ("mine", 3)

    def test_without_a_name_two_at_once_become_two_versions(self, api, services, version) -> None:
        address = f"{API}/datasets/broadcast/versions"
        bodies = ({"groups": "passing"}, {"groups": "passing", "name": None})
        answers = [api.post(address, json=body) for body in bodies]
        jobs = [ended(services, answer) for answer in answers]
        assert [job["result"]["name"] for job in jobs] == ["v2", "v3"]
        assert jobs[0]["title"] == "Freeze broadcast as the next version"

    def test_a_dry_run_counts_and_starts_nothing(self, api, services) -> None:
        body = {"name": "v1", "groups": "passing", "dry_run": True}
        answer = api.post(f"{API}/datasets/broadcast/versions", json=body)
        assert answer.status_code == 200
        assert answer.json() == {
            "groups": 3, "splits": {"train": 3}, "left_out": {}, "unsolved": 0, "tracks": 0,
            "stale_tracks": [], "views": {"train": 6}, "unknown_cameras": [],
        }  # fmt: skip
        assert services.jobs.find() == []

    def test_an_impossible_freeze_is_refused_before_a_job_starts(self, api, version) -> None:
        address = f"{API}/datasets/broadcast/versions"
        nothing = api.post(address, json={"name": "v2"})
        assert (nothing.status_code, "unreviewed" in nothing.json()["detail"]) == (400, True)
        assert api.post(address, json={"name": "v1", "groups": "passing"}).status_code == 409
        wrong = api.post(address, json={"name": "v2", "split": {"kind": "dice"}})
        assert (wrong.status_code, wrong.json()["pointer"]) == (422, "/split/kind")
        assert api.post(f"{API}/datasets/none/versions", json={"name": "v2"}).status_code == 404

    def test_a_server_that_starts_again_freezes_what_an_earlier_one_was_asked_for(
        self, services
    ) -> None:
        store = services.store
        earlier = Jobs(store)
        earlier.close()
        request = FreezeRequest("v1", groups="passing")
        job = request_freeze(earlier, store, "broadcast", request, actor="ann")
        later = Jobs(store)
        register_version_jobs(later, store)
        later.start()
        ended_job = later.wait(job.id, 60)
        later.close()
        assert (ended_job.state, ended_job.result["name"]) == ("done", "v1")

    @pytest.mark.parametrize("name", ["v1", None])
    def test_what_was_frozen_before_the_server_stopped_is_not_frozen_twice(
        self, services, name
    ) -> None:
        store, earlier = services.store, Jobs(services.store)
        earlier.close()
        request = FreezeRequest(name, groups="passing")
        first, second = (
            request_freeze(earlier, store, "broadcast", request, actor=actor)
            for actor in ("ann", "bob")
        )
        version = freeze_dataset(store, "broadcast", request, actor="ann")
        later = Jobs(store)
        register_version_jobs(later, store)
        later.start()
        ended = [later.wait(job.id, 60) for job in (first, second)]
        later.close()
        assert (ended[0].state, ended[0].result["version"]) == ("done", version.id)
        if name is None:
            assert ended[1].result["name"] == "v2"
        else:
            assert (ended[1].state, "a version" in ended[1].problem["detail"]) == ("failed", True)

    def test_a_name_that_a_waiting_job_was_asked_for_is_not_given_away(self, services) -> None:
        store, waiting = services.store, Jobs(services.store)
        waiting.close()
        asked = FreezeRequest("v1", groups="passing")
        request_freeze(waiting, store, "broadcast", asked, actor="ann")
        there = freeze_dataset(store, "broadcast", FreezeRequest(groups="passing"), actor="bob")
        assert there.name == "v2"


class TestVersions:
    def test_are_listed_newest_first(self, api, services, version) -> None:
        freeze_dataset(
            services.store, "broadcast", FreezeRequest("v2", groups="passing"), actor="local"
        )
        items = api.get(f"{API}/datasets/broadcast/versions").json()["items"]
        assert [item["name"] for item in items] == ["v2", "v1"]
        assert api.get(f"{API}/datasets/static/versions").json()["items"] == []

    def test_the_manifest_tells_where_it_comes_from(self, api, version) -> None:
        manifest = api.get(f"{API}/versions/{version.id}/manifest").json()
        assert manifest["frozen"]["hash"] == version.hash
        assert manifest["frozen"]["changelog"] == ["First version: 3 groups, 6 balls in views."]
        assert manifest["settings"]["policy"]["tau_percent"] == 1.0

    def test_changelog_and_diff_compare(self, api, services, version) -> None:
        second = freeze_dataset(
            services.store, "broadcast", FreezeRequest("v2", groups="passing"), actor="local"
        )
        lines = api.get(f"{API}/versions/{second.id}/changelog").json()["lines"]
        assert lines == ["Nothing changed since v1."]
        answer = api.get(f"{API}/versions/{second.id}/diff", params={"against": version.id})
        assert (answer.json()["same"], answer.json()["counts"]["unchanged"]) == (True, 3)

    def test_is_found_by_id_name_and_hash_wherever_one_is_asked_for(
        self, api, services, version
    ) -> None:
        second = freeze_dataset(
            services.store, "broadcast", FreezeRequest("v2", groups="passing"), actor="a"
        )
        by_id = api.get(f"{API}/versions/{second.id}").json()
        for name in ("v2", second.name):
            assert api.get(f"{API}/versions/{name}").json() == by_id
            assert api.get(f"{API}/versions/{name}/manifest").status_code == 200
            changes = api.get(f"{API}/versions/{name}/changelog").json()
            assert (changes["id"], changes["version"]) == (second.id, "v2")
        for older in (version.id, version.name):
            answer = api.get(f"{API}/versions/v2/diff", params={"against": older})
            assert answer.status_code == 200, answer.text
        assert ended(services, api.post(f"{API}/versions/v2/verify"))["state"] == "done"

    def test_a_name_of_several_datasets_asks_for_the_dataset(self, api, services, version) -> None:
        other = freeze_dataset(
            services.store, "static", FreezeRequest(version.name, groups="passing"), actor="a"
        )
        address = f"{API}/versions/{version.name}"
        refused = api.get(address)
        assert (refused.status_code, "broadcast" in refused.json()["detail"]) == (400, True)
        assert api.get(address, params={"dataset": "static"}).json()["id"] == other.id
        assert api.get(f"{API}/versions/{other.hash[:12]}").json()["id"] == other.id

    @pytest.mark.usefixtures("wherever")
    def test_verifying_is_a_job_that_reports(self, api, services, version) -> None:
        job = ended(services, api.post(f"{API}/versions/{version.id}/verify"))
        assert job["result"]["ok"], job
        assert job["result"]["groups"] == job["done"] == 3

    @pytest.mark.parametrize("route", ["", "/manifest", "/changelog", "/diff?against=1"])
    def test_an_unknown_version_is_404(self, api, route: str) -> None:
        assert api.get(f"{API}/versions/99{route}").status_code == 404


class TestExportOfAVersion:
    def test_holds_its_groups_as_they_were(self, api, services, version) -> None:
        body = {"dataset": "broadcast", "format": "cameras", "version": version.id}
        contents = []
        for _ in range(2):
            answer = api.post(f"{API}/exports", json=body)
            ended(services, answer)
            contents.append(api.get(answer.json()["content"]).content)
        assert contents[0] == contents[1]
        with zipfile.ZipFile(io.BytesIO(contents[0])) as archive:
            manifest = json.loads(archive.read("manifest.json"))
        assert (manifest["version"], manifest["date"]) == ("v1", version.created)

    def test_a_version_of_another_dataset_is_404(self, api, version) -> None:
        body = {"dataset": "static", "format": "cameras", "version": version.id}
        assert api.post(f"{API}/exports", json=body).status_code == 404
