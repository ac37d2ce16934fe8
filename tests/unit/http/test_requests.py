from __future__ import annotations

import re

import pytest

API = "/api/v1"


class TestParameters:
    def test_one_that_nobody_reads_is_refused_with_the_nearest_name(self, api) -> None:
        answer = api.get(f"{API}/groups", params={"datset": "broadcast"})
        assert answer.status_code == 422
        assert answer.json()["errors"] == [
            {
                "pointer": "/datset",
                "detail": "there is no such parameter; did you mean dataset?",
            }
        ]

    def test_a_name_of_the_path_is_none_of_the_query(self, api) -> None:
        address = f"{API}/datasets/broadcast/versions"
        assert api.get(address, params={"dataset": "static"}).status_code == 422

    def test_one_that_resembles_nothing_is_refused_too(self, api) -> None:
        answer = api.get(f"{API}/jobs", params={"zzz": "1"})
        assert answer.json()["detail"] == "/zzz: there is no such parameter"

    def test_a_misspelt_dry_run_does_nothing(self, api, app) -> None:
        body = {"name": "v1", "groups": "passing"}
        address = f"{API}/datasets/broadcast/versions"
        answer = api.post(address, params={"dryrun": True}, json=body)
        assert (answer.status_code, "dry_run" in answer.json()["detail"]) == (422, True)
        assert app.state.services.jobs.find() == []

    def test_parameters_that_only_a_dependency_reads_are_known(self, api) -> None:
        assert api.get(f"{API}/events", params={"dataset": "nowhere"}).status_code == 404

    @pytest.mark.parametrize("query", ["name=a.zip&name=b.zip", "name=a.zip&name=a.zip"])
    def test_one_that_is_there_twice_is_refused(self, api, app, query: str) -> None:
        kind = {"Content-Type": "application/octet-stream"}
        answer = api.post(f"{API}/uploads?{query}", content=b"PK", headers=kind)
        assert answer.status_code == 422
        assert answer.json()["errors"] == [
            {"pointer": "/name", "detail": "is there more than once; no parameter is a list"}
        ]
        assert api.get(f"{API}/uploads").json()["items"] == []

    def test_an_unknown_one_that_is_there_twice_is_unknown(self, api) -> None:
        answer = api.get(f"{API}/jobs?zzz=1&zzz=2")
        assert answer.json()["detail"] == "/zzz: there is no such parameter"

    def test_none_is_a_list(self, app) -> None:
        for path, operations in app.openapi()["paths"].items():
            for operation in operations.values():
                for one in operation.get("parameters", []):
                    kinds = one["schema"].get("anyOf", [one["schema"]])
                    assert "array" not in [kind.get("type") for kind in kinds], (path, one["name"])


class TestNumbers:
    """Python reads more as a number than anybody writes: an address has one spelling."""

    @pytest.mark.parametrize("number", ["0_1", "+1", "%201", "1.0", "01", "\u0661"])
    def test_an_id_in_a_path_is_plain_digits(self, api, number: str) -> None:
        answer = api.get(f"{API}/groups/{number}")
        assert answer.status_code == 404

    def test_so_is_a_number_of_every_query(self, api, app) -> None:
        found = 0
        for path, operations in app.openapi()["paths"].items():
            one = operations.get("get", {"parameters": []})
            for item in one.get("parameters", []):
                kinds = item["schema"].get("anyOf", [item["schema"]])
                if item["in"] == "query" and "integer" in [kind.get("type") for kind in kinds]:
                    address = path.replace("{dataset}", "broadcast")
                    answer = api.get(re.sub(r"{\w+}", "1", address), params={item["name"]: "1_0"})
                    assert answer.status_code == 422, (path, item["name"], answer.text)
                    found += 1
        assert found > 10

    def test_plain_ones_are_read(self, api) -> None:
        assert api.get(f"{API}/groups/1").status_code == 200
        pitch = api.get(f"{API}/pitch", params={"length": "1.1e2", "width": "70.5"})
        assert pitch.status_code == 200


