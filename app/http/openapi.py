"""The OpenAPI document: what FastAPI does not say by itself, and its examples."""

from __future__ import annotations

import inspect
import re
from collections.abc import Iterator, Mapping
from dataclasses import is_dataclass
from typing import Any, get_args, get_type_hints

from fastapi import APIRouter, FastAPI, Request
from fastapi.openapi.utils import get_fields_from_routes, get_openapi
from pydantic import BaseModel
from starlette.responses import JSONResponse

from app.http.cookies import SESSION
from app.http.event_stream import EVENTS
from app.http.permissions import Action, Permission, RoleScope, may
from app.http.problem import Problem, responses
from app.http.property_descriptions import PARAMETERS, PROPERTIES
from app.http.route import Route, list_routes

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


def make_example(
    schema: Schema, schemas: Mapping[str, Schema], name: str = "", deep: int = 0
) -> Any:
    """A value that fits a schema.

    Args:
        schema: Of the value.
        schemas: Those that it may refer to, by name.
        name: Of the property that it is the value of.
        deep: In how many others it lies.
    """
    if "$ref" in schema:
        found = schemas[schema["$ref"].rpartition("/")[2]]
        return make_example({**found, **_given_example(schema)}, schemas, name, deep + 1)
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
            return make_example(choices[0], schemas, name, deep)
    kind = schema.get("type")
    if kind == "object":
        return _example_object(schema, schemas, deep)
    if kind == "array":
        return _example_array(schema, schemas, name, deep)
    if kind in ("integer", "number"):
        return _example_number(schema, kind, name)
    return {"boolean": True, "null": None}.get(str(kind), _example_text(schema, name))


def _given_example(schema: Schema) -> dict[str, Any]:
    return {word: schema[word] for word in ("examples", "default") if word in schema}


def _example_object(schema: Schema, schemas: Mapping[str, Schema], deep: int) -> dict[str, Any]:
    found = {
        key: make_example(one, schemas, key, deep + 1)
        for key, one in schema.get("properties", {}).items()
    }
    more = schema.get("additionalProperties")
    if not found and isinstance(more, dict):
        return {"accepted": make_example(more, schemas, "", deep + 1)}
    return found


def _example_array(
    schema: Schema, schemas: Mapping[str, Schema], name: str, deep: int
) -> list[Any]:
    if "prefixItems" in schema:
        return [make_example(one, schemas, name, deep + 1) for one in schema["prefixItems"]]
    count = schema.get("minItems", 1 if deep <= _DEEP else 0)
    return [make_example(schema.get("items", {}), schemas, name, deep + 1)] * count


def _example_number(schema: Schema, kind: str, name: str) -> int | float:
    usual = NUMBERS.get(name, 12 if kind == "integer" else 0.5)
    value = min(usual, schema.get("maximum", usual))
    if value <= schema.get("exclusiveMinimum", value - 1):
        value = schema["exclusiveMinimum"] + 1
    value = max(value, schema.get("minimum", value))
    return int(value) if kind == "integer" else float(value)


def _example_text(schema: Schema, name: str) -> str:
    text = str(_FORMATS.get(str(schema.get("format")), NAMES.get(name, name or "text")))
    return text.ljust(schema.get("minLength", 0), "x")[: schema.get("maxLength", len(text) + 99)]


