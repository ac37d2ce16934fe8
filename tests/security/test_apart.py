"""Every route with every role in one dataset: another one is not there, whatever is asked of it."""

from __future__ import annotations

import re
from collections.abc import Iterator
from typing import Any

import pytest

from app.features.datasets.queries import list_group_ids
from app.features.datasets.service import insert_dataset
from app.features.imports.ingest import import_groups
from app.features.jobs.queries import NewJob, insert_job, update_job
from app.features.people.ownership import OwnedKind
from app.features.people.queries import find_person_by_name, set_dataset_role
from app.features.people.roles import Action, Role
from app.soccer.policy import TOUCHLINE
from tests.openapi import openapi_of
from tests.scenes import make_scenes
from tests.security.apart import (
    API,
    MINE,
    NO_ID,
    PERMISSIONS,
    THEIRS,
    Apart,
    Mentioned,
    mentioned,
    opened,
)
from tests.security.table import Row, body_model, places_of_files, rows

COPY, PRACTICE = "a copy", "a practice"
RANKS = [role.value for role in Role]
DATA = [
    row
    for row in rows()
    if row.kind != "stream"
    and (permission := PERMISSIONS.get(str(row))) is not None
    and permission.action not in (None, Action.ACCOUNT, Action.ADMINISTER)
]
"""Routes about datasets. An open stream has a test of its own."""
ABOUT = [row for row in DATA if mentioned(row)]


@pytest.fixture(scope="module")
def apart(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Apart]:
    with opened(tmp_path_factory.mktemp("apart")) as made:
        made.add("admin", Role.ADMIN)
        made.add("mine-lead", Role.LEAD)
        made.add("other-lead", Role.LEAD)
        made.fill()
        for role in ("viewer", "annotator", "reviewer", "lead"):
            made.add(role, Role.NONE, **{MINE: Role(role)})
        made.add("all-but", Role.LEAD, **{THEIRS: Role.NONE})
        # With the same role in every dataset, and nothing of their own.
        for role in ("annotator", "reviewer", "lead"):
            made.add(f"{role}-everywhere", Role(role))
        made.add("owner", Role.ANNOTATOR)
        copy = made.ask("owner", "POST", "/groups/1/independent-annotations").json()
        made.fill_hidden(COPY, copy["group"])
        made.fill_hidden(PRACTICE, insert_practice_group(made, "owner"))
        yield made


def insert_practice_group(apart: Apart, person: str) -> int:
    """Id of the group of a dataset in which a person practises."""
    name = f"practice {person}"
    with apart.store.write() as session:
        made = insert_dataset(session, name, TOUCHLINE, person, hidden=True)
        row = find_person_by_name(session, person)
        assert row is not None
        set_dataset_role(session, row.id, made, Role.LEAD, by=person)
    group = make_scenes(groups=1, seed=4, faults=False)[0].group
    import_groups(apart.store, name, [group], source="files", actor=person)
    with apart.store.read() as session:
        return list_group_ids(session, made)[0]


def plain(answer: Any, apart: Apart, where: str) -> tuple[int, str]:
    """An answer without what is of this one request."""
    text = re.sub(r"urn:uuid:[0-9a-f-]+", "", answer.text)
    for kind in OwnedKind:
        value = str(apart.value(kind, where))
        text = re.sub(rf"(?<![\w-]){re.escape(value)}(?![\w-])", "*", text)
    return answer.status_code, text


def fields_of(schemas: dict[str, Any], schema: Any, way: tuple[str, ...] = ()) -> Iterator[str]:
    """The fields of a body, those of its objects and lists too: ``source/upload``."""
    if len(way) > 5 or not isinstance(schema, dict):
        return
    if "$ref" in schema:
        schema = schemas[schema["$ref"].rpartition("/")[2]]
    for word in ("anyOf", "oneOf", "allOf"):
        for one in schema.get(word, []):
            yield from fields_of(schemas, one, way)
    yield from fields_of(schemas, schema.get("items"), way)
    for name, inner in schema.get("properties", {}).items():
        yield "/".join((*way, name))
        yield from fields_of(schemas, inner, (*way, name))


