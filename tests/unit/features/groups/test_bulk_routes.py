"""Edits of many views in one request, over HTTP."""

from __future__ import annotations

from typing import Any

import pytest

from app.db.log import read_log
from app.features.groups.bulk_edits import MAX_ITEMS
from app.features.groups.edit_codec import REQUEST_POINTS
from app.http.deps import Services
from tests.databases import content
from tests.unit.http.group_requests import etag_of, send, take_handed_in
from tests.unit.http.test_documents_respond import stopped_after_a_commit

API = "/api/v1"
EDITS = f"{API}/datasets/broadcast/edits"
POINT = {"point": [600.5, 300.25]}


def group(api: Any, number: int = 1) -> dict[str, Any]:
    found: dict[str, Any] = api.get(f"{API}/groups/{number}").json()
    return found


def edit(api: Any, *items: dict[str, Any], dry_run: bool = False, **more: Any) -> dict[str, Any]:
    params = {"dry_run": "true"} if dry_run else {}
    answer = api.post(EDITS, params=params, json={"items": [*items], **more})
    assert answer.status_code == 200, answer.text
    found: dict[str, Any] = answer.json()
    return found


def item(document: dict[str, Any], view: int = 0, **change: Any) -> dict[str, Any]:
    return {"view": document["views"][view]["id"], "etag": document["etag"], **change}


def moved(document: dict[str, Any], view: int = 0) -> dict[str, Any]:
    name, points = next(iter(document["views"][view]["lines"].items()))
    return {name: [{"x": point["x"] + 2.0, "y": point["y"]} for point in points]}


def outcomes(report: dict[str, Any]) -> list[tuple[str, int | None]]:
    return [(one["outcome"], one["status"]) for one in report["items"]]


