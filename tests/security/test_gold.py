"""Gold groups: an annotator who plays the cheat does not find which of their copies are of gold groups."""

from __future__ import annotations

import hashlib
import json
import re
from collections.abc import Iterator
from dataclasses import dataclass, field, replace
from pathlib import Path
from random import Random
from typing import Any, ClassVar

import cv2
import numpy as np
import pytest

from app.features.imports.ingest import import_groups
from app.features.independent_annotations import known_truth as mixing
from app.features.independent_annotations.queries import GOLD, read_annotations
from app.features.people.roles import Role
from app.features.solutions.service import solve_dataset
from app.soccer.group import Media
from tests.scenes import make_scenes
from tests.security.apart import API, BODIES, Apart, opened
from tests.security.cheat import features_of, in_order, telling
from tests.security.table import rows

ORDINARY = GOLDEN = 16
OTHERS = 3
BALL = [613.25, 301.75, 9.5, 9.5]
SAID = {
    f"PATCH {API}/views/{{view}}/ball": {"box": [*BALL[:3], 30.0]},
    f"PATCH {API}/views/{{view}}": {"included": False},
    f"PUT {API}/groups/{{group}}/verdict": {"state": "deferred"},
    f"POST {API}/groups/{{group}}/return": {"reason": "mine"},
    f"POST {API}/batches/{{batch}}/groups/{{group}}/return": {"reason": "mine"},
}
"""Bodies with which routes get to what they would change."""
PEOPLE = {"olaf": Role.ANNOTATOR, "rita": Role.REVIEWER, "anna": Role.ANNOTATOR}


@dataclass
class Played:
    """What a cheat has found.

    Attributes:
        copies: Ids of the copies in order.
        found: Every feature of each.
        gold: Whether it is of a gold group, as the database knows.
        numbers: Place of each one's original in its match: who knows the match sees it in the picture.
        pictures: Digests of what the views of each show.
        originals: Id of each one's original.
    """

    copies: list[int] = field(default_factory=list)
    found: list[dict[str, Any]] = field(default_factory=list)
    gold: list[bool] = field(default_factory=list)
    numbers: list[int] = field(default_factory=list)
    pictures: list[set[str]] = field(default_factory=list)
    originals: list[int] = field(default_factory=list)


@dataclass(frozen=True)
class Gold:
    """A server, and the groups of its dataset that are given out, are gold, and are neither."""

    team: Apart
    ordinary: list[int]
    golden: list[int]
    others: list[int]


def ingested(team: Apart, files: Path) -> list[int]:
    """Ids of groups whose every view shows another picture."""
    scenes = make_scenes(groups=ORDINARY + GOLDEN + OTHERS, seed=5, faults=False)
    groups = []
    for number, scene in enumerate(scenes):
        views = []
        for place, view in enumerate(scene.group.views):
            path = files / f"{number}-{place}.png"
            shade = (number, place, 7)
            image = np.full((view.size.height, view.size.width, 3), shade, np.uint8)
            path.write_bytes(cv2.imencode(".png", image)[1].tobytes())
            views.append(replace(view, media=Media(str(path))))
        groups.append(replace(scene.group, views=tuple(views)))
    import_groups(team.store, "demo", groups, source="files", actor="local")
    solve_dataset(team.store, "demo")
    return list(range(1, len(groups) + 1))


def marked(team: Apart, groups: list[int]) -> None:
    """Make groups gold, as a lead does."""
    for group in groups:
        etag = team.ask("lea", "GET", f"/groups/{group}").json()["etag"]
        said = {"state": "accepted", "note": "seen"}
        judged = team.ask("lea", "PUT", f"/groups/{group}/verdict", said, **{"If-Match": etag})
        assert judged.status_code == 200, judged.text
        made = team.ask("lea", "PUT", f"/groups/{group}/gold", {"start": "without_balls"})
        assert made.status_code == 200, made.text


