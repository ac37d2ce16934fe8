"""Own annotations: every route, asked by somebody else for another one's copy, tells nothing of it."""

from __future__ import annotations

import json
from collections.abc import Iterator
from typing import Any
from urllib.parse import quote

import pytest

from app.features.imports.ingest import import_groups
from app.features.people.roles import Action, Role
from app.features.people.visibility_queries import COPIES
from app.features.solutions.service import solve_dataset
from app.http.permissions import QUERIES
from tests.openapi import openapi_of
from tests.scenes import make_scenes
from tests.security.apart import API, PERMISSIONS, Apart, opened
from tests.security.table import rows

BALL = [613.25, 301.75, 9.5, 9.5]
WORDS = ("613.25", "301.75", "berta")
"""What berta said, and her name, which her copies are called by."""


@pytest.fixture(scope="module")
def team(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Apart]:
    with opened(tmp_path_factory.mktemp("blind")) as made:
        group = make_scenes(groups=1, seed=3, faults=False)[0].group
        import_groups(made.store, "demo", [group], source="files", actor="local")
        solve_dataset(made.store, "demo")
        made.add("lea", Role.NONE, demo=Role.LEAD)
        made.add("anna", Role.REVIEWER)
        made.add("olaf", Role.ANNOTATOR)
        made.add("berta", Role.NONE, demo=Role.REVIEWER)
        made.add("vera", Role.VIEWER)
        yield made


def begun(team: Apart, name: str) -> dict[str, object]:
    """The document of somebody's own copy of the one group."""
    take = team.ask(name, "POST", "/groups/1/independent-annotations")
    assert take.status_code == 201, take.text
    found = team.ask(name, "GET", f"/groups/{take.json()['group']}")
    assert found.status_code == 200, found.text
    document: dict[str, object] = found.json()
    return document


def test_nothing_tells_anybody_else_what_somebody_annotates(team: Apart) -> None:
    copy = begun(team, "berta")
    view = copy["views"][0]
    etag = {"If-Match": copy["etag"]}
    edited = team.ask("berta", "PATCH", f"/views/{view['id']}/ball", {"box": BALL}, **etag)
    assert edited.status_code == 200, edited.text
    assert "613.25" in team.ask("berta", "GET", f"/groups/{copy['id']}").text
    begun(team, "anna")

    dataset = copy["dataset"]
    assert dataset["id"] > COPIES
    named = {"group": copy["id"], "view": view["id"], "station": view["station"]["id"]}
    asked, seen = 0, set()
    for row in rows():
        if row.method != "GET" or row.kind == "stream" or not str(row.path).startswith(API):
            continue
        for whose in (dataset["id"], dataset["name"], "demo"):
            path = {**dict.fromkeys(("tab", "digest", "figure", "table"), "1"), **named}
            path |= {"dataset": str(whose), "ending": "csv"}
            target = row.target({name: str(value) for name, value in path.items()})
            for query in ("", f"?dataset={whose}"):
                answer = team.ask("anna", "GET", target.removeprefix(API) + query)
                told = [
                    word for word in WORDS if word in answer.text and word not in target + query
                ]
                assert not told, (target, query, told, answer.text[:300])
                about_copy = any(f"{{{name}}}" in row.path for name in named)
                # Some need another query, and say so before they look for the copy.
                refused = answer.status_code in (404, 422)
                assert refused or not about_copy, (target, answer.status_code)
                assert answer.status_code < 500, target
                seen.add(answer.status_code)
                asked += 1
    assert asked > 200 and 200 in seen


def test_its_person_and_the_leads_see_it_and_no_list_has_it(team: Apart) -> None:
    copy = begun(team, "berta")
    begun(team, "anna")
    at = f"/groups/{copy['id']}"
    assert [team.ask(name, "GET", at).status_code for name in ("berta", "lea", "anna")] == [
        200,
        200,
        404,
    ]
    for name in ("berta", "lea", "anna"):
        names = [one["name"] for one in team.ask(name, "GET", "/datasets").json()["items"]]
        assert names == ["demo"]
    mine = team.ask("anna", "GET", "/datasets/demo/independent-annotations").json()["items"]
    every = team.ask("lea", "GET", "/datasets/demo/independent-annotations").json()["items"]
    assert {one["person"] for one in mine} <= {"anna"}
    assert "berta" in {one["person"] for one in every}
    for target in (f"{at}/submission", f"{at}/adoption", f"{at}/return"):
        assert team.ask("anna", "POST", target).status_code == 404
    taken = team.ask("berta", "POST", f"{at}/submission")
    assert taken.status_code == 200, taken.text
    assert team.ask("berta", "POST", f"{at}/adoption").status_code == 403
    adopted = team.ask("lea", "POST", f"{at}/adoption")
    assert adopted.status_code == 200, adopted.text
    assert json.loads(adopted.text)["id"] == 1