class TestLists:
    @pytest.mark.parametrize("path", ["/datasets", "/jobs", "/exports", "/uploads"])
    def test_a_list_has_what_one_sees_and_counts_nothing_else(
        self, apart: Apart, path: str
    ) -> None:
        every = apart.ask("admin", "GET", path).json()["items"]
        seen = apart.ask("lead" if path == "/uploads" else "viewer", "GET", path).json()["items"]
        assert THEIRS in str(every)
        assert THEIRS not in str(seen)
        if path == "/uploads":
            assert seen == []
            assert len(apart.ask("mine-lead", "GET", path).json()["items"]) == 1
        else:
            assert 0 < len(seen) < len(every)

    def test_a_job_that_has_no_dataset_yet_is_its_makers(self, apart: Apart) -> None:
        upload = apart.ask("other-lead", "POST", "/uploads?name=new.zip", b"PK").json()["id"]
        body = {"format": "soccernet-v3", "source": {"upload": upload}, "dry_run": True}
        asked = apart.ask("other-lead", "POST", "/imports", {"dataset": "brand new", **body})
        number = asked.json()["id"]
        for name, seen in (("lead", False), ("mine-lead", False), ("other-lead", True)):
            listed = [one["id"] for one in apart.ask(name, "GET", "/jobs").json()["items"]]
            assert (number in listed) is seen, name
            status = apart.ask(name, "GET", f"/jobs/{number}").status_code
            assert status == (200 if seen else 404), name
        assert apart.ask("mine-lead", "GET", f"/uploads/{upload}").status_code == 404

    def test_what_is_left_of_a_dataset_that_is_gone_is_for_admins(self, apart: Apart) -> None:
        new = NewJob("solve", "Solve what is gone", "other-lead", dataset_id=NO_ID)
        with apart.store.write() as session:
            number = insert_job(session, new)
            update_job(session, number, state="done")
        for name, seen in (("all-but", False), ("other-lead", False), ("admin", True)):
            listed = [one["id"] for one in apart.ask(name, "GET", "/jobs").json()["items"]]
            assert (number in listed) is seen, name
            status = apart.ask(name, "GET", f"/jobs/{number}").status_code
            assert status == (200 if seen else 404), name

    def test_a_version_of_a_name_that_two_have_is_the_one_that_is_seen(self, apart: Apart) -> None:
        assert apart.ask("admin", "GET", "/versions/same").status_code == 400
        seen = apart.ask("viewer", "GET", "/versions/same")
        assert (seen.status_code, seen.json()["dataset"]) == (200, MINE)
        assert apart.ask("viewer", "GET", f"/versions/same?dataset={THEIRS}").status_code == 404

    def test_a_person_of_no_role_sees_an_empty_server(self, apart: Apart) -> None:
        apart.add("nobody-yet", Role.NONE)
        for path in ("/datasets", "/jobs", "/exports"):
            assert apart.ask("nobody-yet", "GET", path).json()["items"] == []
        assert apart.ask("nobody-yet", "POST", "/practice", {}).status_code == 403
        assert apart.ask("nobody-yet", "GET", "/session").json()["role"] == "none"