def give_out(team: Apart, person: str, groups: list[int]) -> int:
    """Id of a batch in which a person annotates groups among as many gold ones."""
    body = {
        "name": f"of {person}",
        "q": f"id:{','.join(map(str, groups))}",
        "annotators": [person],
        "skip_given": False,
        "gold_every": 2,
    }
    made = team.ask("lea", "POST", "/datasets/demo/batches", body)
    assert made.status_code == 201, made.text
    return int(made.json()["id"])


def snapshot(team: Apart, person: str, named: dict[str, str], *, about: bool) -> dict[str, Any]:
    """Every answer to a question about a copy, or about everything else, feature by feature."""
    found: dict[str, Any] = {}
    for row in rows():
        if row.method != "GET" or row.kind == "stream" or not row.path.startswith(API):
            continue
        if any(f"{{{name}}}" in row.path for name in ("group", "view", "station")) != about:
            continue
        targets = [
            row.target({**dict.fromkeys(("tab", "digest", "figure", "table"), "1"), **named})
        ]
        if row.path == f"{API}/groups":
            targets = [f"{API}/groups?dataset=demo", f"{API}/groups?dataset={named['copies']}"]
        if row.path in (f"{API}/groups/ids", f"{API}/findings", f"{API}/exports", f"{API}/jobs"):
            targets = [f"{row.path}?dataset=demo"]
        for place, target in enumerate(targets):
            answer = team.ask(person, "GET", target.removeprefix(API))
            assert answer.status_code < 500, (target, answer.text)
            found |= features_of(f"{row.path} {place or ''}".strip(), answer)
    return found


def refusals(team: Apart, person: str, copy: int, batch: str) -> dict[str, Any]:
    """What every route that changes something answers about a copy, its ids and times left out."""
    found: dict[str, Any] = {}
    for row in rows():
        named = {*row.parameters} & {"group", "view", "station"}
        if not row.changes or not row.path.startswith(API) or not named or "saved" in row.path:
            continue
        document = team.ask(person, "GET", f"/groups/{copy}").json()
        view = document["views"][0]
        ids = {"group": copy, "view": view["id"], "station": view["station"]["id"]}
        texts = {name: str(number) for name, number in ids.items()}
        target = row.target({**texts, "batch": batch}).removeprefix(API)
        body = SAID.get(str(row), BODIES.get(str(row), {}))
        for etag in ({"If-Match": document["etag"]}, {}):
            answer = team.ask(person, row.method, target, body, **etag)
            if answer.status_code < 400:
                continue
            said = answer.json()
            said.pop("instance", None), said.pop("request_id", None)
            text = json.dumps(said, sort_keys=True)
            for name, number in ids.items():
                text = re.sub(rf"(?<![\d.]){number}(?![\d.])", name, text)
            text = re.sub(r"\d+-\d+", "label", text)
            found[f"{row} {len(etag)}"] = (answer.status_code, text)
    return found


def pictures_of(team: Apart, person: str, document: dict[str, Any]) -> set[str]:
    """Digests of what the views of a group show."""
    found = set()
    for view in document["views"]:
        shown = team.ask(person, "GET", f"/views/{view['id']}/image")
        if shown.status_code == 200:
            found.add(hashlib.sha256(shown.content).hexdigest())
    return found


def play(team: Apart, person: str, batch: int) -> Played:
    """Annotate a whole batch, and look at every answer before and after each submission."""
    played = Played()
    named = {"batch": str(batch), "dataset": "demo", "ending": "csv", "copies": "1"}
    while True:
        come = team.ask(person, "POST", f"/batches/{batch}/next", {})
        assert come.status_code == 200, come.text
        if come.json()["group"] is None:
            break
        copy = come.json()["group"]
        document = team.ask(person, "GET", f"/groups/{copy}").json()
        view = document["views"][0]
        named |= {"group": str(copy), "view": str(view["id"])}
        named |= {"station": str(view["station"]["id"]), "copies": str(document["dataset"]["id"])}
        found = features_of("next", come) | snapshot(team, person, named, about=True)
        etag = {"If-Match": document["etag"]}
        drawn = team.ask(person, "PATCH", f"/views/{view['id']}/ball", {"box": BALL}, **etag)
        assert drawn.status_code == 200, drawn.text
        done = team.ask(person, "PUT", f"/batches/{batch}/groups/{copy}/submission")
        assert done.status_code == 200, done.text
        found |= features_of("hand-in", done)
        for about in (True, False):
            later = snapshot(team, person, named, about=about)
            found |= {f"later {name}": value for name, value in later.items()}
        played.copies.append(copy)
        played.found.append(found)
        played.pictures.append(pictures_of(team, person, document))
    with team.store.read() as session:
        takes = {take.copy_id: take for take in read_annotations(session, 1, person)}
    for copy in played.copies:
        played.gold.append(takes[copy].kind == GOLD)
        played.originals.append(takes[copy].group_id)
        played.numbers.append(takes[copy].group_id)
    return played


