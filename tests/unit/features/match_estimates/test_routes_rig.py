from __future__ import annotations

from typing import Any

import pytest

from app.features.imports.ingest import import_groups
from app.http.deps import Services
from tests.rigs import groups

ADDRESS = "/api/v1/datasets/rig/rig"


@pytest.fixture
def services(app) -> Services:
    """The application's, with a dataset of four static cameras."""
    services: Services = app.state.services
    import_groups(services.store, "rig", groups(45), source="test", actor="ann")
    return services


def result(services: Services, answer) -> dict[str, Any]:
    """What came of the job that an answer started."""
    assert answer.status_code == 202, answer.text
    services.jobs.wait(answer.json()["id"], 60)
    return vars(services.jobs.get(answer.json()["id"]))


class TestRig:
    def test_is_proposed_accepted_as_it_was_seen_and_taken_back(self, api, services) -> None:
        proposed = result(services, api.post(ADDRESS, json={}))
        assert (proposed["state"], proposed["kind"]) == ("done", "rig")
        assert proposed["result"]["accepted"] is None
        assert len(proposed["result"]["cameras"]) == 4

        other = {"accept": "sigma", "inputs": "0" * 32}
        refused = result(services, api.post(ADDRESS, json=other))
        assert (refused["state"], refused["problem"]["detail"]) == (
            "failed",
            "balls, lines or cameras have changed since that proposal",
        )
        seen = {"accept": "sigma", "inputs": proposed["result"]["inputs"]}
        accepted = result(services, api.post(ADDRESS, json=seen))
        assert accepted["result"]["accepted"] == "sigma"
        solving = services.jobs.find(kinds=["solve"])
        assert [job.dataset for job in solving] == ["rig"]

        again = api.post(ADDRESS, json={})
        assert (again.status_code, "adjusted already" in again.json()["detail"]) == (409, True)
        key = {"Idempotency-Key": "back"}
        assert api.delete(ADDRESS, headers=key).json() == {"taken_back": 4}
        # The answer of the work, not a refusal because it is done.
        assert api.delete(ADDRESS, headers=key).json() == {"taken_back": 4}
        assert api.delete(ADDRESS).status_code == 409

    def test_a_dataset_without_static_cameras_is_refused(self, api) -> None:
        answer = api.post("/api/v1/datasets/broadcast/rig", json={})
        assert (answer.status_code, "0 static cameras" in answer.json()["detail"]) == (400, True)

    def test_nothing_is_accepted_that_nobody_saw(self, api, services) -> None:
        for body in ({"accept": "cameras"}, {"accept": "sigma", "inputs": None}):
            answer = api.post(ADDRESS, json=body)
            assert (answer.status_code, "inputs" in answer.json()["detail"]) == (422, True)
        assert services.jobs.find(kinds=["rig"]) == []

    def test_what_can_be_accepted_is_the_cameras_or_sigma_and_nothing_else(self, api) -> None:
        answer = api.post(ADDRESS, json={"accept": "everything"})
        assert (answer.status_code, answer.json()["pointer"]) == (422, "/accept")
