from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import pytest
from openapi_spec_validator import validate

Document = dict[str, Any]


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

    def test_gives_every_operation_a_name_of_its_own(self, document) -> None:
        names = [operation["operationId"] for _, operation in operations(document)]
        assert len(set(names)) == len(names)
        # A verb alone says nothing in a generated client.
        assert [name for name in names if name.islower()] == []

    def test_describes_an_edit_of_the_ball_as_one_of_three_things(self, document) -> None:
        edit = document["components"]["schemas"]["BallEdit"]
        assert set(edit) <= {"title", "description", "examples", "oneOf"}
        assert [one["required"] for one in edit["oneOf"]] == [["box"], ["point"], ["out_of_view"]]
        assert all(one["additionalProperties"] is False for one in edit["oneOf"])

    def test_types_the_data_of_every_event(self, document) -> None:
        stream = document["paths"]["/api/v1/events"]["get"]["responses"]["200"]["content"]
        kinds = stream["text/event-stream"]["x-events"]
        assert set(kinds) == {"group", "dataset", "job", "work"}
        for reference in kinds.values():
            assert reference["$ref"].rpartition("/")[2] in document["components"]["schemas"]