@pytest.fixture(scope="module")
def made(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Gold]:
    with opened(tmp_path_factory.mktemp("gold")) as team, pytest.MonkeyPatch.context() as patch:
        chance = Random(11)
        patch.setattr(mixing, "SystemRandom", lambda: chance)
        mixed = Random(2).sample(ids := ingested(team, tmp_path_factory.mktemp("frames")), len(ids))
        team.add("lea", Role.NONE, demo=Role.LEAD)
        for name, role in PEOPLE.items():
            team.add(name, role)
        golden = sorted(mixed[ORDINARY : ORDINARY + GOLDEN])
        marked(team, golden)
        yield Gold(team, sorted(mixed[:ORDINARY]), golden, sorted(mixed[ORDINARY + GOLDEN :]))


@pytest.fixture(scope="module")
def played(made: Gold) -> Played:
    """What olaf found who annotates a whole batch."""
    return play(made.team, "olaf", give_out(made.team, "olaf", made.ordinary))


class TestGold:
    def test_no_answer_tells_which_copies_are_of_gold_groups(self, played: Played) -> None:
        assert played.gold.count(True) == GOLDEN and played.gold.count(False) == ORDINARY
        assert len(played.found[0]) > 500
        assert telling(played.found, played.gold) == {}

    def test_the_order_tells_nothing_to_who_knows_the_match(self, played: Played) -> None:
        marks = [{"in order": mark} for mark in in_order(played.numbers)]
        assert telling(marks, played.gold) == {}

    def test_no_picture_of_a_copy_is_found_elsewhere(self, made: Gold, played: Played) -> None:
        ask, mine = made.team.ask, set[int]()
        for copy in played.copies:
            views = ask("olaf", "GET", f"/groups/{copy}").json()["views"]
            mine |= {view["id"] for view in views}
        for group in range(1, ORDINARY + GOLDEN + OTHERS + 1):
            status = ask("olaf", "GET", f"/groups/{group}").status_code
            assert status == (200 if group in made.others else 404), group
        shown, most = set(), max(mine)
        for view in {*range(1, most + 1)} - mine:
            answer = ask("olaf", "GET", f"/views/{view}/image")
            if answer.status_code == 200:
                shown.add(hashlib.sha256(answer.content).hexdigest())
        assert shown and all(pictures and not pictures & shown for pictures in played.pictures)

    def test_lists_and_counts_are_without_what_is_hidden(self, made: Gold, played: Played) -> None:
        person = "olaf"
        ask = made.team.ask
        asked = {
            "/groups?dataset=demo": lambda found: [one["id"] for one in found["items"]],
            "/groups/ids?dataset=demo": lambda found: found["ids"],
            "/datasets/demo/timeline": lambda found: found["id"],
        }
        for target, ids in asked.items():
            assert sorted(ids(ask(person, "GET", target).json())) == made.others, target
        counts = {
            "/datasets/demo": lambda found: found["groups"],
            "/datasets/demo/summary": lambda found: found["progress"]["groups"],
            "/datasets/demo/statistics": lambda found: found["groups"],
            "/datasets": lambda found: found["items"][0]["groups"],
        }
        for target, count in counts.items():
            assert count(ask(person, "GET", target).json()) == OTHERS, target
            every = ORDINARY + GOLDEN + OTHERS
            assert count(ask("lea", "GET", target).json()) == every, target
        told = {name: ask(name, "GET", "/datasets/demo").json() for name in (person, "lea")}
        assert [told[name]["hides_groups"] for name in (person, "lea")] == [True, False]
        name = {"name": "of all", "q": ""}
        assert ask("lea", "POST", "/datasets/demo/saved-views", name).json()["groups"] == every
        (view,) = ask(person, "GET", "/datasets/demo/saved-views").json()["items"]
        assert view["groups"] == OTHERS

    def test_edits_of_many_views_know_nothing_of_what_is_hidden(
        self, made: Gold, played: Played
    ) -> None:
        ask = made.team.ask
        for group in (made.golden[0], made.ordinary[0]):
            document = ask("lea", "GET", f"/groups/{group}").json()
            number, key, view = document["id"], document["key"], document["views"][0]
            items = [
                {"view": view["id"], "ball": None},
                {"view": 10**9, "ball": None},
                {"group": key, "view": view["key"], "ball": None},
                {"group": "nowhere", "view": view["key"], "ball": None},
            ]
            for target in ("/datasets/demo/edits", "/datasets/demo/edits?dry_run=true"):
                body = {"if_match": "*", "items": items}
                told = ask("olaf", "POST", target, body).json()["items"]
                for one in told:
                    for name in (str(view["id"]), str(10**9), key, "nowhere"):
                        one["problem"] = one["problem"].replace(f"view {name} ", "view # ")
                        one["problem"] = one["problem"].replace(f"group {name} ", "group # ")
                    del one["index"], one["pointer"]
                assert told[0] == told[1] and told[2] == told[3]
                assert {one["status"] for one in told} == {404}
            assert ask("lea", "GET", f"/groups/{number}").json()["etag"] == document["etag"]

    def test_what_was_submitted_is_opened_by_no_route(self, made: Gold, played: Played) -> None:
        person, cheat = "olaf", played
        ask = made.team.ask
        with made.team.store.read() as session:
            before = read_annotations(session, 1, person)
        for copy in (cheat.copies[cheat.gold.index(True)], cheat.copies[cheat.gold.index(False)]):
            document = ask(person, "GET", f"/groups/{copy}").json()
            etag = {"If-Match": document["etag"]}
            view, batch = document["views"][0]["id"], before[0].batch_id
            dataset, state = document["dataset"]["id"], {"state": "unreviewed"}
            tried = [
                ("PATCH", f"/views/{view}/ball", {"box": [*BALL[:3], 30.0]}),
                ("PATCH", f"/views/{view}", {"included": False}),
                ("POST", f"/groups/{copy}/undo", None),
                ("POST", f"/groups/{copy}/redo", None),
                ("POST", f"/groups/{copy}/submission", None),
                ("POST", f"/groups/{copy}/return", {"reason": "mine"}),
                ("DELETE", f"/batches/{batch}/groups/{copy}/submission", None),
                ("PUT", f"/batches/{batch}/groups/{copy}/submission", None),
                ("POST", f"/batches/{batch}/groups/{copy}/return", {"reason": "mine"}),
                ("PUT", f"/groups/{copy}/verdict", state),
                ("PUT", f"/groups/{copy}/verdict", {"state": "deferred"}),
                ("POST", f"/datasets/{dataset}/verdicts", {"q": f"id:{copy}", "state": "deferred"}),
            ]
            for method, target, body in tried:
                answer = ask(person, method, target, body, **etag)
                assert answer.status_code in (403, 404, 409), (target, answer.status_code)
            bulk = {"if_match": "*", "items": [{"view": view, "ball": None}]}
            (one,) = ask(person, "POST", f"/datasets/{dataset}/edits", bulk).json()["items"]
            assert (one["outcome"], one["status"]) == ("refused", 409)
        with made.team.store.read() as session:
            assert read_annotations(session, 1, person) == before

    def test_every_refused_change_of_a_copy_reads_the_same(
        self, made: Gold, played: Played
    ) -> None:
        with made.team.store.read() as session:
            takes = {take.copy_id: take for take in read_annotations(session, 1, "olaf")}
        gold = played.copies[played.gold.index(True)]
        ordinary = played.copies[played.gold.index(False)]
        assert (takes[gold].settled, takes[ordinary].settled is None) == (None, False)
        batch = str(takes[gold].batch_id)
        told, other = (refusals(made.team, "olaf", copy, batch) for copy in (gold, ordinary))
        assert told == other
        submitted = "this annotation was submitted, and can no longer be changed"
        assert sum(submitted in str(said) for said in told.values()) >= 8