DESCRIPTION = """
Everything that the browser does goes through these addresses.

* **State and ETag.** `PATCH`, `PUT`, undo and redo need `If-Match` with the ETag of the state that
  they change: 428 without it, 412 (with the present document as `current`) if another request
  changed that state first.
* **Names.** A script sends its name in `X-Actor` and is logged as `script:NAME`; the name is not
  checked.
* **Authentication.** A server that one person runs alone needs none. On a server of a team
  everything but `/healthz`, `/readyz` and logging in needs a session: `POST /api/v1/session` sets
  its cookie, and a change must carry an `Origin` of this server. Scripts send a token of
  `POST /api/v1/tokens` as `Authorization: Bearer tl_...`, and neither cookie nor `Origin`. 401:
  no valid session or token; 403: the role does not suffice, or the token lacks a scope.
* **Problems.** Every response that is not a success is `application/problem+json` (RFC 9457).
* **Pages.** Every list takes `limit` and `cursor` and returns `items` and `next`: the cursor of the
  next page, null on the last one. Some also return `total`, the number of all items.
* **Units.** Pixels of the annotated image size, (0, 0) the centre of the first pixel; metres in
  the pitch frame, z down; degrees.
""".strip()
TAGS = {
    "datasets": "The datasets, their progress, statistics and policies.",
    "groups": "The views of one instant: the unit of review.",
    "views": "One image of an instant: its lines, its ball, its frame.",
    "stations": "Static cameras, whose lines many views share.",
    "findings": "What a person should look at.",
    "insight": "Suggestions that would help a group, and the influence of its markings and points.",
    "verdicts": "Verdicts on many groups at once.",
    "queue": "Saved queries, and how much each person has reviewed.",
    "work": "Batches of groups that leads assign, and which person has which group open.",
    "independent annotations": "Independent annotations, gold groups whose true values are known, guidelines.",
    "yield": "How many groups pass the policy, and how many would pass another one.",
    "agreement": "Agreement of people who annotated the same frames.",
    "comments": "Comments on groups, and notifications.",
    "webhooks": "Addresses to which the server sends signed messages about a dataset.",
    "imports": "Files and folders that become datasets.",
    "tracks": "The ball over time: its position in every frame of a stretch, and its events.",
    "recordings": "Videos of matches, their shots, and the groups that are made from them.",
    "predictions": "Predictions of detectors, beside the annotations of people.",
    "evaluations": "Predictions of detectors compared with accepted groups or frozen versions.",
    "versions": "Frozen versions of datasets.",
    "exports": "Exports of datasets as files.",
    "policies": "The thresholds that judge a dataset.",
    "practice": "Eight groups with known answers, to learn on.",
    "jobs": "Work that takes longer than a request: its progress and its result.",
    "events": "Changes, sent as they happen.",
    "pitch": "Names and shapes of the 26 markings.",
    "sessions": "On a team's server: login and open sessions.",
    "tokens": "On a team's server: tokens for scripts that act in the name of a person.",
    "users": "On a team's server: accounts and roles.",
    "health": "For the operator of the service.",
}


_ATTRIBUTE = re.compile(r"^ {4}(\w[\w, ]*): (.*(?:\n {8}.*)*)", re.MULTILINE)
REFERENCE = "#/components/schemas/{model}"


router = APIRouter(include_in_schema=False, route_class=Route)


@router.get("/openapi.json")
@may(Action.DESCRIBE, where=RoleScope.SOMEWHERE)
async def get_document(request: Request) -> JSONResponse:
    """What the server says of its addresses."""
    return JSONResponse(request.app.openapi())


def install_openapi_document(app: FastAPI) -> None:
    """Replace the framework's own description of errors by ours."""

    def build_openapi() -> dict[str, Any]:
        if app.openapi_schema is None:
            app.openapi_schema = _make_openapi_document(app)
        return app.openapi_schema

    app.openapi = build_openapi  # type: ignore[method-assign]


def _make_openapi_document(app: FastAPI) -> dict[str, Any]:
    document = get_openapi(
        title=app.title,
        version=app.version,
        summary=app.summary,
        description=DESCRIPTION,
        routes=app.routes,
        tags=[{"name": name, "description": text} for name, text in TAGS.items()],
    )
    routes = dict(list_routes(app))
    _complete_operations(document, routes)
    schemas = document["components"]["schemas"]
    for name in ("HTTPValidationError", "ValidationError"):
        schemas.pop(name, None)
    models: tuple[type[BaseModel], ...] = (Problem, *EVENTS.values())
    for model in models:
        described = model.model_json_schema(ref_template=REFERENCE)
        schemas.update(described.pop("$defs", {}))
        schemas[model.__name__] = described
    shown = [field.field_info.annotation for field in get_fields_from_routes(app.routes)]
    for kind in {
        value for model in (*shown, *models) for value in _iterate_dataclasses_of_type(model)
    }:
        _describe_dataclass_schema(kind, schemas)
    _describe_schemas(schemas)
    _describe_security(document, routes)
    _add_examples(document)
    return document


def _iterate_dataclasses_of_type(
    kind: Any, above: frozenset[Any] = frozenset()
) -> Iterator[type[Any]]:
    """Frozen values that a response holds, which are their own models."""
    if kind in above:
        return
    hints: Any = get_args(kind)
    if isinstance(kind, type) and is_dataclass(kind):
        yield kind
        hints = get_type_hints(kind).values()
    elif isinstance(kind, type) and issubclass(kind, BaseModel):
        hints = [field.annotation for field in kind.model_fields.values()]
    for hint in hints:
        yield from _iterate_dataclasses_of_type(hint, above | {kind})


def _describe_dataclass_schema(kind: type[Any], schemas: Mapping[str, dict[str, Any]]) -> None:
    """Say of a value that all its fields are there, and what each is as its docstring does."""
    schema, text = schemas[kind.__name__], inspect.cleandoc(kind.__doc__ or "")
    text = text.replace("``", "`").replace("None", "null")
    schema["description"], _, attributes = text.partition("\n\nAttributes:\n")
    schema["required"] = list(schema["properties"])
    for names, words in _ATTRIBUTE.findall(attributes):
        for name in names.split(", "):
            if name in schema["properties"]:
                schema["properties"][name]["description"] = " ".join(words.split())
    for one in schema["properties"].values():
        one.pop("default", None)