def test_an_annotator_does_not_learn_what_others_made_of_a_group(team: Apart) -> None:
    begun(team, "berta")
    for query in (
        "annotations:waiting",
        "status:unreviewed -annotations:none",
        "submissions>=1",
        "takes>=1",
    ):
        for target in ("/groups?dataset=demo", "/groups/ids?dataset=demo", "/groups/1/neighbours?"):
            told = team.ask("olaf", "GET", f"{target}&q={quote(query)}")
            assert told.status_code == 403, "an annotator does not learn what others made of it"
    rows = [
        team.ask(name, "GET", "/groups?dataset=demo").json()["items"] for name in ("olaf", "lea")
    ]
    assert [rows[0][0]["submissions"] is None, rows[1][0]["submissions"] is None] == [True, False]


ASKS = "id:1 submissions>=0"
"""Of which the number of groups answers what others made of one."""


def queries_in(document: dict[str, Any]) -> Iterator[tuple[str, str, str, tuple[str, ...]]]:
    """Method, address, place (``query`` or ``body``) and way to each query that a request can hold."""
    for path, operations in document["paths"].items():
        for method, operation in operations.items():
            for item in operation.get("parameters", []):
                if item["in"] == "query" and item["name"] in QUERIES:
                    yield method.upper(), path, "query", (item["name"],)
            content = operation.get("requestBody", {}).get("content", {})
            schema = content.get("application/json", {}).get("schema", {})
            for way in _ways(document, schema, ()):
                yield method.upper(), path, "body", way


def _ways(document: dict[str, Any], schema: Any, way: tuple[str, ...]) -> Iterator[tuple[str, ...]]:
    if len(way) > 5 or not isinstance(schema, dict):
        return
    if "$ref" in schema:
        schema = document["components"]["schemas"][schema["$ref"].rpartition("/")[2]]
    for one in (*schema.get("anyOf", []), *schema.get("oneOf", []), *schema.get("allOf", [])):
        yield from _ways(document, one, way)
    for name, inner in schema.get("properties", {}).items():
        if name in QUERIES:
            yield (*way, name)
        yield from _ways(document, inner, (*way, name))


def with_query(team: Apart, asked: tuple[str, str, str, tuple[str, ...]], query: str) -> Any:
    """The arguments of a request about the dataset that holds a query there."""
    method, path, place, way = asked
    target = path.removeprefix(API).replace("{dataset}", "demo").replace("{group}", "1")
    if place == "query":
        return method, f"{target}?dataset=demo&{way[0]}={quote(query)}", None
    body: Any = query
    for name in reversed(way):
        body = {name: body}
    return method, target, {"dataset": "demo", **body} if path.startswith(f"{API}/pred") else body


class TestQueries:
    def test_every_place_that_takes_one_applies_the_rule_of_who_asks(self, team: Apart) -> None:
        places = list(queries_in(openapi_of(team.app)))
        assert len({path for _, path, _, _ in places}) > 10
        assert {place for _, _, place, _ in places} == {"query", "body"}
        for asked in places:
            for name in ("vera", "olaf"):
                answer = team.ask(name, *with_query(team, asked, ASKS))
                assert answer.status_code == 403, (asked, name, answer.text[:200])
            if PERMISSIONS[f"{asked[0]} {asked[1]}"].action is Action.READ:
                method, target, _ = with_query(team, asked, "id:1")
                assert team.ask("vera", method, target).status_code in (200, 422), asked

    def test_what_a_lead_stored_counts_for_nobody_who_may_not_ask_it(self, team: Apart) -> None:
        at = "/datasets/demo"
        stored = {"name": "asked by a lead", "q": ASKS}
        view = team.ask("lea", "POST", f"{at}/saved-views", stored)
        assert view.status_code == 201 and view.json()["groups"] == 1
        plain = team.ask("lea", "POST", f"{at}/saved-views", {"name": "plain", "q": "id:1"})
        batch = team.ask("lea", "POST", f"{at}/batches", {**stored, "skip_given": False}).json()
        bulk = {"q": ASKS, "state": "deferred"}
        assert team.ask("lea", "POST", f"{at}/verdicts", bulk).json()["changed"] == 1
        for name in ("vera", "olaf"):
            for target in (f"{at}/saved-views", f"{at}/batches", f"{at}/verdict-batches"):
                assert "submissions" not in team.ask(name, "GET", target).text, (name, target)
            assert "submissions" not in team.ask(name, "GET", f"/batches/{batch['id']}").text
            hidden = f"/saved-views/{view.json()['id']}"
            assert team.ask(name, "GET", hidden).status_code == 404
            assert team.ask(name, "GET", f"/saved-views/{plain.json()['id']}").status_code == 200
        assert team.ask("olaf", "DELETE", hidden).status_code == 404
        assert "submissions" in team.ask("anna", "GET", f"{at}/saved-views").text
        assert team.ask("lea", "DELETE", hidden).status_code == 200
