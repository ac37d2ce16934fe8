"""Request bodies: JSON alone, capped while they arrive."""

from __future__ import annotations

import asyncio
import json
import time
from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from app.http.bodies import (
    _STRINGS,
    MAX_CONTAINERS,
    MAX_DEPTH,
    MAX_NAME,
    MAX_NAMES,
    MAX_STRANGERS_BYTES,
    MAX_VALUES,
    BodyError,
    JsonBodies,
    _without_strings,
    read_json,
    require_json_type,
)

JSON = [(b"content-type", b"application/json")]


def refusal(body: bytes) -> str:
    with pytest.raises(BodyError) as caught:
        read_json(body)
    assert caught.value.status == 400
    return caught.value.detail


class TestWithoutStrings:
    @settings(deadline=None, derandomize=True)
    @given(st.text('"[]{},:ab').map(str.encode))
    def test_the_quick_way_leaves_what_the_pattern_leaves(self, body: bytes) -> None:
        assert _without_strings(body) == _STRINGS.sub(b"", body)

    def test_a_bracket_behind_an_escaped_quote_is_text(self) -> None:
        assert _without_strings(rb'{"a\"[": 1}') == b"{: 1}"


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
        assert "names" in refusal(json.dumps(dict.fromkeys([*names, "one more"], 1)).encode())
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
        assert refusal(body) == 'the body names "a" more than once'

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


class Exchange:
    """One request against ``JsonBodies``, chunk by chunk."""

    def __init__(self, chunks: list[bytes], headers: list[tuple[bytes, bytes]], method: str):
        self.chunks = chunks
        self.taken = 0
        self.reached: bytes | None = None
        self.status = 0
        self.scope = {"type": "http", "method": method, "headers": headers, "path": "/"}

    async def receive(self) -> dict[str, Any]:
        chunk = self.chunks[self.taken]
        self.taken += 1
        more = self.taken < len(self.chunks)
        return {"type": "http.request", "body": chunk, "more_body": more}

    async def send(self, message: dict[str, Any]) -> None:
        self.status = message.get("status", self.status)

    async def app(self, scope: Any, receive: Any, send: Any) -> None:
        self.reached = (await receive())["body"]
        self.status = 204

    def run(self, max_bytes: int) -> Exchange:
        asyncio.run(JsonBodies(self.app, max_bytes)(self.scope, self.receive, self.send))
        return self


class TestJsonBodies:
    def test_the_body_arrives_whole_behind_it(self) -> None:
        done = Exchange([b'{"a"', b": 1}"], JSON, "PATCH").run(100)
        assert (done.status, done.reached) == (204, b'{"a": 1}')

    def test_a_body_of_the_very_cap_passes_and_one_byte_more_does_not(self) -> None:
        assert Exchange([b'"' + b"a" * 8 + b'"'], JSON, "POST").run(10).status == 204
        assert Exchange([b'"' + b"a" * 9 + b'"'], JSON, "POST").run(10).status == 413

    def test_an_honest_length_is_refused_before_a_byte_is_read(self) -> None:
        headers = [*JSON, (b"content-length", b"11")]
        done = Exchange([b"a" * 11], headers, "POST").run(10)
        assert (done.status, done.taken) == (413, 0)

    def test_a_chunked_body_is_cut_off_at_the_cap(self) -> None:
        done = Exchange([b"a" * 4] * 1000, JSON, "POST").run(10)
        assert (done.status, done.taken) == (413, 3)

    @pytest.mark.parametrize(
        ("path", "status"),
        [
            ("/api/v1/session", 413),
            ("/api/v1/session/sign-on", 413),
            ("/api/v1/links/use", 413),
            ("/api/v1/sessions", 204),
            ("/api/v1/groups/1/preview", 204),
        ],
    )
    def test_who_is_not_known_yet_brings_less(self, path: str, status: int) -> None:
        body = b'"' + b"a" * MAX_STRANGERS_BYTES + b'"'
        asked = Exchange([body], JSON, "POST")
        asked.scope["path"] = path
        assert asked.run(2 * MAX_STRANGERS_BYTES).status == status
        asked = Exchange([body[:-3] + b'"'], JSON, "POST")
        asked.scope["path"] = path
        assert asked.run(2 * MAX_STRANGERS_BYTES).status == 204

    @pytest.mark.parametrize(
        ("length", "status"), [(b"-1", 400), (b"1e9", 400), (b"\xb2", 400), (b"9" * 30, 413)]
    )
    def test_a_length_that_no_body_has_is_refused(self, length: bytes, status: int) -> None:
        headers = [*JSON, (b"content-length", length)]
        assert Exchange([b"1"], headers, "POST").run(10).status == status

    def test_a_request_without_a_body_needs_no_type(self) -> None:
        assert Exchange([b""], [], "POST").run(10).status == 204

    @pytest.mark.parametrize("kind", [b"application/json", b"Application/JSON; charset=UTF-8"])
    def test_json_in_utf_8_arrives(self, kind: bytes) -> None:
        done = Exchange([b'"\xc3\xa4"'], [(b"content-type", kind)], "POST").run(10)
        assert (done.status, done.reached) == (204, b'"\xc3\xa4"')

    def test_a_body_of_another_type_never_arrives(self) -> None:
        done = Exchange([b"a=1"], [(b"content-type", b"text/plain")], "POST").run(10)
        assert (done.status, done.reached) == (415, None)


class TestStreamedBodies:
    def test_bytes_pass_as_they_come_and_nothing_else_does(self) -> None:
        assert _ask("POST", b"application/octet-stream") == [b"\x00{not json", b"more"]
        assert _ask("POST", b"application/json") == 415
        assert _ask("POST", b"application/octet-stream; charset=x") == 415
        assert _ask("PUT", b"application/octet-stream") == 415


def _ask(method: str, kind: bytes) -> Any:
    """What the application behind sees of two chunks, or the status of a refusal."""
    chunks = [b"\x00{not json", b"more"]
    seen: list[bytes] = []
    statuses: list[int] = []

    async def app(scope: Any, receive: Any, send: Any) -> None:
        while True:
            message = await receive()
            seen.append(message["body"])
            if not message.get("more_body"):
                return

    async def receive() -> Any:
        body = chunks.pop(0)
        return {"type": "http.request", "body": body, "more_body": bool(chunks)}

    async def send(message: Any) -> None:
        if message["type"] == "http.response.start":
            statuses.append(message["status"])

    scope = {"type": "http", "method": method, "path": "/up", "headers": [(b"content-type", kind)]}
    guarded = JsonBodies(app, streamed=frozenset({"/up"}))
    asyncio.run(guarded(scope, receive, send))
    return statuses[0] if statuses else seen


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