def _describe_schemas(schemas: dict[str, Any]) -> None:
    """Say what each property means, and that lists always have ``next``."""
    for name, schema in schemas.items():
        properties = schema.get("properties", {})
        for key, one in properties.items():
            if "description" not in one:
                words = PROPERTIES.get(f"{name}.{key}", PROPERTIES.get(key))
                one |= {} if words is None else {"description": words}
        if {"items", "next"} <= set(properties):
            schema["required"] = sorted(
                {*schema.get("required", ()), "next"}, key=[*properties].index
            )


def _describe_security(document: dict[str, Any], routes: Mapping[str, Route]) -> None:
    """Say with what one may ask: on a server that one person runs alone, with nothing."""
    document["components"]["securitySchemes"] = SCHEMES
    document["security"] = [*({name: []} for name in SCHEMES), {}]
    for path, operations in document["paths"].items():
        for method, operation in operations.items():
            if routes[f"{method.upper()} {path}"].permission.action is None:
                operation["security"] = []


def _add_examples(document: dict[str, Any]) -> None:
    """Give every answer in JSON an example."""
    schemas = document["components"]["schemas"]
    for operations in document["paths"].values():
        for operation in operations.values():
            for status, answer in operation["responses"].items():
                for kind, content in answer.get("content", {}).items():
                    is_given = {"example", "examples"} & set(content)
                    if status.startswith("2") and kind == "application/json" and not is_given:
                        content["example"] = make_example(content.get("schema", {}), schemas)


def _complete_operations(document: dict[str, Any], routes: Mapping[str, Route]) -> None:
    """Say what the framework cannot know, and not what belongs to a newer OpenAPI."""
    for path, operations in document["paths"].items():
        for method, operation in operations.items():
            # What the framework makes of a function's name may be that of another one, too.
            operation["summary"] = _format_summary(operation["operationId"])
            parameters = operation.setdefault("parameters", [])
            for parameter in parameters:
                if not parameter.get("description"):
                    words = PARAMETERS.get(parameter["name"])
                    parameter |= {} if words is None else {"description": words}
                # Asked for by our own code, which answers 428 where it is missing.
                if parameter["name"] == "If-Match":
                    parameter |= {"required": True, "schema": {"type": "string"}}
            named = {parameter["name"] for parameter in parameters}
            route = routes[f"{method.upper()} {path}"]
            kept = method != "get" and route.stores_response
            if kept and KEY_PARAMETER["name"] not in named:
                parameters.append(KEY_PARAMETER)
            for answer in operation["responses"].values():
                answer.get("content", {}).get("text/event-stream", {}).pop("itemSchema", None)
            operation["responses"].pop("422", None)
            success, *others = operation["responses"].items()
            refusals = _list_refusals(path, operation, route.permission)
            refusals |= {int(status) for status, _ in others if int(status) >= 400}
            known = {str(status): one for status, one in responses(*refusals).items()}
            operation["responses"] = dict([success]) | known | dict(others)


def _list_refusals(path: str, operation: Schema, permission: Permission) -> set[int]:
    """The statuses with which an operation refuses, as far as it itself need not say.

    Every one can meet a bad request (400), on a server of a team nobody logged in (401) or a role
    that does not suffice (403, as for an Origin that is not ours), and a busy database (503).
    """
    found = {400, 401, 403, 422, 500, 503}
    if "{" in path or permission.names or permission.body:
        found |= {404}
    if "requestBody" in operation:
        found |= {413, 415}
    if any(parameter["name"] == "If-Match" for parameter in operation["parameters"]):
        found |= {412, 428}
    return found


def _format_summary(name: str) -> str:
    """``listSavedViews`` as a person writes it: *List saved views*."""
    words = re.sub("([A-Z])", lambda found: f" {found[1].lower()}", name)
    return words[:1].upper() + words[1:]


SCHEMES: dict[str, Any] = {
    "session": {
        "type": "apiKey",
        "in": "cookie",
        "name": SESSION,
        "description": "The session of a person who has logged in on a server of a team, set by"
        " `POST /api/v1/session`; `__Host-` stands before its name if the server is reached by "
        "TLS. A"
        " change carries an `Origin` of the server, too.",
    },
    "token": {
        "type": "http",
        "scheme": "bearer",
        "bearerFormat": "tl_...",
        "description": (
            "A token of `POST /api/v1/tokens`, with which scripts act in the name of a person, "
            "within its scopes."
        ),
    },
}
KEY_PARAMETER: dict[str, Any] = {
    "name": "Idempotency-Key",
    "in": "header",
    "required": False,
    "schema": {"type": "string", "pattern": "^[!-~]{1,200}$"},
    "description": "Any text of up to 200 visible characters. The same key with the same request "
    "gives the first answer again, for a day; with another request, 422.",
}
