"""Groups over HTTP: the document, its state, its verdict."""

from __future__ import annotations

from typing import Any

import pytest

API = "/api/v1"


@pytest.fixture
def document(api) -> dict[str, Any]:
    """A group of two broadcast views."""
    row = api.get(f"{API}/groups", params={"dataset": "broadcast"}).json()["items"][0]
    return api.get(f"{API}/groups/{row['id']}").json()


def put(api, document: dict[str, Any], verdict: dict[str, Any]) -> Any:
    return api.put(
        f"{API}/groups/{document['id']}/verdict",
        json=verdict,
        headers={"If-Match": document["etag"]},
    )


class TestGetGroup:
    def test_is_the_document_that_docs_api_shows(self, api, document) -> None:
        names = (
            "id number dataset key label match split pitch revision etag can_undo can_redo "
            "verdict verdicts policy views solution"
        )
        assert set(document) == set(names.split())
        assert document["dataset"]["name"] == "broadcast"
        assert document["pitch"] == {"length": 105.0, "width": 68.0}
        assert [view["letter"] for view in document["views"]] == ["A", "B"]
        assert [view["label"] for view in document["views"]] == ["Main camera", "Replay 1"]
        assert document["solution"]["passes"] is True

    def test_annotated_points_travel_exactly(self, document, group) -> None:
        for view, said in zip(document["views"], group.views, strict=True):
            lines = {
                marking: [(point["x"], point["y"]) for point in points]
                for marking, points in view["lines"].items()
            }
            assert lines == {name: list(map(tuple, p)) for name, p in said.station.lines.items()}
            box = said.balls[0].box
            assert view["balls"][0]["box"] == [box.x, box.y, box.width, box.height]

    def test_a_caller_who_has_the_current_state_gets_304(self, api, document) -> None:
        path = f"{API}/groups/{document['id']}"
        assert api.get(path).headers["etag"] == document["etag"]
        again = api.get(path, headers={"If-None-Match": f'"other", {document["etag"]}'})
        assert (again.status_code, again.content) == (304, b"")

    def test_nothing_at_an_id_that_is_not_there(self, api) -> None:
        for group in ("99", "0", "x", "9" * 40):
            assert api.get(f"{API}/groups/{group}").status_code == 404

    def test_a_static_camera_is_named_by_its_number(self, api) -> None:
        row = api.get(f"{API}/groups", params={"dataset": "static"}).json()["items"][0]
        views = api.get(f"{API}/groups/{row['id']}").json()["views"]
        assert [view["label"] for view in views] == ["Camera 3", "Camera 4"]


