"""A list read while others change it: by cursors nothing is missed, by positions any place is near."""

from __future__ import annotations

from typing import Any

import httpx

GROUPS = "/api/v1/groups"
LIST = {"dataset": "small", "q": "status:unreviewed sort:sigma-desc", "limit": 1}


def judge(client: httpx.Client, group: int, state: str) -> None:
    etag = client.get(f"{GROUPS}/{group}").headers["etag"]
    path, headers = f"{GROUPS}/{group}/verdict", {"If-Match": etag}
    assert client.put(path, json={"state": state}, headers=headers).status_code == 200


def page(client: httpx.Client, **more: Any) -> dict[str, Any]:
    answer: dict[str, Any] = client.get(GROUPS, params={**LIST, **more}).raise_for_status().json()
    return answer


def only(answer: dict[str, Any]) -> int:
    (row,) = answer["items"]
    return int(row["id"])


class TestReading:
    def test_a_cursor_misses_nothing_while_a_position_speaks_about_this_moment(
        self, client
    ) -> None:
        for group in client.get(f"{GROUPS}/ids", params={"dataset": "small"}).json()["ids"]:
            judge(client, group, "unreviewed")
        whole = client.get(f"{GROUPS}/ids", params={**LIST, "limit": 100}).json()
        ids = whole["ids"]
        assert (len(ids), whole["total"]) == (4, 4)
        assert [only(page(client, **{"from": place})) for place in range(4)] == ids
        first = page(client)
        assert only(first) == ids[0]
        judge(client, ids[0], "deferred")
        try:
            after, there = page(client, cursor=first["next"]), page(client, **{"from": 1})
            assert (only(after), after["total"]) == (ids[1], 3)
            assert (only(there), there["total"]) == (ids[2], 3)
            assert only(page(client, cursor=there["next"])) == ids[3]
        finally:
            judge(client, ids[0], "unreviewed")
