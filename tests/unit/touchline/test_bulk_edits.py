"""Edits of many views: how they are split, and the one report of all requests."""

from __future__ import annotations

from json import dumps, loads
from typing import Any

import pytest

from app.features.groups import bulk_edits as server
from app.features.groups.edit_codec import REQUEST_POINTS
from app.http import requests
from touchline import bulk_edits
from touchline.bulk_edits import requests_of
from touchline.client import Client
from touchline.errors import ForbiddenError, RequestError


def item(view: int, **more: Any) -> dict[str, Any]:
    return {"view": view, "ball": None, **more}


def answer(*outcomes: str) -> dict[str, Any]:
    items = [
        {"index": index, "group": 1, "view": 1, "outcome": outcome, "etag": None, "status": None}
        | {"problem": None, "hint": None, "pointer": f"/items/{index}"}
        for index, outcome in enumerate(outcomes)
    ]
    return {"items": items}


class TestRequestsOf:
    def test_its_limits_are_the_servers(self) -> None:
        assert bulk_edits.MAX_ITEMS == server.MAX_ITEMS
        assert bulk_edits.MAX_POINTS == REQUEST_POINTS
        assert bulk_edits.MAX_BRACKETS < requests.MAX_CONTAINERS
        assert bulk_edits.MAX_COMMAS < requests.MAX_VALUES
        assert bulk_edits.MAX_BYTES < requests.MAX_JSON_BYTES

    def test_every_item_is_sent_once_and_none_of_a_group_apart(self) -> None:
        items = [item(number, etag=f'"{number % 150}"') for number in range(450)]
        chunks = [*requests_of(items)]
        sent = [place for chunk in chunks for place, _ in chunk]
        assert sorted(sent) == [*range(450)]
        for chunk in chunks:
            assert len(chunk) <= bulk_edits.MAX_ITEMS
        groups = [{one["etag"] for _, one in chunk} for chunk in chunks]
        assert sum(map(len, groups)) == 150

    @pytest.mark.parametrize(
        "more",
        [
            {"lines": {"Middle line": [{"x": 1.0, "y": 2.0}] * 30}},
            {"lines": {f"Marking {number}": [] for number in range(26)}},
            {"group": "g" * 4000},
        ],
    )
    def test_what_is_large_is_split_so_that_the_server_reads_it(self, more: Any) -> None:
        chunks = [*requests_of([item(number, **more) for number in range(400)])]
        assert len(chunks) > 2 or "group" in more
        for chunk in chunks:
            text = dumps({"if_match": "*", "items": [one for _, one in chunk]})
            if "group" not in more:
                assert requests.read_json(text.encode()) == loads(text)
                assert len(text) < requests.MAX_JSON_BYTES


class TestEditViews:
    def test_several_requests_give_one_report_in_the_order_of_the_items(self, answers) -> None:
        answers.say(200, answer(*["changed"] * 200))
        answers.say(200, answer("refused", *["unchanged"] * 9))
        items = [item(number) for number in range(210)]
        report = Client(answers.address).edit_views("a b", items, if_match="*", dry_run=True)
        assert (report["changed"], report["unchanged"], report["refused"]) == (200, 9, 1)
        assert [one["index"] for one in report["items"]] == [*range(210)]
        assert report["items"][200]["pointer"] == "/items/200"
        paths = {asked.path for asked in answers.asked}
        assert paths == {"/api/v1/datasets/a%20b/edits?dry_run=true"}

    def test_one_request_that_is_wrong_hides_none_of_the_others(self, answers) -> None:
        answers.say(200, answer(*["changed"] * 200))
        answers.say(422, {"detail": "/items/3/ball: give a box", "pointer": "/items/3/ball"})
        answers.say(200, answer("changed"))
        report = Client(answers.address).edit_views("a", [item(n) for n in range(401)])
        assert (report["changed"], report["refused"]) == (201, 200)
        wrong = report["items"][200]
        assert wrong["problem"] == "/items/203/ball: give a box"
        assert (wrong["status"], wrong["pointer"]) == (422, "/items/203/ball")

    def test_the_first_request_that_is_refused_raises_and_nothing_is_done(self, answers) -> None:
        answers.say(422, {"detail": "/items/3/ball: give a box"})
        with pytest.raises(RequestError) as caught:
            Client(answers.address).edit_views("a", [item(n) for n in range(401)])
        assert caught.value.report is not None
        assert (len(answers.asked), caught.value.report["changed"]) == (1, 0)

    def test_what_stops_all_that_is_left_raises_with_what_was_done(self, answers) -> None:
        answers.say(200, answer(*["changed"] * 200))
        answers.say(403, {"detail": "you may not"})
        with pytest.raises(ForbiddenError) as caught:
            Client(answers.address).edit_views("a", [item(n) for n in range(401)])
        assert caught.value.report is not None
        assert (caught.value.report["changed"], len(caught.value.report["items"])) == (200, 200)

    def test_no_items_are_no_request(self, answers) -> None:
        report = Client(answers.address).edit_views("a", [])
        assert (report["items"], report["changed"], len(answers.asked)) == ([], 0, 0)
