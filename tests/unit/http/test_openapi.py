from __future__ import annotations

import re
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
from jsonschema import Draft202012Validator
from openapi_spec_validator import validate

from app.http.property_descriptions import PARAMETERS, PROPERTIES
from app.http.route import list_routes

Document = dict[str, Any]
NAMES = Path(__file__).parent / "operation_ids.txt"
"""A line for each operation: its method, its address and its name."""


@pytest.fixture
def document(app) -> Document:
    return app.openapi()


def operations(document: Document) -> Iterator[tuple[str, Document]]:
    for path, methods in document["paths"].items():
        for method, operation in methods.items():
            yield f"{method.upper()} {path}", operation


class TestDocument:
    def test_is_valid_openapi_for_readers_that_are_not_ours(self, document) -> None:
        validate(document)

    def test_says_what_every_tag_means(self, document) -> None:
        described = {tag["name"] for tag in document["tags"]}
        used = {tag for _, operation in operations(document) for tag in operation.get("tags", ())}
        assert used == described

    def test_requires_if_match_wherever_a_change_without_it_is_refused(self, document) -> None:
        for name, operation in operations(document):
            [*found] = (one for one in operation["parameters"] if one["name"] == "If-Match")
            assert bool(found) == ("428" in operation["responses"]), name
            assert all(one["required"] for one in found), name

    def test_says_what_every_request_for_something_and_every_body_can_meet(self, document) -> None:
        for name, operation in operations(document):
            statuses = set(operation["responses"])
            assert {"400", "401", "403", "422", "500", "503"} <= statuses, name
            assert "{" not in name or "404" in statuses, name
            assert "requestBody" not in operation or {"413", "415"} <= statuses, name

    def test_gives_every_operation_a_name_of_its_own(self, document) -> None:
        names = [operation["operationId"] for _, operation in operations(document)]
        assert len(set(names)) == len(names)
        # A verb alone says nothing in a generated client.
        assert [name for name in names if name.islower()] == []

    def test_keeps_the_names_of_operations_that_clients_were_made_with(self, document) -> None:
        names = [f"{name} {one['operationId']}" for name, one in operations(document)]
        assert sorted(names) == NAMES.read_text().splitlines()

    def test_describes_an_edit_of_the_ball_as_one_of_three_things(self, document) -> None:
        edit = document["components"]["schemas"]["BallEdit"]
        assert set(edit) <= {"title", "description", "examples", "oneOf"}
        assert [one["required"] for one in edit["oneOf"]] == [["box"], ["point"], ["out_of_view"]]
        assert all(one["additionalProperties"] is False for one in edit["oneOf"])

    def test_types_the_data_of_every_event(self, document) -> None:
        stream = document["paths"]["/api/v1/events"]["get"]["responses"]["200"]["content"]
        kinds = stream["text/event-stream"]["x-events"]
        assert set(kinds) == {"group", "dataset", "job", "work", "maintenance"}
        for reference in kinds.values():
            assert reference["$ref"].rpartition("/")[2] in document["components"]["schemas"]

    def test_gives_every_operation_a_summary_of_its_own(self, document) -> None:
        summaries = [operation["summary"] for _, operation in operations(document)]
        assert len(set(summaries)) == len(summaries)
        assert "List saved views" in summaries

    def test_describes_every_parameter(self, document) -> None:
        for name, operation in operations(document):
            for one in operation["parameters"]:
                assert one.get("description"), f"{name}: say what {one['name']} is"

    def test_describes_every_property(self, document) -> None:
        for name, schema in document["components"]["schemas"].items():
            for key, one in schema.get("properties", {}).items():
                told = f"{name}.{key}: describe it in its model or in property_words.py"
                assert one.get("description"), told

    def test_no_schema_is_called_like_a_property_of_its_own(self, document) -> None:
        """A generated Python client names the value it reads after the schema, over that property."""
        for name, schema in document["components"]["schemas"].items():
            variable = re.sub(r"(?<=[a-z0-9])(?=[A-Z])", "_", name).lower()
            assert variable not in schema.get("properties", {}), f"{name}: give it another name"

    def test_a_value_that_is_served_has_all_its_fields_and_the_words_of_its_docstring(
        self, document
    ) -> None:
        schema = document["components"]["schemas"]["Banner"]
        starts = schema["properties"]["starts"]
        assert schema["required"] == ["text", "starts", "until"]
        assert "default" not in starts
        assert {"type": "string", "format": "date-time"} in starts["anyOf"]
        assert "null" in starts["description"]
        assert "Attributes" not in schema["description"]

    def test_every_shared_description_is_used(self, document) -> None:
        said = {
            (name, key, one["description"])
            for name, schema in document["components"]["schemas"].items()
            for key, one in schema.get("properties", {}).items()
        }
        used = {key for _, key, text in said if PROPERTIES.get(key) == text}
        used |= {f"{n}.{key}" for n, key, text in said if PROPERTIES.get(f"{n}.{key}") == text}
        assert set(PROPERTIES) == used
        there = {
            (one["name"], one["description"])
            for _, operation in operations(document)
            for one in operation["parameters"]
        }
        assert set(PARAMETERS.items()) <= there

    def test_gives_every_answer_in_json_an_example_that_fits_it(self, document) -> None:
        count = 0
        for name, operation in operations(document):
            for status, answer in operation["responses"].items():
                content = answer.get("content", {}).get("application/json")
                if not status.startswith("2") or content is None:
                    continue
                examples = [one["value"] for one in content.get("examples", {}).values()]
                examples += [content["example"]] if "example" in content else []
                assert examples, name
                schema = {**content["schema"], "components": document["components"]}
                for one in examples:
                    Draft202012Validator(schema).validate(one)
                    count += 1
        assert count > 100

    def test_says_with_what_one_may_ask(self, app, document) -> None:
        routes = dict(list_routes(app))
        schemes = document["components"]["securitySchemes"]
        assert (schemes["session"]["in"], schemes["token"]["scheme"]) == ("cookie", "bearer")
        assert document["security"] == [{"session": []}, {"token": []}, {}]
        for name, operation in operations(document):
            assert (operation.get("security") == []) == (routes[name].permission.action is None), (
                name
            )