class TestMatrix:
    @pytest.mark.parametrize("row", ABOUT, ids=str)
    def test_what_is_of_another_dataset_is_as_what_is_not_there(
        self, apart: Apart, row: Row
    ) -> None:
        """Field by field, the others naming something of one's own."""
        for item in mentioned(row):
            if item.kind is OwnedKind.NEW_DATASET:
                continue
            for name in ("viewer", "lead", "all-but"):
                told = []
                for where in (THEIRS, ""):
                    told.append(self.ask_one(apart, name, row, item, where))
                assert told[0] == told[1], (row, item, name)
                assert told[0][0] in (403, 404, 422, 428), (row, item, name, told)
                assert told[0][0] != 403 or name == "viewer", (row, item, name, told)

    @pytest.mark.parametrize("row", ABOUT, ids=str)
    def test_what_others_have_for_themselves_is_as_what_is_not_there(
        self, apart: Apart, row: Row
    ) -> None:
        """Copies and practice, for whoever has the same role in every dataset."""
        for item in mentioned(row):
            if item.kind is OwnedKind.NEW_DATASET:
                continue
            for name in ("annotator-everywhere", "reviewer-everywhere", "lead-everywhere"):
                nothing = self.ask_one(apart, name, row, item, "")
                # Leads see the copies of what they lead.
                for whose in (PRACTICE,) if name == "lead-everywhere" else (COPY, PRACTICE):
                    found = self.ask_one(apart, name, row, item, whose)
                    assert found == nothing, (row, item, name)
                    assert found[0] in (403, 404, 422, 428), (row, item, name, found)

    def ask_one(
        self, apart: Apart, name: str, row: Row, item: Mentioned, where: str
    ) -> tuple[int, str]:
        named = {one.field: MINE for one in mentioned(row)} | {item.field: where}
        if item.field == "dataset" and item.place == "query" and row.kind != "change":
            named = dict.fromkeys(named, where)
        return plain(apart.answer(name, row, named), apart, where)

    @pytest.mark.parametrize("row", sorted(ABOUT, key=lambda row: row.method == "DELETE"), ids=str)
    def test_ones_own_is_there_for_whom_the_role_suffices(self, apart: Apart, row: Row) -> None:
        where = {item.field: MINE for item in mentioned(row)}
        least = RANKS.index(row.role)
        mine = {OwnedKind.UPLOAD, OwnedKind.NEW_DATASET} & {item.kind for item in mentioned(row)}
        if least > RANKS.index("viewer") and not mine:
            below = apart.answer(RANKS[least - 1], row, where)
            assert below.status_code == 403, (row, below.text)
            assert f"needs the role {row.role}" in below.text
        # An upload is its sender's, who is lead everywhere.
        enough = apart.answer("mine-lead" if mine else row.role, row, where)
        assert enough.status_code not in (401, 403), (row, enough.text)
        if enough.status_code == 404:
            # It has no picture, is no lesson, has no such prediction: said of what is there.
            nothing = apart.answer(row.role, row, dict.fromkeys(where, ""))
            assert plain(enough, apart, MINE) != plain(nothing, apart, ""), (row, enough.text)
        assert enough.status_code < 500, (row, enough.text)
        assert THEIRS not in enough.text, (row, enough.text)

    @pytest.mark.parametrize("row", [row for row in DATA if not mentioned(row)], ids=str)
    def test_what_is_about_no_dataset_tells_of_none_that_is_not_seen(
        self, apart: Apart, row: Row
    ) -> None:
        told = {"read": 200, "body": 422, "upload": 415}[row.kind]
        for name in ("viewer", "all-but"):
            answer = apart.answer(name, row, {})
            # That an upload is no bytes is seen before it is looked who sends it.
            above = name == "viewer" and RANKS.index(row.role) > RANKS.index("viewer")
            refused = above and row.kind != "upload"
            assert answer.status_code == (403 if refused else told), (row, answer.text)
            assert THEIRS not in answer.text, (row, answer.text)

    @pytest.mark.parametrize("name", ["viewer", "lead", "lead-everywhere"])
    def test_an_id_in_a_body_is_of_no_other_type_than_it_is_said(
        self, apart: Apart, name: str
    ) -> None:
        """Another writing of an id lets nobody come by what they do not see, nor by their own."""
        looked = 0
        for row in ABOUT:
            for item in mentioned(row):
                if item.place != "body":
                    continue
                for where in (MINE, THEIRS):
                    value = apart.value(item.kind, where)
                    others = [[value], {"id": value}, True]
                    others += [str(value), float(value)] if isinstance(value, int) else [1, 1.0]
                    for other in others:
                        named = {one.field: MINE for one in mentioned(row)}
                        answer = apart.answer(name, row, named, {item.field: other})
                        told = (row, item, other, answer.text)
                        assert answer.status_code in (403, 404, 422), told
                        looked += 1
        assert looked > 50

    def test_who_has_a_group_of_another_dataset_open_is_not_told_by_releasing_it(
        self, apart: Apart
    ) -> None:
        # One of its own: what the tests before ask of the other batches may have deleted them.
        named = {"name": "leases", "skip_given": False}
        mine = apart.ask("mine-lead", "POST", f"/datasets/{MINE}/batches", named).json()["id"]
        theirs, group = (apart.ids[THEIRS][kind] for kind in (OwnedKind.WORK, OwnedKind.GROUP))
        lease = f"/groups/{group}/lease"
        assert apart.ask("other-lead", "PUT", f"/batches/{theirs}{lease}", {}).status_code == 200
        for target in (lease, f"/groups/{NO_ID}/lease"):
            answer = apart.ask("mine-lead", "DELETE", f"/batches/{mine}{target}")
            assert (answer.status_code, answer.content) == (204, b"")


