"""What a query can ask, over HTTP."""

from __future__ import annotations

API = "/api/v1"


def test_every_field_says_its_operators_unit_and_values(api) -> None:
    body = api.get(f"{API}/query-fields").json()
    fields = {item["name"]: item for item in body["items"]}
    assert fields["sigma"] == {
        "name": "sigma",
        "kind": "number",
        "meaning": fields["sigma"]["meaning"],
        "unit": "m",
        "operators": [":", "=", "<", "<=", ">", ">="],
        "values": ["none"],
        "several": False,
        "also": ["sigma_m"],
    }
    assert fields["status"]["values"] == ["unreviewed", "accepted", "rejected", "deferred"]
    assert {"value", "newest", "number"} <= {item["name"] for item in body["sorts"]}


def test_what_it_offers_is_understood(api) -> None:
    body = api.get(f"{API}/query-fields").json()
    words = [f"{item['name']}:{next(iter(item['values']), '1')}" for item in body["items"]]
    words += [f"sort:{item['name']}-desc" for item in body["sorts"]]
    for word in words:
        answer = api.get(f"{API}/groups", params={"dataset": "broadcast", "q": word})
        assert answer.status_code == 200, answer.text
