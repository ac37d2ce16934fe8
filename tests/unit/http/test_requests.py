"""Request bodies: JSON alone, capped while they arrive."""

from __future__ import annotations

import asyncio
import json
import re
import time
from collections.abc import Sequence
from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from starlette.datastructures import Headers

from app.http import requests
from app.http.requests import (
    _STRINGS,
    MAX_CONTAINERS,
    MAX_DEPTH,
    MAX_NAME,
    MAX_NAMES,
    MAX_VALUES,
    BodyError,
    TimedBody,
    _remove_strings,
    read_body,
    read_json,
    require_json_type,
)
from tests.openapi import openapi_of


def refusal(body: bytes) -> str:
    with pytest.raises(BodyError) as caught:
        read_json(body)
    assert caught.value.status == 400
    return caught.value.detail


class Sender:
    """Sends parts of a body, each after a pause, seconds."""

    def __init__(self, parts: Sequence[tuple[float, bytes]], *, ends: bool = True):
        self._parts, self._ends = list(parts), ends

    async def receive(self) -> Any:
        if not self._parts:
            await asyncio.Event().wait()
        pause, part = self._parts.pop(0)
        await asyncio.sleep(pause)
        more = bool(self._parts) or not self._ends
        return {"type": "http.request", "body": part, "more_body": more}