class TestNewDatasets:
    def test_whoever_leads_one_dataset_makes_no_other_and_learns_of_none(
        self, apart: Apart
    ) -> None:
        upload = apart.ask("lead", "POST", "/uploads?name=a.zip", b"PK").json()["id"]
        body = {"format": "soccernet-v3", "source": {"upload": upload}, "dry_run": True}
        told = []
        for dataset in (THEIRS, "quite new"):
            answer = apart.ask("lead", "POST", "/imports", {"dataset": dataset, **body})
            told.append((answer.status_code, re.sub("urn:uuid:.{36}", "", answer.text)))
        assert told[0] == told[1]
        assert told[0][0] == 403
        assert apart.ask("lead", "POST", "/imports", {"dataset": MINE, **body}).status_code == 202
        taken = apart.ask("all-but", "POST", "/imports", {"dataset": THEIRS, **body})
        assert (taken.status_code, "in which you have no role" in taken.text) == (403, True)

    def test_the_lines_of_an_import_are_ones_own(self, apart: Apart) -> None:
        mine = apart.ask("lead", "POST", "/uploads?name=c.zip", b"PK").json()["id"]
        theirs = {"upload": apart.value(OwnedKind.UPLOAD, THEIRS)}
        body = {"dataset": MINE, "format": "issia", "source": {"upload": mine}, "dry_run": True}
        told = apart.ask("lead", "POST", "/imports", {**body, "options": {"lines": theirs}})
        assert (told.status_code, "there is no upload" in told.text) == (404, True), told.text

    def test_folders_of_the_operator_are_for_leads_of_all_datasets(self, apart: Apart) -> None:
        upload = apart.ask("lead", "POST", "/uploads?name=b.zip", b"PK").json()["id"]
        folder, sent = {"folder": "x"}, {"upload": upload}
        for source, options in (
            (folder, {}),
            (sent, {"lines": folder}),
            (sent, {"frames": folder}),
            (sent, {"frames": sent}),
        ):
            body = {"dataset": MINE, "format": "issia", "source": source, "options": options}
            refused = apart.ask("lead", "POST", "/imports", {**body, "dry_run": True})
            assert (refused.status_code, "in all datasets" in refused.text) == (403, True)
        asked = {"dataset": MINE, "format": "issia", "source": folder, "dry_run": True}
        looked_for = apart.ask("mine-lead", "POST", "/imports", asked)
        assert (looked_for.status_code, "has allowed no folder" in looked_for.text) == (400, True)

    def test_what_others_have_uploaded_is_no_list_of_frames(self, apart: Apart) -> None:
        upload = apart.ask("mine-lead", "POST", "/uploads?name=c.zip", b"PK").json()["id"]
        body = {"dataset": MINE, "format": "coco", "source": {"upload": upload}, "dry_run": True}
        told = []
        for other in (apart.ids[THEIRS][OwnedKind.UPLOAD], "8" * 32):
            options = {"frames": {"upload": other}}
            answer = apart.ask("mine-lead", "POST", "/imports", {**body, "options": options})
            text = re.sub("urn:uuid:.{36}", "", answer.text).replace(other, "*")
            told.append((answer.status_code, text))
        assert told[0] == told[1]
        assert told[0][0] == 404

    def test_permissions_know_every_place_of_files_that_a_body_may_name(self) -> None:
        found = []
        for row in rows():
            permission, model = PERMISSIONS.get(str(row)), body_model(row)
            for place in [] if model is None or permission is None else places_of_files(model):
                found.append((str(row), place))
                assert permission.body.get(f"{place}/upload") is OwnedKind.UPLOAD, (row, place)
                kinds = {permission.body.get(place), permission.body.get(f"{place}/folder")}
                assert OwnedKind.FOLDER in kinds, (row, place)
        imports = [place for name, place in found if name == f"POST {API}/imports"]
        assert sorted(imports) == ["options/frames", "options/lines", "source"]
        assert (f"POST {API}/recordings", "source") in found


