"""Requests in one form: one length, one Range, HEAD as GET, and no unknown or repeated parameters."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Callable, Iterator
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
_FIELDS: dict[Callable[..., Any], frozenset[str]] = {}
"""Of each route by its function, once somebody misspelt one."""


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
    known = _parameter_names(route) if place == "query" else _body_field_names(route)
    what = "parameter" if place == "query" else "field"
    nearest = get_close_matches(name, known, n=1)
    meant = f"; did you mean {nearest[0]}?" if nearest else ""
    return f"there is no such {what}{meant}"


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


def _body_field_names(route: APIRoute) -> frozenset[str]:
    """Every name that stands anywhere in the body of a route."""
    if route.body_field is None:
        return frozenset()
    if route.endpoint not in _FIELDS:
        body: Any = route.body_field.field_info.annotation
        # To make a schema takes milliseconds, in which nobody is answered.
        _FIELDS[route.endpoint] = frozenset(_property_names(TypeAdapter(body).json_schema()))
    return _FIELDS[route.endpoint]


def _property_names(schema: Any) -> Iterator[str]:
    if isinstance(schema, dict):
        properties = schema.get("properties")
        if isinstance(properties, dict):
            yield from properties
        for part in schema.values():
            yield from _property_names(part)
    elif isinstance(schema, list):
        for part in schema:
            yield from _property_names(part)
