"""Own annotations: every route, asked by somebody else for another one's copy, tells nothing of it."""

from __future__ import annotations

import json
from collections.abc import Iterator
from urllib.parse import quote

import pytest

from app.review.editing.recompute import solve_dataset
from app.review.importing.ingest import ingest
from app.review.people.roles import Role
from app.store.sight import COPIES
from tests.scenes import make_scenes
from tests.security.apart import API, Apart, opened
from tests.security.table import rows

BALL = [613.25, 301.75, 9.5, 9.5]
WORDS = ("613.25", "301.75", "berta")
"""What berta said, and her name, which her copies are called by."""


@pytest.fixture(scope="module")
def team(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Apart]:
    with opened(tmp_path_factory.mktemp("blind")) as made:
        group = make_scenes(groups=1, seed=3, faults=False)[0].group
        ingest(made.store, "demo", [group], source="files", actor="local")
        solve_dataset(made.store, "demo")
        made.add("lea", Role.NONE, demo=Role.LEAD)
        made.add("anna", Role.REVIEWER)
        made.add("olaf", Role.ANNOTATOR)
        made.add("berta", Role.NONE, demo=Role.REVIEWER)
        yield made


def begun(team: Apart, name: str) -> dict[str, object]:
    """The document of somebody's own copy of the one group."""
    take = team.ask(name, "POST", "/groups/1/takes")
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
    at = f"/groups/{copy['id']}"
    assert [team.ask(name, "GET", at).status_code for name in ("berta", "lea", "anna")] == [
        200,
        200,
        404,
    ]
    for name in ("berta", "lea", "anna"):
        names = [one["name"] for one in team.ask(name, "GET", "/datasets").json()["items"]]
        assert names == ["demo"]
    mine = team.ask("anna", "GET", "/datasets/demo/takes").json()["items"]
    every = team.ask("lea", "GET", "/datasets/demo/takes").json()["items"]
    assert {one["person"] for one in mine} <= {"anna"}
    assert "berta" in {one["person"] for one in every}
    for target in (f"{at}/hand-in", f"{at}/adoption", f"{at}/hand-back"):
        assert team.ask("anna", "POST", target).status_code == 404
    taken = team.ask("berta", "POST", f"{at}/hand-in")
    assert taken.status_code == 200, taken.text
    assert team.ask("berta", "POST", f"{at}/adoption").status_code == 403
    adopted = team.ask("lea", "POST", f"{at}/adoption")
    assert adopted.status_code == 200, adopted.text
    assert json.loads(adopted.text)["id"] == 1


def test_an_annotator_does_not_learn_what_others_made_of_a_group(team: Apart) -> None:
    begun(team, "berta")
    for query in ("annotations:waiting", "status:unreviewed -annotations:none", "takes>=1"):
        for target in ("/groups?dataset=demo", "/groups/ids?dataset=demo", "/groups/1/neighbours?"):
            told = team.ask("olaf", "GET", f"{target}&q={quote(query)}")
            assert told.status_code == 403, "an annotator does not learn what others made of it"
    rows = [
        team.ask(name, "GET", "/groups?dataset=demo").json()["items"] for name in ("olaf", "lea")
    ]
    assert [rows[0][0]["takes"] is None, rows[1][0]["takes"] is None] == [True, False]
