"""What is told is plain: no document and no refusal shows how Python writes values."""

from __future__ import annotations

import re
from collections.abc import Iterator
from typing import Any

import pytest

PYTHON = re.compile(
    r"(?:^|[\s(\[,:])'[^']*'(?=$|[\s)\],.;:])|\b(?:None|True|False|tuple|dict|dictionary)\b"
    r"|instance of|<class|object at 0x|\[\.\.\.\]|Ellipsis|[a-z]+Error\b"
)
BAD = ([], {}, "x'y", "", -1.5, 1e99, None, True, [[1]], {"a": None})
PLACES = {"dataset": "broadcast", "name": "x", "marking": "Circle left"}
DOCUMENTS = (
    "/datasets", "/datasets/broadcast", "/datasets/broadcast/summary?q=", "/groups?dataset=broadcast",
    "/groups/1", "/groups/1/history", "/groups/1/suggestions", "/groups/4", "/groups/4/history",
    "/views/1/influence", "/datasets/broadcast/policy", "/policies", "/datasets/broadcast/yield",
    "/datasets/broadcast/statistics", "/datasets/broadcast/versions", "/datasets/broadcast/pitches",
    "/datasets/broadcast/positions", "/datasets/broadcast/noise", "/datasets/broadcast/verdict-batches",
    "/findings?dataset=broadcast", "/jobs", "/exports", "/query-fields", "/pitch", "/practice",
    "/stations/1", "/openapi.json",
)  # fmt: skip


def texts(value: Any) -> Iterator[str]:
    """Every text of a document, names too."""
    if isinstance(value, str):
        yield value
    elif isinstance(value, dict):
        for key, item in value.items():
            yield key
            yield from texts(item)
    elif isinstance(value, list):
        for item in value:
            yield from texts(item)


def told(problem: dict[str, Any]) -> list[str]:
    """What a refusal tells in words."""
    errors = [error["detail"] for error in problem.get("errors") or ()]
    return [problem["detail"], problem.get("hint") or "", *errors]


def operations(document: Any) -> Iterator[tuple[str, str, Any]]:
    for path, methods in document["paths"].items():
        for method, operation in methods.items():
            if isinstance(operation, dict) and path.startswith("/api/"):
                filled = re.sub(r"{(\w+)}", lambda found: PLACES.get(found[1], "1"), path)
                yield method, filled, operation


def properties(document: Any, schema: Any) -> set[str]:
    """The fields of a body, of every kind that it can be."""
    if "$ref" in schema:
        schema = document["components"]["schemas"][schema["$ref"].rpartition("/")[2]]
    names = set(schema.get("properties", ()))
    for part in (*schema.get("anyOf", ()), *schema.get("oneOf", ())):
        names |= properties(document, part)
    return names


class TestRefusals:
    @pytest.mark.parametrize("bad", BAD, ids=str)
    def test_every_refusal_of_a_body_is_plain(self, api: Any, bad: Any) -> None:
        document = api.get("/api/v1/openapi.json").json()
        seen = 0
        for method, path, operation in operations(document):
            content = operation.get("requestBody", {}).get("content", {}).get("application/json")
            if content is None:
                continue
            # A name that nobody knows, so that nothing is done, whatever the rest means.
            body = dict.fromkeys(properties(document, content["schema"]), bad)
            headers = {"If-Match": '"x"'}
            for sent in ({**body, "nobody": 1}, [bad]):
                answer = api.request(method, path, json=sent, headers=headers)
                if answer.status_code >= 400:
                    seen += 1
                    for text in told(answer.json()):
                        assert not PYTHON.search(text), (method, path, sent, text)
        assert seen > 40

    @pytest.mark.parametrize("bad", ["x'y", "", "-1", "none", "9" * 40])
    def test_every_refusal_of_a_parameter_is_plain(self, api: Any, bad: str) -> None:
        document = api.get("/api/v1/openapi.json").json()
        for method, path, operation in operations(document):
            if method != "get" or path.endswith("/events"):
                continue
            for parameter in operation.get("parameters", ()):
                if parameter["in"] == "query":
                    answer = api.get(path, params={parameter["name"]: bad})
                    if answer.headers.get("content-type") == "application/problem+json":
                        for text in told(answer.json()):
                            assert not PYTHON.search(text), (path, parameter["name"], text)

    @pytest.mark.parametrize(
        "query",
        ["jac<x", "status<accepted", "nobody:1", "id:x'y", "status:None", "sort:nobody", 'a"b'],
    )
    def test_every_refusal_of_a_query_is_plain(self, api: Any, query: str) -> None:
        answer = api.get("/api/v1/groups", params={"dataset": "broadcast", "q": query})
        assert answer.status_code == 400
        # What was sent is told as it was sent.
        for text in told(answer.json()):
            assert not PYTHON.search(text.replace(query.partition(":")[2] or "\0", "")), text


class TestDocuments:
    @pytest.mark.parametrize("address", DOCUMENTS)
    def test_every_text_is_plain(self, api: Any, address: str) -> None:
        answer = api.get(f"/api/v1{address}")
        assert answer.status_code == 200, answer.text
        for text in texts(answer.json()):
            assert not PYTHON.search(text), text