class TestMembers:
    def test_a_lead_gives_roles_in_their_own_dataset_alone_and_never_to_themselves(
        self, apart: Apart
    ) -> None:
        apart.add("newcomer", Role.NONE)
        people = apart.ask("lead", "GET", f"/datasets/{MINE}/members").json()["items"]
        ids = {one["name"]: one["id"] for one in people}
        at, role = f"/datasets/{MINE}/members", {"role": "reviewer"}
        assert apart.ask("newcomer", "GET", "/groups/1").status_code == 404
        given = apart.ask("lead", "PUT", f"{at}/{ids['newcomer']}", role)
        assert (given.status_code, given.json()["role"]) == (200, "reviewer")
        assert apart.ask("newcomer", "GET", "/groups/1").status_code == 200
        assert apart.ask("newcomer", "GET", "/groups/2").status_code == 404
        assert apart.ask("lead", "PUT", f"{at}/{ids['lead']}", role).status_code == 403
        assert (
            apart.ask("lead", "PUT", f"{at}/{ids['newcomer']}", {"role": "admin"}).status_code
            == 400
        )
        assert apart.ask("lead", "PUT", f"{at}/{ids['admin']}", role).status_code == 409
        theirs = f"/datasets/{THEIRS}/members/{ids['newcomer']}"
        assert apart.ask("lead", "PUT", theirs, role).status_code == 404
        assert apart.ask("reviewer", "PUT", f"{at}/{ids['newcomer']}", role).status_code == 403
        taken = apart.ask("lead", "PUT", f"{at}/{ids['newcomer']}", {"role": None})
        assert taken.json()["role"] == "none"
        assert apart.ask("newcomer", "GET", "/groups/1").status_code == 404

    def test_what_is_one_persons_own_has_no_members_and_no_webhooks(self, apart: Apart) -> None:
        at = f"/datasets/{apart.value(OwnedKind.DATASET, PRACTICE)}"
        assert apart.ask("owner", "GET", at).status_code == 200
        new = {"url": "https://hooks.example.org/a", "kinds": ["job.done"]}
        for method, target, body in (
            ("GET", "/members", None),
            ("PUT", "/members/1", {"role": "viewer"}),
            ("GET", "/webhooks", None),
            ("POST", "/webhooks", new),
        ):
            told = apart.ask("owner", method, at + target, body)
            assert (told.status_code, "one person's own" in told.text) == (409, True), told.text

    def test_the_session_says_where_somebody_is_what(self, apart: Apart) -> None:
        told = apart.ask("all-but", "GET", "/session").json()
        assert (told["role"], told["datasets"]) == ("lead", [])
        told = apart.ask("viewer", "GET", "/session").json()
        assert [(one["dataset"], one["role"]) for one in told["datasets"]] == [(MINE, "viewer")]
        assert told["allows"]["viewer"] == ["account", "describe", "read"]


