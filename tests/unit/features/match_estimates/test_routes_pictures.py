"""Pictures of matches over HTTP."""

from __future__ import annotations

import pytest

from tests.waiting import SECONDS

PICTURES = "/api/v1/datasets/broadcast/pictures"
WIDE = {"aspect": 1.04, "shift": [0.0, 0.0], "sigma": [0.01, 0.01, 0.01]}


class TestMatchPictures:
    def test_it_is_said_of_all_main_views_solved_and_taken_back(self, app, api) -> None:
        (item,) = api.get(PICTURES).json()["items"]
        assert (item["picture"], item["mixed"], item["frames"]) == (None, False, 3)
        for picture in (WIDE, None):
            answer = api.patch(PICTURES, json={"match": item["match"], "picture": picture})
            assert (answer.status_code, answer.json()["kind"]) == (202, "solve")
            done = app.state.services.jobs.wait(answer.json()["id"], SECONDS)
            # What it was solved to before is kept.
            assert (done.state, done.result["solved"]) == ("done", 3 if picture else 0)
            (now,) = api.get(PICTURES).json()["items"]
            assert (now["picture"], now["mixed"]) == (picture, False)
        last = api.get("/api/v1/groups/1/history").json()["items"][-1]
        assert (last["kind"], last["body"]["edit"]["edit"]) == ("edit", "set_picture")

    def test_an_estimate_is_a_job_that_changes_nothing(self, app, api) -> None:
        answer = api.post(PICTURES, json={})
        done = app.state.services.jobs.wait(answer.json()["id"], SECONDS)
        (item,) = done.result["items"]
        assert (done.kind, done.state, item["proposed"]) == ("pictures", "done", None)
        assert "pixels" in item["sentence"] or "frames show enough" in item["sentence"]
        assert api.get(PICTURES).json()["items"][0]["picture"] is None

    @pytest.mark.parametrize("method", ["post", "patch"])
    def test_a_match_that_is_not_there_is_404(self, api, method: str) -> None:
        answer = getattr(api, method)(
            PICTURES, json={"match": "x", **({"picture": None} if method == "patch" else {})}
        )
        assert answer.status_code == 404
        assert api.get("/api/v1/datasets/nothing/pictures").status_code == 404
