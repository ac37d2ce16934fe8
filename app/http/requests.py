"""Requests in one form: one length, one Range, HEAD as GET, and no unknown or repeated parameters."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Callable, Mapping
from difflib import get_close_matches
from functools import lru_cache
from typing import Any, get_args

from fastapi import Request
from fastapi.dependencies.utils import get_dependant, get_flat_params
from fastapi.exceptions import RequestValidationError
from fastapi.params import Path, Query
from fastapi.routing import APIRoute
from pydantic import TypeAdapter
from starlette.datastructures import Headers
from starlette.types import ASGIApp, Message, Receive, Scope, Send

from app.http.problem import make_problem, problem_response

_HEAD = "touchline.head"
_ONE_RANGE = re.compile(rb"bytes=(\d{1,18}-\d{0,18}|-\d{1,18})")


UNKNOWN = "extra_forbidden"
"""What the framework calls a field that a body does not have."""
REPEATED = "repeated"
"""What we call a parameter that is there more than once."""
_ONCE = "is there more than once; no parameter is a list"
_NO_NUMBER = "must be a number in plain digits"
_INT = re.compile(r"0|-?[1-9][0-9]*")
_FLOAT = re.compile(r"-?[0-9]+(?:\.[0-9]+)?(?:[eE][+-]?[0-9]+)?")
_FIELDS: dict[Callable[..., Any], dict[tuple[str, ...], frozenset[str]]] = {}
"""Of each route by its function, once somebody misspelt one."""
MOST_NAMED = 8
"""Names that an error lists; of more than that it lists none."""


class HeadAsGet:
    """Answers HEAD wherever GET is answered, with the same headers and no body."""

    def __init__(self, app: ASGIApp):
        self.app = app

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        if scope["type"] != "http" or scope["method"] != "HEAD":
            await self.app(scope, receive, send)
            return

        async def send_without_body(message: Message) -> None:
            if message["type"] == "http.response.body":
                message = {**message, "body": b""}
            await send(message)

        await self.app({**scope, "method": "GET", _HEAD: True}, receive, send_without_body)


def is_head(scope: Scope) -> bool:
    """Whether a request that looks like GET was HEAD: what has no end must end at once."""
    return bool(scope.get(_HEAD))


class OneLength:
    """Refuses a request that says twice how long it is: proxies differ in whom they believe."""

    def __init__(self, app: ASGIApp):
        self.app = app

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        names = {name for name, _ in scope["headers"]} if scope["type"] == "http" else set()
        if {b"content-length", b"transfer-encoding"} <= names:
            problem = make_problem(400, "Content-Length and Transfer-Encoding exclude each other")
            await problem_response(problem, {"Connection": "close"})(scope, receive, send)
            return
        await self.app(scope, receive, send)


def _is_one_range(value: bytes) -> bool:
    """Whether a Range names one part that ends where it begins, or later."""
    found = _ONE_RANGE.fullmatch(value)
    if found is None:
        return False
    first, _, last = found[1].partition(b"-")
    return not first or not last or int(first) <= int(last)


class OneRange:
    """Lets one Range through; many small ones would cost more than the whole file."""

    def __init__(self, app: ASGIApp):
        self.app = app

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        if scope["type"] != "http" or "range" not in Headers(scope=scope):
            await self.app(scope, receive, send)
            return
        ranges = [value for name, value in scope["headers"] if name == b"range"]
        if len(ranges) != 1 or not _is_one_range(ranges[0]):
            rest = [(name, value) for name, value in scope["headers"] if name != b"range"]
            await self.app({**scope, "headers": rest}, receive, send)
            return
        refused = False

        async def send_or_refuse(message: Message) -> None:
            nonlocal refused
            if message["type"] == "http.response.start" and message["status"] == 416:
                refused = True
                size = Headers(raw=message["headers"]).get("content-range", "bytes */*")
                problem = make_problem(416, "the file ends before that range begins")
                await problem_response(problem, {"Content-Range": size})(scope, receive, send)
            elif not refused:
                await send(message)

        await self.app(scope, receive, send_or_refuse)


async def refuse_unknown_parameters(request: Request) -> None:
    """Refuse a query parameter that its route does not read, or of which it would read one alone.

    Raises:
        RequestValidationError: There is one; a misspelt ``dry_run`` must not become a deed. Or a number
            is spelled as Python's ``int`` reads it and nobody writes it: ``1_0``, ``+1``, `` 1``.
    """
    route = request.scope["route"]
    known = _parameter_names(route)
    given = Counter(name for name, _ in request.query_params.multi_items())
    problems = [
        {"type": REPEATED if name in known else UNKNOWN, "loc": ("query", name), "msg": _ONCE}
        for name, times in given.items()
        if name not in known or times > 1
    ]
    for place, name, spelling in _number_parameters(route.path_format, route.endpoint):
        sent = request.path_params if place == "path" else request.query_params
        if name in sent and not spelling.fullmatch(str(sent[name])):
            problems.append({"type": "value_error", "loc": (place, name), "msg": _NO_NUMBER})
    if problems:
        raise RequestValidationError(problems)


def sentence_about(request: Request, location: tuple[int | str, ...]) -> str:
    """What to say of a name that nobody knows, at its place in the request."""
    place, name = location[0], str(location[-1])
    route = request.scope["route"]
    if place == "query":
        nearest = get_close_matches(name, _parameter_names(route), n=1)
        return f"there is no such parameter{_meant(nearest)}"
    by_place = _body_field_names(route)
    # Items of a list have no place of their own in a schema.
    above = tuple(str(part) for part in location[1:-1] if not isinstance(part, int))
    known = by_place.get(above)
    if known is None:
        known = frozenset(one for names in by_place.values() for one in names if one != name)
    nearest = get_close_matches(name, known, n=1)
    if nearest:
        return f"there is no such field{_meant(nearest)}"
    places = [f"/{'/'.join((*at, name))}" for at, names in by_place.items() if name in names]
    belongs = f", it belongs at {' or '.join(places)}" if places else ""
    here = f"; known here: {', '.join(sorted(known))}" if 0 < len(known) <= MOST_NAMED else ""
    return f"there is no such field{belongs}{here}"


def _meant(nearest: list[str]) -> str:
    return f"; did you mean {nearest[0]}?" if nearest else ""


def _parameter_names(route: APIRoute) -> frozenset[str]:
    return _names_read_by_endpoint(route.path_format, route.endpoint)


@lru_cache(maxsize=256)
def _names_read_by_endpoint(path: str, endpoint: Callable[..., Any]) -> frozenset[str]:
    dependant = get_dependant(path=path, call=endpoint)
    found = get_flat_params(dependant)
    return frozenset(item.alias for item in found if isinstance(item.field_info, Query))


@lru_cache(maxsize=256)
def _number_parameters(
    path: str, endpoint: Callable[..., Any]
) -> tuple[tuple[str, str, re.Pattern[str]], ...]:
    """Place, name and spelling of each parameter of a route that is a number."""
    found = []
    for item in get_flat_params(get_dependant(path=path, call=endpoint)):
        info, kind = item.field_info, item.field_info.annotation
        place = "query" if isinstance(info, Query) else "path" if isinstance(info, Path) else ""
        kinds = {kind, *get_args(kind)}
        if place and kinds & {int, float} and bool not in kinds:
            found.append((place, item.alias, _FLOAT if float in kinds else _INT))
    return tuple(found)


def _body_field_names(route: APIRoute) -> dict[tuple[str, ...], frozenset[str]]:
    """The names of each object in the body of a route, by the names that lead to it."""
    if route.body_field is None:
        return {}
    if route.endpoint not in _FIELDS:
        body: Any = route.body_field.field_info.annotation
        # To make a schema takes milliseconds, in which nobody is answered.
        schema = TypeAdapter(body).json_schema()
        found: dict[tuple[str, ...], set[str]] = {}
        _collect_property_names(schema, schema.get("$defs", {}), (), found, frozenset())
        _FIELDS[route.endpoint] = {place: frozenset(names) for place, names in found.items()}
    return _FIELDS[route.endpoint]


def _collect_property_names(
    schema: Any,
    definitions: Mapping[str, Any],
    place: tuple[str, ...],
    found: dict[tuple[str, ...], set[str]],
    above: frozenset[str],
) -> None:
    """Adds the names of a schema's objects to those of their places; items of a list are at its own.

    Args:
        schema: Part of a JSON schema.
        definitions: What its references mean.
        place: Names that lead to the part.
        found: Result: names by place.
        above: References that led to the part: one that holds itself is not followed again.
    """
    if not isinstance(schema, dict):
        return
    name = str(schema.get("$ref", "")).rpartition("/")[2]
    if name and name not in above:
        _collect_property_names(definitions[name], definitions, place, found, above | {name})
    for key in ("anyOf", "oneOf", "allOf"):
        for part in schema.get(key, ()):
            _collect_property_names(part, definitions, place, found, above)
    _collect_property_names(schema.get("items"), definitions, place, found, above)
    for key, part in schema.get("properties", {}).items():
        found.setdefault(place, set()).add(key)
        _collect_property_names(part, definitions, (*place, key), found, above)