class TestFields:
    @pytest.mark.parametrize(
        ("body", "pointer", "nearest"),
        [
            ({"nam": "v1"}, "/nam", "name"),
            ({"name": "v1", "split": {"kind": "given", "sed": 1}}, "/split/sed", "seed"),
        ],
    )
    def test_an_unknown_one_is_refused_with_the_nearest_name(
        self, api, body, pointer, nearest
    ) -> None:
        answer = api.post(f"{API}/datasets/broadcast/versions", json=body)
        assert answer.status_code == 422
        # Not that the right name is missing.
        assert answer.json()["pointer"] == pointer
        sentence = f"{pointer}: there is no such field; did you mean {nearest}?"
        assert answer.json()["detail"] == sentence

    @pytest.mark.parametrize(
        ("body", "pointer", "sentence"),
        [
            (
                {"live": {"recording": 1, "first": 0, "last": 9}, "replay": {}},
                "/live/recording",
                "there is no such field, it belongs at /replay/recording; known here: first, last",
            ),
            (
                {"live/recording": 1, "live": {"first": 0, "last": 9}},
                "/live~1recording",
                "there is no such field; known here: live, replay",
            ),
            (
                {"live": {"frist": 0, "last": 9}, "replay": {}},
                "/live/frist",
                "there is no such field; did you mean first?",
            ),
        ],
    )
    def test_only_names_of_its_place_are_meant(self, api, body, pointer, sentence) -> None:
        answer = api.post(f"{API}/recordings/1/links", json=body).json()
        told = {one["pointer"]: one["detail"] for one in answer["errors"]}
        assert told[pointer] == sentence

    def test_no_error_names_a_field_that_its_place_does_not_have(self, api, app) -> None:
        """Whatever is misspelt, in the outer object of each body of a recording's routes."""
        document, seen = app.openapi(), 0
        for path, operations in document["paths"].items():
            for method, operation in operations.items():
                content = operation.get("requestBody", {}).get("content", {})
                name = content.get("application/json", {}).get("schema", {}).get("$ref", "")
                known = document["components"]["schemas"].get(name.rpartition("/")[2])
                if not path.startswith(f"{API}/recordings") or not known:
                    continue
                for wrong in ("recordings", "frames_", "zzz"):
                    answer = api.request(method, re.sub(r"{\w+}", "1", path), json={wrong: 1})
                    if answer.status_code != 422:
                        continue
                    seen += 1
                    told = {one["pointer"]: one["detail"] for one in answer.json()["errors"]}
                    meant = told[f"/{wrong}"].partition("did you mean ")[2].rstrip("?")
                    listed = told[f"/{wrong}"].partition("known here: ")[2].split(", ")
                    names = {meant, *listed} - {""}
                    assert names <= set(known["properties"]), (path, told)
        assert seen > 10


class TestDryRun:
    def test_is_a_parameter_wherever_there_is_one(self, app) -> None:
        document = app.openapi()
        for path, operations in document["paths"].items():
            for method, operation in operations.items():
                schema = operation.get("requestBody", {}).get("content", {})
                reference = schema.get("application/json", {}).get("schema", {}).get("$ref", "")
                body = document["components"]["schemas"].get(reference.rpartition("/")[2], {})
                if "dry_run" in body.get("properties", {}):
                    names = {one["name"] for one in operation["parameters"]}
                    assert "dry_run" in names, f"{method} {path}"

    def test_a_freeze_that_is_only_tried_freezes_nothing(self, api, app) -> None:
        body = {"name": "v1", "groups": "passing"}
        address = f"{API}/datasets/broadcast/versions"
        answer = api.post(address, params={"dry_run": True}, json=body)
        assert (answer.status_code, answer.json()["groups"]) == (200, 3)
        assert app.state.services.jobs.find() == []
