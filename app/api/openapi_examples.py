"""Examples of answers, made of the examples and the types of their models."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

Schema = Mapping[str, Any]
_DEEP = 12
"""No answer holds answers in one another more often."""
_FORMATS: Mapping[str, Any] = {
    "date-time": "2026-03-14T15:09:26Z",
    "date": "2026-03-14",
    "uri": "http://127.0.0.1:8000/",
}
NAMES: Mapping[str, Any] = {
    "actor": "anna",
    "dataset": "league",
    "etag": '"12-5f8a"',
    "hash": "6f1ed002ab5595859014ebf0951522d9",
    "key": "epl/2015-2016/match/7.png",
    "label": "Alder Town 3 - 1 Birch Rovers",
    "marking": "Middle line",
    "match": "epl/2015-2016/match",
    "name": "v1",
    "next": "200",
    "q": "status:unreviewed",
    "sentence": "The camera of view B is uncertain.",
    "split": "train",
    "view": "7_1.png",
}
"""Of texts that stand in many answers."""
NUMBERS: Mapping[str, float] = {
    "ball_diameter_m": 0.22,
    "height": 720,
    "length": 105,
    "outside_pitch_m": 5,
    "pan_degrees": 12.3,
    "pitch_length_m": 105,
    "pitch_width_m": 68,
    "tilt_degrees": 78.9,
    "width": 1280,
    "x_focal_length": 2100,
    "y_focal_length": 2100,
}
"""Of numbers that are none of the usual ones."""


def example_of(schema: Schema, schemas: Mapping[str, Schema], name: str = "", deep: int = 0) -> Any:
    """A value that fits a schema.

    Args:
        schema: Of the value.
        schemas: Those that it may refer to, by name.
        name: Of the property that it is the value of.
        deep: In how many others it lies.
    """
    if "$ref" in schema:
        found = schemas[schema["$ref"].rpartition("/")[2]]
        return example_of({**found, **_given(schema)}, schemas, name, deep + 1)
    for word in ("examples", "enum"):
        if schema.get(word):
            return schema[word][0]
    for word in ("const", "default"):
        if schema.get(word) is not None:
            return schema[word]
    for word in ("anyOf", "oneOf", "allOf"):
        if schema.get(word):
            choices = [one for one in schema[word] if one.get("type") != "null"]
            # What may be null is null where answers would hold themselves without an end.
            if len(choices) < len(schema[word]) and deep > _DEEP:
                return None
            return example_of(choices[0], schemas, name, deep)
    kind = schema.get("type")
    if kind == "object":
        return _object(schema, schemas, deep)
    if kind == "array":
        return _array(schema, schemas, name, deep)
    if kind in ("integer", "number"):
        return _number(schema, kind, name)
    return {"boolean": True, "null": None}.get(str(kind), _text(schema, name))


def _given(schema: Schema) -> dict[str, Any]:
    return {word: schema[word] for word in ("examples", "default") if word in schema}


def _object(schema: Schema, schemas: Mapping[str, Schema], deep: int) -> dict[str, Any]:
    found = {
        key: example_of(one, schemas, key, deep + 1)
        for key, one in schema.get("properties", {}).items()
    }
    more = schema.get("additionalProperties")
    if not found and isinstance(more, dict):
        return {"accepted": example_of(more, schemas, "", deep + 1)}
    return found


def _array(schema: Schema, schemas: Mapping[str, Schema], name: str, deep: int) -> list[Any]:
    if "prefixItems" in schema:
        return [example_of(one, schemas, name, deep + 1) for one in schema["prefixItems"]]
    count = schema.get("minItems", 1 if deep <= _DEEP else 0)
    return [example_of(schema.get("items", {}), schemas, name, deep + 1)] * count


def _number(schema: Schema, kind: str, name: str) -> int | float:
    usual = NUMBERS.get(name, 12 if kind == "integer" else 0.5)
    value = min(usual, schema.get("maximum", usual))
    if value <= schema.get("exclusiveMinimum", value - 1):
        value = schema["exclusiveMinimum"] + 1
    value = max(value, schema.get("minimum", value))
    return int(value) if kind == "integer" else float(value)


def _text(schema: Schema, name: str) -> str:
    text = str(_FORMATS.get(str(schema.get("format")), NAMES.get(name, name or "text")))
    return text.ljust(schema.get("minLength", 0), "x")[: schema.get("maxLength", len(text) + 99)]
