"""Bulk verdicts over HTTP."""

from __future__ import annotations

from typing import Any

import pytest
from sqlalchemy import text

from app.db.session import Session
from app.features.imports.ingest import import_groups
from app.features.verdicts import bulk, bulk_undo
from app.features.verdicts.bulk import BulkVerdictRun
from app.soccer.frames import ImageSize
from app.soccer.group import Group, Station, View

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
        assert (plan["unchanged"], plan["replaced"]) == (0, [])
        assert statuses(api) == {"unreviewed"}
        done = api.post(VERDICTS, json={**body, "expected": plan["would_change"]})
        assert done.status_code == 200
        assert (done.json()["batch"], done.json()["changed"], done.json()["refused"]) == (1, 3, [])
        assert statuses(api) == {"accepted"}
        assert (done.json()["unchanged"], done.json()["replaced"]) == (None, None)
        other = api.post(VERDICTS, params={"dry_run": True}, json={"state": "deferred"}).json()
        assert (other["unchanged"], other["replaced"]) == (0, [{"state": "accepted", "groups": 3}])

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


class TestListBatches:
    def test_a_page_reads_no_more_rows_than_it_shows_and_one(
        self, api, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        for number in range(5):
            api.post(VERDICTS, json={"state": "deferred", "note": f"round {number}"})
        asked: list[int] = []
        read = bulk.read_bulk_verdicts

        def counted(session: Session, dataset_id: int, limit: int, *before: Any) -> Any:
            asked.append(limit)
            return read(session, dataset_id, limit, *before)

        monkeypatch.setattr(bulk, "read_bulk_verdicts", counted)
        pages, cursor = [], None
        while True:
            params = {"limit": 2, **({"cursor": cursor} if cursor else {})}
            page = api.get(f"{DATASET}/verdict-batches", params=params).json()
            pages.append([item["id"] for item in page["items"]])
            cursor = page["next"]
            if cursor is None:
                break
        assert pages == [[5, 4], [3, 2], [1]]
        assert asked == [3, 3, 3]

    def test_a_foreign_cursor_is_refused(self, api) -> None:
        answer = api.get(f"{DATASET}/verdict-batches", params={"cursor": "19.abc"})
        assert (answer.status_code, answer.json()["pointer"]) == (400, "/cursor")


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


class Stop:
    """Lets a function run so many times, then fails once, as a server that is killed does."""

    def __init__(self, plain: Any, after: int):
        self._plain, self._left = plain, after

    def __get__(self, run: Any, _kind: Any) -> Any:
        return lambda *args: self(run, *args)

    def __call__(self, *args: Any) -> Any:
        self._left -= 1
        if self._left == -1:
            raise RuntimeError("killed")
        return self._plain(*args)


def log_kinds(app) -> list[str]:
    with app.state.services.store.read() as session:
        return list(session.scalars(text("SELECT kind FROM log WHERE kind LIKE 'verdict%'")))


class TestStoppedBetweenChunks:
    """The same Idempotency-Key goes on where it ended, and is answered as if nothing had been."""

    BODY = {"state": "accepted", "note": "seen on video"}  # noqa: RUF012
    KEY = {"Idempotency-Key": "once"}  # noqa: RUF012

    @pytest.fixture(autouse=True)
    def one_group_a_chunk(self, monkeypatch) -> None:
        monkeypatch.setattr(bulk, "CHUNK", 1)

    def test_verdicts_are_given_once(self, app, api, monkeypatch) -> None:
        with monkeypatch.context() as patch:
            patch.setattr(BulkVerdictRun, "save_chunk", Stop(BulkVerdictRun.save_chunk, after=1))
            assert api.post(VERDICTS, json=self.BODY, headers=self.KEY).status_code == 500
        assert log_kinds(app) == ["verdict"]
        done = api.post(VERDICTS, json={**self.BODY, "expected": None}, headers=self.KEY)
        assert done.status_code == 422
        done = api.post(VERDICTS, json=self.BODY, headers=self.KEY)
        assert (done.json()["batch"], done.json()["changed"], done.json()["refused"]) == (1, 3, [])
        assert log_kinds(app) == [*["verdict"] * 3, "verdict_batch"]
        again = api.post(VERDICTS, json=self.BODY, headers=self.KEY)
        assert (again.content, again.headers["idempotency-replayed"]) == (done.content, "true")
        undone = api.post("/api/v1/verdict-batches/1/undo").json()
        assert (undone["restored"], undone["kept"]) == (3, 0)

    def test_what_was_imported_since_it_was_stopped_is_not_judged_with_the_rest(
        self, app, api, monkeypatch
    ) -> None:
        body = {"state": "deferred", "expected": 3}
        with monkeypatch.context() as patch:
            patch.setattr(BulkVerdictRun, "save_chunk", Stop(BulkVerdictRun.save_chunk, after=1))
            assert api.post(VERDICTS, json=body, headers=self.KEY).status_code == 500
        new = Group("new", (View("1.png", Station("1.png", ImageSize(1280, 720))),), "m")
        import_groups(app.state.services.store, "broadcast", [new], source="test", actor="local")
        assert api.post(VERDICTS, json=body, headers=self.KEY).json()["changed"] == 3
        assert statuses(api) == {"deferred", "unreviewed"}

    def test_one_that_an_earlier_version_began_goes_on_with_the_groups_that_it_had_left(
        self, api, monkeypatch
    ) -> None:
        interrupt = BulkVerdictRun.save_remaining

        def in_its_words(run: BulkVerdictRun, session: Session, left: dict[str, Any]) -> None:
            interrupt(run, session, {"ids": [3], "refused": []})

        with monkeypatch.context() as patch:
            patch.setattr(BulkVerdictRun, "save_remaining", in_its_words)
            patch.setattr(BulkVerdictRun, "save_chunk", Stop(BulkVerdictRun.save_chunk, after=1))
            assert api.post(VERDICTS, json=self.BODY, headers=self.KEY).status_code == 500
        done = api.post(VERDICTS, json=self.BODY, headers=self.KEY).json()
        assert (done["batch"], done["changed"]) == (1, 2)
        assert api.get("/api/v1/groups/2").json()["verdict"]["state"] == "unreviewed"

    def test_what_was_expected_is_weighed_at_the_beginning_alone(self, api, monkeypatch) -> None:
        body = {"state": "deferred", "expected": 3}
        with monkeypatch.context() as patch:
            patch.setattr(BulkVerdictRun, "save_chunk", Stop(BulkVerdictRun.save_chunk, after=2))
            assert api.post(VERDICTS, json=body, headers=self.KEY).status_code == 500
        assert api.post(VERDICTS, json=body, headers=self.KEY).json()["changed"] == 3

    def test_what_was_given_and_is_taken_back_meanwhile_is_no_longer_gone_on_with(
        self, api, monkeypatch
    ) -> None:
        with monkeypatch.context() as patch:
            patch.setattr(BulkVerdictRun, "save_chunk", Stop(BulkVerdictRun.save_chunk, after=1))
            api.post(VERDICTS, json=self.BODY, headers=self.KEY)
        api.post("/api/v1/verdict-batches/1/undo")
        refused = api.post(VERDICTS, json=self.BODY, headers=self.KEY)
        assert refused.status_code == 409
        assert "undone" in refused.json()["detail"]

    def test_a_batch_is_taken_back_whole(self, app, api, monkeypatch) -> None:
        api.post(VERDICTS, json=self.BODY)
        with monkeypatch.context() as patch:
            patch.setattr(bulk_undo, "_restore_chunk", Stop(bulk_undo._restore_chunk, after=2))
            undo = "/api/v1/verdict-batches/1/undo"
            assert api.post(undo, headers=self.KEY).status_code == 500
        done = api.post(undo, headers=self.KEY).json()
        assert (done["batch"], done["restored"], done["kept"]) == (1, 3, 0)
        assert statuses(api) == {"unreviewed"}
        again = api.post("/api/v1/verdict-batches/1/redo").json()
        assert (again["changed"], again["kept"]) == (3, 0)

    def test_a_batch_is_given_again_whole(self, api, monkeypatch) -> None:
        api.post(VERDICTS, json=self.BODY)
        api.post("/api/v1/verdict-batches/1/undo")
        redo = "/api/v1/verdict-batches/1/redo"
        with monkeypatch.context() as patch:
            patch.setattr(BulkVerdictRun, "save_chunk", Stop(BulkVerdictRun.save_chunk, after=1))
            assert api.post(redo, headers=self.KEY).status_code == 500
        done = api.post(redo, headers=self.KEY).json()
        assert (done["batch"], done["changed"], done["kept"], done["refused"]) == (2, 3, 0, [])