class TestTimedBody:
    def test_one_that_stops_is_not_waited_for(self, monkeypatch: pytest.MonkeyPatch) -> None:
        monkeypatch.setattr(requests, "BODY_SECONDS", 0.05)
        sender = Sender([(0.0, b"[1, ")], ends=False)
        with pytest.raises(
            BodyError, match="the rest of the request body was not received"
        ) as caught:
            asyncio.run(read_body(Headers(), sender.receive, 100))
        assert caught.value.status == 408
        assert caught.value.response().headers["connection"] == "close"

    def test_one_that_comes_drop_by_drop_is_not_waited_for(
        self, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        monkeypatch.setattr(requests, "BODY_SECONDS", 0.1)
        sender = Sender([(0.03, b" ")] * 100)
        with pytest.raises(BodyError, match="was not received"):
            asyncio.run(read_body(Headers(), sender.receive, 1000))

    def test_one_that_comes_steadily_may_take_any_time(
        self, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        monkeypatch.setattr(requests, "BODY_SECONDS", 30.0)
        monkeypatch.setattr(requests, "BODY_BYTES", 10)

        async def seconds_left() -> list[float]:
            body = TimedBody(Sender([(0.01, b"0123456789"), (0.01, b"01234")] * 3).receive)
            left = []
            for _ in range(6):
                await body.receive()
                left.append(body._seconds)
            return left

        left = asyncio.run(seconds_left())
        assert left[::2] == [30.0, 30.0, 30.0]
        assert all(one < 30.0 for one in left[1::2])

    def test_what_the_server_takes_between_two_parts_is_not_counted(
        self, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        monkeypatch.setattr(requests, "BODY_SECONDS", 5.0)

        async def seconds_left() -> float:
            body = TimedBody(Sender([(0.0, b"0"), (0.0, b"1")]).receive)
            await body.receive()
            await asyncio.sleep(0.3)
            await body.receive()
            return body._seconds

        assert asyncio.run(seconds_left()) > 4.8


class TestWithoutStrings:
    @settings(deadline=None, derandomize=True)
    @given(st.text('"[]{},:ab').map(str.encode))
    def test_the_quick_way_leaves_what_the_pattern_leaves(self, body: bytes) -> None:
        assert _remove_strings(body) == _STRINGS.sub(b"", body)

    def test_a_bracket_behind_an_escaped_quote_is_text(self) -> None:
        assert _remove_strings(rb'{"a\"[": 1}') == b"{: 1}"


class TestReadJson:
    @settings(deadline=None, derandomize=True)
    @given(
        st.recursive(
            st.none()
            | st.booleans()
            | st.integers(-(2**70), 2**70)
            | st.floats(allow_nan=False, allow_infinity=False)
            | st.text(st.characters(exclude_categories=["Cs"])),
            lambda inner: (
                st.lists(inner, max_size=3)
                | st.dictionaries(st.text('ab"[]{}\\', max_size=4), inner, max_size=3)
            ),
            max_leaves=10,
        )
    )
    def test_takes_every_json_value_that_is_flat_enough(self, value: Any) -> None:
        assert read_json(json.dumps(value).encode()) == value

    @pytest.mark.parametrize("word", [b"NaN", b"Infinity", b"-Infinity"])
    def test_constants_of_javascript_are_no_numbers(self, word: bytes) -> None:
        assert "not a number" in refusal(b'{"x": [' + word + b"]}")

    def test_a_number_that_overflows_is_refused(self) -> None:
        assert "too large" in refusal(b"[1e999]")

    def test_an_integer_of_five_thousand_digits_is_refused(self) -> None:
        assert "not JSON" in refusal(b"1" * 5000)

    def test_one_level_too_deep_is_refused(self) -> None:
        read_json(b"[" * MAX_DEPTH + b"]" * MAX_DEPTH)
        assert "levels" in refusal(b"[" * (MAX_DEPTH + 1) + b"]" * (MAX_DEPTH + 1))

    def test_brackets_inside_of_texts_do_not_count(self) -> None:
        texts = ["[" * 100, '"' + "{" * 100]
        assert read_json(json.dumps(texts).encode()) == texts

    def test_two_million_brackets_are_refused_at_once(self) -> None:
        start = time.process_time()
        assert "levels" in refusal(b"[" * 2_000_000)
        assert time.process_time() - start < 0.5

    def test_two_million_quotes_are_refused_at_once(self) -> None:
        start = time.process_time()
        refusal(b'\\"' * 1_000_000)
        refusal(b'"' + b'\\"' * 1_000_000)
        assert time.process_time() - start < 0.5

    def test_more_lists_and_objects_than_any_request_needs_are_refused(self) -> None:
        read_json(b"[" + b"{}," * (MAX_CONTAINERS - 2) + b"[]]")
        assert "lists and objects" in refusal(b"[" + b"{}," * (MAX_CONTAINERS - 1) + b"[]]")
        read_json(json.dumps(["[]" * MAX_CONTAINERS]).encode())

    def test_more_values_than_any_request_needs_are_refused(self) -> None:
        read_json(b"[" + b"1," * MAX_VALUES + b"1]")
        assert "values" in refusal(b"[" + b"1," * (MAX_VALUES + 1) + b"1]")
        read_json(json.dumps(["," * 2 * MAX_VALUES]).encode())

    def test_more_and_longer_names_than_any_object_needs_are_refused(self) -> None:
        names = [f"n{number}" for number in range(MAX_NAMES)]
        read_json(json.dumps([dict.fromkeys(names, 1)] * 2).encode())
        assert "keys" in refusal(json.dumps(dict.fromkeys([*names, "one more"], 1)).encode())
        read_json(json.dumps({"x" * MAX_NAME: "y" * 2 * MAX_NAME}).encode())
        assert "characters" in refusal(json.dumps({"x" * (MAX_NAME + 1): 1}).encode())

    def test_a_large_exponent_is_no_mistake_where_the_number_is_small(self) -> None:
        assert read_json(b"[1e3, 0.000e400, 1e-999]") == [1000.0, 0.0, 0.0]
        assert "too large" in refusal(b"[" + b"9" * 400 + b".0]")

    def test_another_encoding_is_refused(self) -> None:
        assert "UTF-8" in refusal('{"a": "ä"}'.encode("latin-1"))
        refusal('{"a": 1}'.encode("utf-16"))

    def test_half_of_a_unicode_surrogate_pair_is_refused(self) -> None:
        read_json(rb'"\ud83d\ude00"')
        assert "Unicode" in refusal(rb'{"note": "\ud800"}')

    @pytest.mark.parametrize(
        "body", [b'{"a": 1, "a": 2}', b'[{"b": {"a": 1, "\\u0061": 2}}]', b'{"a": 1, "a": 1}']
    )
    def test_a_name_that_stands_twice_in_one_object_is_refused(self, body: bytes) -> None:
        read_json(b'[{"a": {"a": 1}}, {"a": 2}]')
        assert refusal(body) == 'a JSON object of the body has the key "a" more than once'

    def test_the_place_of_a_mistake_is_told(self) -> None:
        assert refusal(b'{"a": }').endswith("at character 6")


class TestRequireJsonType:
    @pytest.mark.parametrize(
        "kinds",
        [
            [],
            ["text/plain"],
            ["application/x-www-form-urlencoded"],
            ["multipart/form-data; boundary=x"],
            ["application/json; charset=utf-16"],
            ["text/plain; application/json"],
            ["application/json", "text/plain"],
            [""],
        ],
    )
    def test_everything_else_is_415(self, kinds: list[str]) -> None:
        with pytest.raises(BodyError) as caught:
            require_json_type(kinds)
        assert caught.value.status == 415


class TestNullCharacters:
    """PostgreSQL cannot keep U+0000 in a text; SQLite could, and its home could then not be moved."""

    @pytest.mark.parametrize(
        ("body", "place"),
        [
            (rb'{"text": "a\u0000b"}', "/text"),
            (rb'{"lines": [{"x": 1}, {"note": "\u0000"}]}', "/lines/1/note"),
            (rb'"\u0000"', "/"),
            (rb'{"a": {"\u0000": 1}}', "/a"),
        ],
    )
    def test_a_text_that_holds_one_is_refused_by_its_place(self, body: bytes, place: str) -> None:
        assert (
            refusal(body) == f'the text at "{place}" in the body holds U+0000, which is not stored'
        )

    def test_a_backslash_before_it_makes_it_a_text_about_it(self) -> None:
        assert read_json(rb'{"text": "\\u0000"}') == {"text": r"\u0000"}


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
        for path, operations in openapi_of(app)["paths"].items():
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
        for path, operations in openapi_of(app)["paths"].items():
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
        document, seen = openapi_of(app), 0
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
        document = openapi_of(app)
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