class TestEditViews:
    def test_balls_and_lines_of_several_groups_change_as_single_edits_change_them(
        self, api
    ) -> None:
        first, second = group(api), group(api, 2)
        lines = moved(first)
        report = edit(
            api,
            item(first, 0, lines=lines, ball=POINT),
            item(second, 1, ball={"out_of_view": True}),
            item(first, 1, ball=None),
        )
        assert (report["changed"], report["unchanged"], report["refused"]) == (3, 0, 0)
        after, other = group(api), group(api, 2)
        name = next(iter(lines))
        assert after["views"][0]["lines"][name] == lines[name]
        assert after["views"][0]["balls"][0]["point"] == POINT["point"]
        assert after["views"][1]["balls"] == []
        assert other["views"][1]["balls"][0]["out_of_view"] is True
        assert [one["etag"].split("-")[0] for one in report["items"]] == [
            document["etag"].split("-")[0] for document in (after, other, after)
        ]
        assert [one["group"] for one in report["items"]] == [1, 2, 1]
        assert after["solution"] is not None

    def test_the_views_of_a_group_are_one_edit_that_undo_takes_back(self, api) -> None:
        before = group(api)
        entries = len(api.get(f"{API}/groups/1/history").json()["items"])
        edit(api, item(before, 0, ball=POINT), item(before, 1, ball=None))
        history = api.get(f"{API}/groups/1/history").json()["items"]
        assert len(history) == entries + 1
        assert history[-1]["body"]["edit"]["edit"] == "several"
        send(api, ("POST", "/groups/1/undo", None, etag_of(api, "/groups/1")))
        back = group(api)
        assert [view["balls"] for view in back["views"]] == [
            view["balls"] for view in before["views"]
        ]

    def test_a_view_is_named_by_the_keys_of_its_group_and_itself(self, api) -> None:
        document = group(api)
        named = {"group": document["key"], "view": document["views"][0]["key"], "ball": POINT}
        report = edit(api, named, if_match="*")
        assert (report["changed"], report["items"][0]["view"]) == (1, document["views"][0]["id"])
        missing = edit(
            api, {**named, "group": "nowhere"}, {**named, "view": "nothing"}, if_match="*"
        )
        assert outcomes(missing) == [("refused", 404)] * 2
        assert "no group nowhere" in missing["items"][0]["problem"]
        assert "has no view nothing" in missing["items"][1]["problem"]

    def test_what_is_said_already_is_unchanged_and_writes_nothing(self, app, api) -> None:
        document = group(api)
        edit(api, item(document, 0, ball=POINT))
        before = content(app.state.services.store)
        report = edit(api, item(group(api), 0, ball=POINT))
        assert outcomes(report) == [("unchanged", None)]
        assert content(app.state.services.store) == before

    def test_who_is_late_is_refused_with_the_present_state_and_others_are_not(self, api) -> None:
        old, other = group(api), group(api, 2)
        edit(api, item(old, 0, ball=POINT))
        present = group(api)
        report = edit(api, item(old, 1, ball=None), item(other, 0, ball=None))
        assert outcomes(report) == [("refused", 412), ("changed", None)]
        late = report["items"][0]
        assert (late["etag"], late["pointer"]) == (present["etag"], "/items/0/etag")
        assert group(api)["etag"] == present["etag"]

    def test_without_a_state_it_is_400_unless_any_state_is_meant(self, api) -> None:
        document = group(api)
        loose = {"view": document["views"][0]["id"], "ball": POINT}
        answer = api.post(EDITS, json={"items": [item(document, 1, ball=None), loose]})
        assert (answer.status_code, answer.json()["pointer"]) == (400, "/items/1/etag")
        assert group(api)["etag"] == document["etag"]
        assert edit(api, loose, if_match="*")["changed"] == 1

    def test_a_group_is_edited_whole_or_not_at_all(self, api) -> None:
        document = group(api)
        report = edit(
            api, item(document, 0, ball=POINT), item(document, 0, ball=None), item(document, 1, ball=None)
        )  # fmt: skip
        assert outcomes(report) == [("refused", 409), ("refused", 400), ("refused", 409)]
        assert "another item changes view" in report["items"][1]["problem"]
        assert "another item of the same group" in report["items"][0]["problem"]
        assert group(api)["etag"] == document["etag"]

    def test_a_view_of_another_dataset_is_as_unknown_as_one_that_is_not_there(self, api) -> None:
        foreign = group(api, 4)["views"][0]["id"]
        report = edit(
            api, {"view": foreign, "ball": None}, {"view": 10**9, "ball": None}, if_match="*"
        )
        first, second = report["items"]
        assert outcomes(report) == [("refused", 404)] * 2
        assert first["problem"].replace(str(foreign), "#") == second["problem"].replace(
            str(10**9), "#"
        )
        assert (first["group"], first["view"], first["etag"]) == (None, None, None)

    def test_lines_of_a_static_camera_are_refused_and_name_it(self, api) -> None:
        document = group(api, 4)
        answer = api.post(
            f"{API}/datasets/{document['dataset']['id']}/edits",
            json={"items": [item(document, 0, lines={"Side line top": None})]},
        )
        (one,) = answer.json()["items"]
        assert (one["outcome"], one["status"], one["pointer"]) == ("refused", 409, "/items/0/lines")
        assert "static camera" in one["hint"]

    def test_an_annotation_that_was_submitted_is_closed(self, api) -> None:
        request = take_handed_in(api)
        copy = group(api, int(request[1].split("/")[2]))
        send(api, request)
        answer = api.post(
            f"{API}/datasets/{copy['dataset']['id']}/edits",
            json={"if_match": "*", "items": [{"view": copy["views"][0]["id"], "ball": None}]},
        )
        (one,) = answer.json()["items"]
        assert (one["outcome"], one["status"]) == ("refused", 409)
        assert "was submitted" in one["problem"]

    @pytest.mark.parametrize(
        ("wrong", "pointer"),
        [
            ({"view": 1}, "/items/0"),
            ({"view": "7_1.png", "ball": None}, "/items/0"),
            ({"view": 1, "group": "x", "ball": None}, "/items/0"),
            ({"view": 1, "lines": {"Middle lime": None}}, "/items/0/lines/Middle lime"),
            ({"view": 1, "ball": {"point": [1, 2], "box": [1, 2, 3, 4]}}, "/items/0/ball"),
            ({"view": 1, "bal": None}, "/items/0/bal"),
        ],
    )
    def test_an_item_that_cannot_be_is_422_with_its_place_and_nothing_is_done(
        self, api, wrong, pointer
    ) -> None:
        answer = api.post(EDITS, json={"items": [wrong], "if_match": "*"})
        assert (answer.status_code, answer.json()["pointer"]) == (422, pointer)

    def test_a_request_has_so_many_items_and_points(self, api) -> None:
        many = [{"view": 1, "ball": None}] * (MAX_ITEMS + 1)
        assert api.post(EDITS, json={"items": many, "if_match": "*"}).status_code == 422
        assert api.post(EDITS, json={"items": [], "if_match": "*"}).status_code == 422
        points = [{"x": 1.0, "y": 2.0}] * 90
        lines = dict.fromkeys(("Middle line", "Side line top", "Side line left"), points)
        full = [{"view": number + 1, "lines": lines} for number in range(8)]
        answer = api.post(EDITS, json={"items": full, "if_match": "*"})
        assert (answer.status_code, answer.json()["pointer"]) == (422, "/items")
        assert str(REQUEST_POINTS) in answer.json()["detail"]

    def test_a_whole_request_of_boxes_stays_below_the_limits_of_a_body(self, api) -> None:
        one = {
            "group": "g" * 200,
            "view": "v" * 60,
            "etag": '"' + "0" * 30 + '"',
            "ball": {"box": [1234.125, 1234.125, 12.125, 12.125], "occluded": False},
            "lines": {"Middle line": [{"x": 1234.125, "y": 1234.125}] * 10},
        }
        report = edit(api, *[one] * MAX_ITEMS)
        assert report["refused"] == MAX_ITEMS


