"""Bulk verdicts over HTTP."""

from __future__ import annotations

from typing import Any

import pytest

DATASET = "/api/v1/datasets/broadcast"
VERDICTS = f"{DATASET}/verdicts"


def statuses(api) -> set[str]:
    rows = api.get("/api/v1/groups", params={"dataset": "broadcast"}).json()["items"]
    return {row["status"] for row in rows}


class TestPostVerdicts:
    def test_a_dry_run_tells_and_the_run_does_what_it_told(self, api) -> None:
        # These groups have no pictures, so accepting them needs a note.
        body = {"q": "passes:yes", "state": "accepted", "note": "seen on video"}
        plan = api.post(VERDICTS, params={"dry_run": True}, json=body).json()
        assert (plan["dry_run"], plan["matches"], plan["would_change"]) == (True, 3, 3)
        assert (len(plan["sample"]), plan["batch"], plan["changed"]) == (3, None, 0)
        assert statuses(api) == {"unreviewed"}
        done = api.post(VERDICTS, json={**body, "expected": plan["would_change"]})
        assert done.status_code == 200
        assert (done.json()["batch"], done.json()["changed"], done.json()["refused"]) == (1, 3, [])
        assert statuses(api) == {"accepted"}

    def test_groups_that_fail_a_gate_need_a_note_and_are_counted(self, api) -> None:
        view = api.get("/api/v1/groups/1").json()
        etag = {"If-Match": view["etag"]}
        api.patch(
            f"/api/v1/views/{view['views'][0]['id']}/ball",
            content="null",
            headers={
                **etag,
                "Content-Type": "application/json",
            },
        )
        done = api.post(VERDICTS, json={"state": "accepted"}).json()
        reasons = [{"reason": "needs_note", "groups": 1}, {"reason": "no_picture", "groups": 2}]
        assert (done["changed"], done["refused"]) == (0, reasons)
        again = api.post(VERDICTS, json={"state": "accepted", "note": "seen in the video"}).json()
        assert again["changed"] == 3
        verdict = api.get("/api/v1/groups/1").json()["verdict"]
        assert (verdict["override"], verdict["note"]) == ("ball", "seen in the video")

    @pytest.mark.parametrize(
        ("body", "status", "pointer"),
        [
            ({"state": "rejected"}, 400, "/reason"),
            ({"state": "maybe"}, 422, "/state"),
            ({"state": "accepted", "q": "colour:red"}, 400, "/q/0"),
            ({"state": "deferred", "expected": 2}, 409, None),
            ({"state": "deferred", "q": "id:1,two"}, 400, "/q/0"),
            ({"state": "deferred", "q": "x" * 1001}, 400, "/q/0"),
            ({"state": "deferred", "q": "id:" + "1," * 50_000}, 422, "/q"),
        ],
    )
    def test_an_impossible_verdict_changes_nothing(
        self, api, body: Any, status: int, pointer
    ) -> None:
        answer = api.post(VERDICTS, json=body)
        assert (answer.status_code, answer.json()["pointer"]) == (status, pointer)
        assert statuses(api) == {"unreviewed"}

    def test_ticked_rows_are_named_in_the_body_however_many(self, api) -> None:
        rows = api.get("/api/v1/groups", params={"dataset": "broadcast"}).json()["items"]
        ticked = [rows[0]["id"], rows[2]["id"], *range(1000, 13_000)]
        body = {"q": f"id:{','.join(map(str, ticked))}", "state": "deferred"}
        assert api.post(VERDICTS, json=body).json()["changed"] == 2
        after = api.get("/api/v1/groups", params={"dataset": "broadcast"}).json()["items"]
        assert [row["status"] for row in after] == ["deferred", "unreviewed", "deferred"]


class TestUndoBatch:
    def test_takes_the_whole_batch_back_and_only_once(self, api) -> None:
        batch = api.post(VERDICTS, json={"state": "deferred"}).json()["batch"]
        path = f"/api/v1/verdict-batches/{batch}/undo"
        answer = api.post(path)
        assert (answer.status_code, answer.json()) == (
            200,
            {"batch": batch, "restored": 3, "kept": 0},
        )
        assert statuses(api) == {"unreviewed"}
        assert api.post(path).status_code == 409
        (item,) = api.get(f"{DATASET}/verdict-batches").json()["items"]
        assert (item["state"], item["changed"], item["done"]) == ("deferred", 3, True)
        assert item["undone_by"] == "local"

    def test_an_unknown_batch_is_404(self, api) -> None:
        assert api.post("/api/v1/verdict-batches/7/undo").status_code == 404