class TestPermissions:
    def test_every_address_names_what_its_first_word_says(self) -> None:
        """Whatever follows such a word is looked at before anything is said of it."""
        words = {
            "datasets": OwnedKind.DATASET,
            "groups": OwnedKind.GROUP,
            "views": OwnedKind.VIEW,
            "stations": OwnedKind.STATION,
            "versions": OwnedKind.VERSION,
            "exports": OwnedKind.EXPORT,
            "jobs": OwnedKind.JOB,
            "predictions": OwnedKind.PREDICTIONS,
            "evaluations": OwnedKind.EVALUATION,
            "saved-views": OwnedKind.SAVED_VIEW,
            "verdict-batches": OwnedKind.BATCH,
            "batches": OwnedKind.WORK,
            "uploads": OwnedKind.UPLOAD,
        }
        looked = 0
        for route, permission in PERMISSIONS.items():
            address = route.partition(" ")[2].removeprefix(API).split("/")[1:]
            if len(address) > 1 and address[0] in words and address[1].startswith("{"):
                assert permission.names[address[1].strip("{}")] is words[address[0]], route
                looked += 1
        assert looked > 100

    def test_what_it_names_are_parameters_that_the_route_has(self, apart: Apart) -> None:
        document = openapi_of(apart.app)["paths"]
        for route, permission in PERMISSIONS.items():
            method, path = route.split(" ")
            if path not in document:
                continue
            operation = document[path][method.lower()]
            has = {item["name"] for item in operation["parameters"]}
            assert set(permission.names) <= has, route
            assert not permission.body or "requestBody" in operation, route

    def test_whatever_names_a_thing_is_looked_at(self, apart: Apart) -> None:
        """Parameters and fields of the OpenAPI document with the name of a kind of thing."""
        told = {kind.value for kind in OwnedKind} | {"with", "careful", "views", "against"}
        # Looked for in the dataset that the same request names.
        within = {"version", "views", "against"}
        # The key of a view of the group that the address names.
        keys = {
            ("POST /api/v1/groups/{group}/threads", "view"),
            ("PUT /api/v1/groups/{group}/dismissal", "view"),
            # Looked for in the dataset that the address names.
            ("POST /api/v1/datasets/{dataset}/edits", "items/view"),
            ("POST /api/v1/datasets/{dataset}/edits", "items/group"),
            # It chooses among tracks of the dataset; of any other batch there are none.
            ("GET /api/v1/datasets/{dataset}/tracks", "batch"),
        }
        document = apart.ask("admin", "GET", "/openapi.json").json()
        schemas = document["components"]["schemas"]
        missed = []
        for path, operations in document["paths"].items():
            for method, operation in operations.items():
                route = f"{method.upper()} {path}"
                permission = PERMISSIONS[route]
                if permission.action in (None, Action.ACCOUNT, Action.ADMINISTER):
                    continue
                named = {
                    item["name"]
                    for item in operation.get("parameters", [])
                    if item["in"] == "query"
                }
                body = operation.get("requestBody", {}).get("content", {}).get("application/json")
                if body:
                    named |= set(fields_of(schemas, body["schema"]))
                looked = {*permission.names, *permission.body}
                things = {
                    name
                    for name in named
                    if name.rpartition("/")[2] in told or name.endswith(("upload", "_id"))
                }
                # The way to one's own file: the other things of the request are named by its path.
                missed += [
                    f"{route} {name}"
                    for name in things - looked - within
                    if (route, name) not in keys
                ]
        assert missed == []