class TestReviewers:
    def test_who_judges_sees_no_original_while_they_have_something_to_annotate(
        self, made: Gold
    ) -> None:
        ask, groups = made.team.ask, made.ordinary[:2]
        batch = give_out(made.team, "rita", groups)
        for _ in range(2 * len(groups)):
            copy = ask("rita", "POST", f"/batches/{batch}/next", {}).json()["group"]
            for group in (*groups, *made.golden):
                assert ask("rita", "GET", f"/groups/{group}").status_code == 404
            assert ask("rita", "GET", "/datasets/demo/versions").status_code == 403
            told = {
                ask("rita", "POST", f"/batches/{batch}/groups/{group}/return", {"reason": "mine"})
                .json()["detail"]
                .replace(f"group {group}", "group #")
                for group in (*groups, made.golden[0], made.others[0], 10**6)
            }
            assert len(told) == 1 and "has no group #" in told.pop()
            assert ask("rita", "POST", f"/groups/{copy}/submission").status_code == 200
        assert ask("rita", "POST", f"/batches/{batch}/next", {}).json()["group"] is None
        assert ask("rita", "GET", f"/groups/{groups[0]}").status_code == 200

    def test_ordinary_work_in_the_same_dataset_goes_on_without_what_is_hidden(
        self, made: Gold
    ) -> None:
        ask, other = made.team.ask, made.others[0]
        blind = give_out(made.team, "anna", made.ordinary[3:5])
        groups = ",".join(map(str, [made.golden[0], made.ordinary[3], other]))
        body = {"name": "plain", "q": f"id:{groups}", "annotators": ["anna"], "skip_given": False}
        plain = ask("lea", "POST", "/datasets/demo/batches", body).json()["id"]
        given = ask("anna", "POST", f"/batches/{plain}/next", {}).json()["group"]
        assert given == other and ask("anna", "GET", f"/groups/{other}").status_code == 200
        # What is hidden counts in no batch.
        seen = ask("anna", "GET", f"/batches/{plain}").json()
        assert (seen["groups"], seen["waiting"]) == (1, 1)
        assert ask("lea", "GET", f"/batches/{plain}").json()["groups"] == 3
        work = {one["batch"]["id"]: one for one in ask("anna", "GET", "/work").json()["items"]}
        assert work[plain]["left"] == 1
        # She annotates copies of the one, and the groups themselves of the other.
        assert [work[batch]["hides_groups"] for batch in (blind, plain)] == [True, False]
        # Nor are the originals opened by the batch whose copies she annotates.
        for target in ("submission", "lease"):
            at = f"/batches/{blind}/groups/{made.ordinary[3]}/{target}"
            assert ask("anna", "PUT", at, {} if target == "lease" else None).status_code == 404
        # Nor those that another batch has, too.
        for hidden in (made.golden[0], made.ordinary[3]):
            at = f"/batches/{plain}/groups/{hidden}"
            for method, target in (
                ("PUT", "lease"),
                ("PUT", "submission"),
                ("DELETE", "submission"),
            ):
                refused = ask("anna", method, f"{at}/{target}", {} if target == "lease" else None)
                assert refused.status_code == 404, (hidden, method, target)
            assert ask("anna", "DELETE", f"{at}/lease").status_code == 204
        seen = ask("anna", "GET", f"/groups/{other}").json()
        key = ask("lea", "GET", f"/groups/{made.golden[0]}").json()["key"]
        told = set()
        for name in (key, "nowhere"):
            item = {"view": seen["views"][0]["id"], "ball": {"box": BALL, "followed_from": name}}
            body = {"if_match": "*", "items": [item]}
            answer = ask("anna", "POST", "/datasets/demo/edits", body)
            said = answer.json()
            told.add((answer.status_code, said["pointer"], said["hint"]))
        assert len(told) == 1, told
        for batch in (blind, plain):
            assert ask("lea", "PATCH", f"/batches/{batch}", {"state": "closed"}).status_code == 200

    def test_a_token_for_one_dataset_is_given_no_copy(self, made: Gold) -> None:
        ask = made.team.ask
        batch = give_out(made.team, "anna", made.ordinary[3:5])
        new = {"name": "near", "scopes": ["annotate"], "dataset": "demo"}
        token = ask("anna", "POST", "/tokens", new).json()["text"]
        copy = ask("anna", "POST", f"/batches/{batch}/next", {}).json()["group"]
        for method, target, body in (
            ("POST", f"/batches/{batch}/next", {}),
            ("PUT", f"/batches/{batch}/groups/{copy}/lease", {}),
            ("PUT", f"/batches/{batch}/groups/{copy}/submission", None),
            ("POST", f"/groups/{made.others[0]}/independent-annotations", None),
        ):
            answer = ask("anna", method, target, body, Authorization=f"Bearer {token}", Cookie="")
            assert answer.status_code == 403, (target, answer.text)
            assert "does not reach independent annotations" in answer.json()["detail"]
        closed = ask("lea", "PATCH", f"/batches/{batch}", {"state": "closed"})
        assert closed.status_code == 200

    def test_a_closed_batch_hides_nothing(self, made: Gold) -> None:
        ask, groups = made.team.ask, made.ordinary[2:3]
        batch = give_out(made.team, "anna", groups)
        assert ask("anna", "GET", f"/groups/{groups[0]}").status_code == 404
        closed = ask("lea", "PATCH", f"/batches/{batch}", {"state": "closed"})
        assert closed.status_code == 200
        assert ask("anna", "GET", f"/groups/{groups[0]}").status_code == 200
        assert ask("anna", "GET", "/datasets/demo").json()["hides_groups"] is False