class TestEvents:
    def test_each_group_that_changed_is_an_event_as_of_single_edits(self, app, api) -> None:
        documents = [group(api, number) for number in (1, 2, 3)]
        store = app.state.services.store
        with store.read() as session:
            last = max(entry.id for entry in read_log(session))
        edit(api, *[item(document, 0, ball=POINT) for document in documents[:2]])
        with store.read() as session:
            new = [entry for entry in read_log(session) if entry.id > last]
        assert [(entry.kind, entry.group_id) for entry in new] == [("edit", 1), ("edit", 2)]


class TestDryRun:
    def test_it_reports_what_the_run_then_does_and_saves_nothing(self, app, api) -> None:
        document = group(api)
        items = [
            item(document, 0, ball=POINT),
            item(document, 1, lines=moved(document, 1)),
            item(group(api, 2), 0, etag='"0-0"', ball=None),
            {"view": 10**9, "ball": None},
        ]
        before = content(app.state.services.store)
        planned = edit(api, *items, dry_run=True, if_match="*")
        assert content(app.state.services.store) == before
        assert planned["dry_run"] is True
        done = edit(api, *items, if_match="*")
        assert outcomes(planned) == outcomes(done)
        assert outcomes(done) == [
            ("changed", None), ("changed", None), ("refused", 412), ("refused", 404),
        ]  # fmt: skip


class TestStopped:
    @pytest.mark.parametrize("commits", [1, 2, 3])
    def test_sent_again_under_its_key_it_does_the_rest_once(
        self, app, api, monkeypatch: pytest.MonkeyPatch, commits: int
    ) -> None:
        documents = [group(api, number) for number in (1, 2, 3)]
        body = {"items": [item(document, 0, ball=POINT) for document in documents]}
        key = {"Idempotency-Key": "bulk"}
        with stopped_after_a_commit(app.state.services.store, monkeypatch, commits=commits):
            assert api.post(EDITS, json=body, headers=key).status_code == 500
        app.state.services.close()
        app.state.services = Services.open(app.state.services.settings)
        answers = [api.post(EDITS, json=body, headers=key) for _ in range(2)]
        assert [outcomes(answer.json()) for answer in answers] == [[("changed", None)] * 3] * 2
        assert answers[1].headers["idempotency-replayed"] == "true"
        for number in (1, 2, 3):
            kinds = [
                one["kind"] for one in api.get(f"{API}/groups/{number}/history").json()["items"]
            ]
            assert kinds.count("edit") == 1