class TestListGroups:
    def test_a_row_has_what_a_queue_shows(self, api, document) -> None:
        page = api.get(f"{API}/groups", params={"dataset": "broadcast", "limit": 2}).json()
        row = page["items"][0]
        assert (page["total"], len(page["items"])) == (3, 2)
        assert (row["status"], row["passes"], row["views"]) == ("unreviewed", True, 2)
        assert row["first_failing"] is None
        assert row["thumbnail"] is None
        assert row["sigma_m"] == document["solution"]["ball"]["sigma_m"]

    @pytest.mark.parametrize(
        "cursor",
        [
            "x",
            "e30",
            "WzFd",
            "WyJudW1iZXIiLDk5OTk5OTk5OTk5OTk5OTk5OTk5OTk5XQ",
            "WyJudW1iZXIiLCJcdWQ4MDAiXQ",
            "-" * 400,
        ],
    )
    def test_a_cursor_that_is_none_of_ours_is_refused(self, api, cursor: str) -> None:
        query = {"dataset": "broadcast", "cursor": cursor}
        answer = api.get(f"{API}/groups", params=query)
        assert answer.status_code == 400, answer.text

    def test_a_number_that_no_group_can_have_finds_none(self, api) -> None:
        query = {"dataset": "broadcast", "q": "number:" + "9" * 30}
        assert api.get(f"{API}/groups", params=query).json()["total"] == 0

    @pytest.mark.parametrize("query", ["jac<low", "nothing:1", "sort:nothing", "status:done", '"'])
    def test_a_query_that_cannot_be_read_points_to_its_place(self, api, query: str) -> None:
        answer = api.get(f"{API}/groups", params={"dataset": "broadcast", "q": query})
        assert answer.status_code == 400
        assert answer.json()["pointer"].startswith("/q")

    def test_any_place_of_the_list_can_be_read_at_once(self, api) -> None:
        query = {"dataset": "broadcast", "q": "sort:number-desc"}
        whole = api.get(f"{API}/groups", params=query).json()["items"]
        page = api.get(f"{API}/groups", params={**query, "from": 1, "limit": 1}).json()
        assert (page["items"], page["total"]) == ([whole[1]], 3)
        last = api.get(f"{API}/groups", params={**query, "cursor": page["next"]}).json()
        assert (last["items"], last["next"]) == ([whole[2]], None)
        beyond = api.get(f"{API}/groups", params={**query, "from": 3}).json()
        assert (beyond["items"], beyond["next"], beyond["total"]) == ([], None, 3)

    @pytest.mark.parametrize(
        ("start", "status"), [("-1", 422), ("x", 422), (str(2**63), 422), ("0&cursor=x", 400)]
    )
    def test_a_place_that_cannot_be_is_pointed_to(self, api, start: str, status: int) -> None:
        answer = api.get(f"{API}/groups?dataset=broadcast&from={start}")
        assert (answer.status_code, answer.json()["pointer"]) == (status, "/from")

    def test_ids_come_alone_in_the_order_of_the_list(self, api) -> None:
        query = {"dataset": "broadcast", "q": "sort:number-desc"}
        whole = [row["id"] for row in api.get(f"{API}/groups", params=query).json()["items"]]
        answer = api.get(f"{API}/groups/ids", params=query).json()
        assert answer == {"ids": whole, "total": 3}
        some = api.get(f"{API}/groups/ids", params={**query, "from": 1, "limit": 1}).json()
        assert some == {"ids": whole[1:2], "total": 3}
        left = {"dataset": "broadcast", "q": f"-id:{whole[0]},{whole[2]}"}
        assert api.get(f"{API}/groups/ids", params=left).json()["ids"] == [whole[1]]

    @pytest.mark.parametrize("limit", ["0", "501", "x", "-1"])
    def test_a_limit_has_bounds(self, api, limit: str) -> None:
        answer = api.get(f"{API}/groups", params={"dataset": "broadcast", "limit": limit})
        assert (answer.status_code, answer.json()["pointer"]) == (422, "/limit")

    def test_an_unknown_dataset_is_not_found(self, api) -> None:
        assert api.get(f"{API}/groups", params={"dataset": "x"}).status_code == 404
        assert api.get(f"{API}/groups").status_code == 422


class TestSolutionAndHistory:
    def test_the_solution_alone_is_the_one_of_the_document(self, api, document) -> None:
        alone = api.get(f"{API}/groups/{document['id']}/solution").json()
        assert alone == document["solution"]

    def test_history_begins_with_the_import(self, api, document) -> None:
        items = api.get(f"{API}/groups/{document['id']}/history").json()["items"]
        assert [(item["kind"], item["body"]) for item in items] == [("import", None)]


class TestPreview:
    def test_an_edit_of_lines_and_ball_is_solved_and_not_saved(self, api, document) -> None:
        first = document["views"][0]
        box = first["balls"][0]["box"]
        changes = {
            "views": {
                first["key"]: {
                    "lines": {next(iter(first["lines"])): None},
                    "ball": {"box": [box[0] + 3.0, *box[1:]]},
                }
            }
        }
        answer = api.post(f"{API}/groups/{document['id']}/preview", json=changes)
        assert answer.json()["solution"]["pairs"] != document["solution"]["pairs"]
        assert api.get(f"{API}/groups/{document['id']}").json() == document

    def test_no_change_is_the_present_solution(self, api, document) -> None:
        answer = api.post(f"{API}/groups/{document['id']}/preview", json={"views": {}})
        assert answer.json()["solution"] == document["solution"]

    def test_null_takes_the_ball_away_and_absence_keeps_it(self, api, document) -> None:
        path, key = f"{API}/groups/{document['id']}/preview", document["views"][0]["key"]
        without = api.post(path, json={"views": {key: {"ball": None}}}).json()
        kept = api.post(path, json={"views": {key: {}}}).json()
        assert without["solution"]["ball"] is None
        assert kept["solution"]["ball"] is not None

    def test_an_unknown_view_is_pointed_to(self, api, document) -> None:
        path = f"{API}/groups/{document['id']}/preview"
        answer = api.post(path, json={"views": {"a/b": {"included": False}}})
        assert (answer.status_code, answer.json()["pointer"]) == (400, "/views/a~1b")