class TestTelling:
    """A planted leak of each kind is found, and chance is not."""

    GOLD: ClassVar = [bool(one) for one in Random(3).sample([0, 1] * ORDINARY, 2 * ORDINARY)]

    @pytest.mark.parametrize(
        "leak",
        [
            lambda place, gold: {"settled": None if gold else f"2026-11-{place}"},
            lambda place, gold: {"balls#": 0 if gold else 2},
            lambda place, gold: {"kind": "gold" if gold else "independent"},
            lambda place, gold: {"sigma": place * 0.01 + (5 if gold else 0)},
            lambda place, gold: {"extra": 1} if gold else {},
        ],
    )
    def test_a_field_that_differs_is_found(self, leak: Any) -> None:
        found = [{"place": at, **leak(at, gold)} for at, gold in enumerate(self.GOLD)]
        assert telling(found, self.GOLD)

    def test_numbers_that_go_on_by_more_are_found(self) -> None:
        identity, found = 0, []
        for gold in self.GOLD:
            identity += 1 if gold else 4
            found.append({"id": identity})
        assert telling(found, self.GOLD)

    def test_an_order_that_is_interrupted_is_found(self) -> None:
        chance, ordinary = Random(5), iter(range(0, 1000, 20))
        numbers = [chance.randrange(1000) if gold else next(ordinary) for gold in self.GOLD]
        marks = [{"in order": mark} for mark in in_order(numbers)]
        assert telling(marks, self.GOLD)

    def test_chance_tells_nothing(self) -> None:
        chance = Random(9)
        found = [
            {"place": at, **{f"n{name}": chance.random() for name in range(200)}}
            for at, _ in enumerate(self.GOLD)
        ]
        assert telling(found, self.GOLD) == {}
