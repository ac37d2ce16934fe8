from __future__ import annotations

from typing import Any

import pytest

from app.http.openapi import make_example

SCHEMAS: dict[str, Any] = {
    "Node": {
        "type": "object",
        "properties": {
            "name": {"type": "string"},
            "next": {"anyOf": [{"$ref": "#/components/schemas/Node"}, {"type": "null"}]},
        },
    }
}


class TestExampleOf:
    @pytest.mark.parametrize(
        ("schema", "example"),
        [
            ({"type": "integer", "minimum": 20}, 20),
            ({"type": "number", "maximum": 0.25}, 0.25),
            ({"type": "string", "enum": ["ready", "failed"]}, "ready"),
            ({"type": "string", "examples": ["v7"], "default": "v1"}, "v7"),
            ({"type": "string", "maxLength": 3}, "tex"),
            ({"anyOf": [{"type": "null"}, {"type": "boolean"}]}, True),
            ({"type": "array", "items": {"type": "integer"}, "minItems": 2}, [12, 12]),
            ({"type": "object", "additionalProperties": {"type": "integer"}}, {"accepted": 12}),
        ],
    )
    def test_fits_the_schema(self, schema: dict[str, Any], example: Any) -> None:
        assert make_example(schema, {}) == example

    def test_a_model_that_holds_itself_ends(self) -> None:
        found, depth = make_example(SCHEMAS["Node"], SCHEMAS), 0
        while found is not None:
            found, depth = found["next"], depth + 1
        assert depth < 20