class TestVerdict:
    def test_is_kept_with_its_author(self, api, document) -> None:
        after = put(api, document, {"state": "rejected", "reason": "sides_confused"}).json()
        verdict = after["verdict"]
        assert (verdict["state"], verdict["reason"]) == ("rejected", "sides_confused")
        assert verdict["by"] == "local"
        assert after["verdicts"] == [verdict]

    def test_can_be_changed_and_taken_back(self, api, document) -> None:
        for verdict in (
            {"state": "accepted", "note": "no pictures; seen on video"},
            {"state": "deferred"},
            {"state": "rejected", "reason": "other", "note": "no match"},
            {"state": "unreviewed"},
        ):
            answer = put(api, document, verdict)
            assert answer.status_code == 200, answer.text
            document = answer.json()
            assert document["verdict"]["state"] == verdict["state"]

    @pytest.mark.parametrize(
        ("verdict", "pointer"),
        [
            ({"state": "rejected"}, "/reason"),
            ({"state": "rejected", "reason": "other"}, "/note"),
            ({"state": "accepted", "reason": "other"}, "/reason"),
        ],
    )
    def test_what_is_missing_is_pointed_to(self, api, document, verdict, pointer: str) -> None:
        answer = put(api, document, verdict)
        assert (answer.status_code, answer.json()["pointer"]) == (400, pointer)

    @pytest.mark.parametrize(
        "verdict", [{}, {"state": "fine"}, {"state": "accepted", "who": "me"}, [], None, 1]
    )
    def test_a_body_of_another_shape_is_422(self, api, document, verdict) -> None:
        assert put(api, document, verdict).status_code == 422


class TestActor:
    def test_a_script_that_says_its_name_is_remembered_as_one(self, api) -> None:
        named = api.get(f"{API}/groups/1").json()
        headers = {"If-Match": named["etag"], "X-Actor": "local"}
        sent = api.put(f"{API}/groups/1/verdict", json={"state": "deferred"}, headers=headers)
        assert sent.json()["verdict"]["by"] == "script:local"
        found = api.get(
            f"{API}/groups", params={"dataset": "broadcast", "q": "reviewer:script:local"}
        )
        assert [item["id"] for item in found.json()["items"]] == [1]

    @pytest.mark.parametrize("name", ["", "a\tb", "<b>", "x" * 61, "Jos\u00e9".encode()])
    def test_a_name_that_cannot_be_is_refused_and_nothing_is_done(self, api, name) -> None:
        before = api.get(f"{API}/groups/1").json()
        headers = {"If-Match": before["etag"], "X-Actor": name}
        sent = api.put(f"{API}/groups/1/verdict", json={"state": "deferred"}, headers=headers)
        assert (sent.status_code, sent.json()["pointer"]) == (400, "/X-Actor")
        assert api.get(f"{API}/groups/1").json()["etag"] == before["etag"]

    def test_the_same_key_under_another_name_is_another_request(self, api) -> None:
        sent = {"name": "one", "q": ""}
        answers = [
            api.post(
                f"{API}/datasets/broadcast/saved-views",
                json=sent,
                headers={"Idempotency-Key": "k", "X-Actor": name},
            ).status_code
            for name in ("a", "a", "b")
        ]
        assert answers == [201, 201, 422]
