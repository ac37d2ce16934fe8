"""Requests: in one form (one length, one Range, HEAD as GET, no unknown or repeated parameters), and their bodies: JSON
alone, capped while they arrive, and plain enough for every reader.
"""

from __future__ import annotations

import asyncio
import json
import re
from collections import Counter
from collections.abc import Callable, Iterable, Mapping
from difflib import get_close_matches
from functools import lru_cache
from typing import Any, NoReturn, get_args

import numpy as np
from fastapi import Request
from fastapi.dependencies.utils import get_dependant, get_flat_params
from fastapi.exceptions import RequestValidationError
from fastapi.params import Path, Query
from fastapi.routing import APIRoute
from pydantic import TypeAdapter
from starlette.datastructures import Headers
from starlette.responses import Response
from starlette.types import ASGIApp, Message, Receive, Scope, Send

from app.http.problem import make_problem, problem_response
from app.json_text import quote_text

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


class AmbiguousLengthGuard:
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


class SingleRangeFilter:
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
                problem = make_problem(416, "the requested range begins after the end of the file")
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
    for place, name, spelling in _list_numeric_parameters(route.path_format, route.endpoint):
        sent = request.path_params if place == "path" else request.query_params
        if name in sent and not spelling.fullmatch(str(sent[name])):
            problems.append({"type": "value_error", "loc": (place, name), "msg": _NO_NUMBER})
    if problems:
        raise RequestValidationError(problems)


def describe_unknown_name(request: Request, location: tuple[int | str, ...]) -> str:
    """What to say of a name that nobody knows, at its place in the request."""
    place, name = location[0], str(location[-1])
    route = request.scope["route"]
    if place == "query":
        nearest = get_close_matches(name, _parameter_names(route), n=1)
        return f"there is no such parameter{_suggest_nearest(nearest)}"
    by_place = _body_field_names(route)
    # Items of a list have no place of their own in a schema.
    above = tuple(str(part) for part in location[1:-1] if not isinstance(part, int))
    known = by_place.get(above)
    if known is None:
        known = frozenset(one for names in by_place.values() for one in names if one != name)
    nearest = get_close_matches(name, known, n=1)
    if nearest:
        return f"there is no such field{_suggest_nearest(nearest)}"
    places = [f"/{'/'.join((*at, name))}" for at, names in by_place.items() if name in names]
    belongs = f", it belongs at {' or '.join(places)}" if places else ""
    here = f"; known here: {', '.join(sorted(known))}" if 0 < len(known) <= MOST_NAMED else ""
    return f"there is no such field{belongs}{here}"


def _suggest_nearest(nearest: list[str]) -> str:
    return f"; did you mean {nearest[0]}?" if nearest else ""


def _parameter_names(route: APIRoute) -> frozenset[str]:
    return _list_query_names(route.path_format, route.endpoint)


@lru_cache(maxsize=256)
def _list_query_names(path: str, endpoint: Callable[..., Any]) -> frozenset[str]:
    dependant = get_dependant(path=path, call=endpoint)
    found = get_flat_params(dependant)
    return frozenset(item.alias for item in found if isinstance(item.field_info, Query))


@lru_cache(maxsize=256)
def _list_numeric_parameters(
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


MAX_JSON_BYTES = 512 * 1024
"""A group with every line of six views is below 50 kB; what is longer is refused before it is read."""
BYTES = "application/octet-stream"
"""What upload routes take, and nothing else does."""
MAX_DEPTH = 16
MAX_CONTAINERS = 5_000
"""Lists and objects of one body: a request may bring 2,000 points, and each is an object. Ten times as
many were read for a second, in which nobody else was answered."""
MAX_VALUES = 10_000
"""Values of one body, by its commas: 2,000 points are 4,000. Each one that is wrong costs as much as ten
that are right, and whoever asks for that is answered before anybody is known by name."""
MAX_NAMES = 200
"""Names of one object: the 26 markings, or 64 views, and room for what comes."""
MAX_NAME = 1_000
"""Characters of a name; that of a view is a file's."""
MAX_STRANGERS_BYTES = 64 * 1024
"""Of what is asked before anybody is known: a passkey's answer has three texts of 16 kB at most."""
BODY_SECONDS = 20.0
"""For each ``BODY_BYTES`` of a body, and for what is left of it: so long a client may let the server wait."""
BODY_BYTES = 16 * 1024
# Possessive, and the closing quote may be missing: linear on whatever comes.
_STRINGS = re.compile(rb'"(?:[^"\\]|\\.)*+"?', re.DOTALL)
_NO_BRACKETS = bytes(sorted(set(range(256)) - set(b"[]{}")))
_STEPS = np.zeros(256, np.int32)
_STEPS[list(b"[{")], _STEPS[list(b"]}")] = 1, -1
_DOUBTFUL = re.compile(rb"\\u[dD][89abAB]|\d[eE]\+?\d|\d{300}")
"""What may be half of a surrogate pair, or a number that is too large."""


class BodyError(Exception):
    """A body that is refused, and the status that says so."""

    def __init__(self, status: int, detail: str, hint: str | None = None):
        super().__init__(detail)
        self.status, self.detail, self.hint = status, detail, hint

    def response(self) -> Response:
        """What its sender is told."""
        problem = make_problem(self.status, self.detail, hint=self.hint)
        # The rest of the body is unread: the connection cannot carry another request.
        headers = {"Connection": "close"} if self.status in (408, 413) else None
        return problem_response(problem, headers)


class TimedBody:
    """Receives a body from a client that has to send it steadily; the time that the server takes does not count.

    Args:
        receive: Gives the next message.
    """

    def __init__(self, receive: Receive):
        self._receive = receive
        self._seconds, self._bytes, self._ended = BODY_SECONDS, 0, False

    async def receive(self) -> Message:
        """The next message.

        Raises:
            BodyError: It did not come in time.
        """
        if self._ended:
            return await self._receive()
        clock = asyncio.get_running_loop().time
        began = clock()
        try:
            async with asyncio.timeout(self._seconds):
                message = await self._receive()
        except TimeoutError:
            raise BodyError(408, "the rest of the request body was not received in time") from None
        self._seconds -= clock() - began
        self._bytes += len(message.get("body", b""))
        if self._bytes >= BODY_BYTES:
            self._seconds, self._bytes = BODY_SECONDS, 0
        self._ended = not message.get("more_body", False)
        return message


def read_json(body: bytes) -> Any:
    """The value of a body; raises ``BodyError`` unless the bytes are JSON as RFC 8259 has it, finite and flat enough.

    Python's reader also takes NaN, Infinity, 1e999, other encodings and lone surrogates; none of
    these survives a way through a database or another program.
    """
    try:
        text = body.decode("utf-8")
    except UnicodeDecodeError:
        raise BodyError(400, "the body is not UTF-8 text") from None
    _require_json_size_limits(body)
    try:
        value = json.loads(
            text, parse_constant=_refuse_constant, object_pairs_hook=_build_object_with_unique_keys
        )
    except ValueError as error:
        place = f" at character {error.pos}" if isinstance(error, json.JSONDecodeError) else ""
        raise BodyError(400, f"the body is not JSON{place}") from None
    if _DOUBTFUL.search(body):
        _require_encodable(value)
    if rb"\u0000" in body and (where := _find_null_character(value)) is not None:
        raise BodyError(
            400,
            f"the text at {quote_text(where, 80)} in the body holds U+0000, which is not stored",
            hint="Leave it out.",
        )
    return value


def _find_null_character(value: object, place: str = "") -> str | None:
    """JSON pointer to a text, or to a name, that holds U+0000; None where there is none."""
    parts: Iterable[tuple[object, object]] = ()
    if isinstance(value, str):
        return place or "/" if "\0" in value else None
    if isinstance(value, dict):
        if any("\0" in name for name in value):
            return place or "/"
        parts = value.items()
    elif isinstance(value, list):
        parts = enumerate(value)
    found = (_find_null_character(part, f"{place}/{name}") for name, part in parts)
    return next((one for one in found if one is not None), None)


def _require_json_size_limits(body: bytes) -> None:
    """Count brackets and commas before anything is made of them, on text that may not be JSON."""
    outside = _remove_strings(body)
    if outside.count(b",") > MAX_VALUES:
        raise BodyError(400, f"the body holds more than {MAX_VALUES} values")
    brackets = outside.translate(None, _NO_BRACKETS)
    steps = _STEPS[np.frombuffer(brackets, np.uint8)]
    if np.cumsum(steps).max(initial=0) > MAX_DEPTH:
        raise BodyError(400, f"the body is nested more than {MAX_DEPTH} levels deep")
    if np.count_nonzero(steps > 0) > MAX_CONTAINERS:
        raise BodyError(400, f"the body holds more than {MAX_CONTAINERS} lists and objects")


def _remove_strings(body: bytes) -> bytes:
    """What stands outside of quotes."""
    if b"\\" in body:
        return _STRINGS.sub(b"", body)
    # Every other part lies between quotes: five times as quick, and while it lasts nobody is answered.
    return b"".join(body.split(b'"')[::2])


def _refuse_constant(name: str) -> NoReturn:
    raise BodyError(400, f"{name} is not a number in JSON")


def _build_object_with_unique_keys(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
    """An object whose names differ: of two equal ones, readers disagree which counts."""
    if len(pairs) > MAX_NAMES:
        raise BodyError(400, f"a JSON object of the body has more than {MAX_NAMES} keys")
    if any(len(name) > MAX_NAME for name, _ in pairs):
        raise BodyError(400, f"a name in the body has more than {MAX_NAME} characters")
    found = dict(pairs)
    if len(found) < len(pairs):
        names = Counter(name for name, _ in pairs)
        raise BodyError(
            400,
            f"a JSON object of the body has the key {quote_text(names.most_common(1)[0][0], 80)}"
            " more than once",
        )
    return found


def _require_encodable(value: object) -> None:
    try:
        json.dumps(value, ensure_ascii=False, allow_nan=False).encode("utf-8")
    except UnicodeEncodeError:
        raise BodyError(400, "a text in the body is not valid Unicode") from None
    except ValueError:
        raise BodyError(400, "a number in the body is too large") from None


async def read_body(headers: Headers, receive: Receive, most: int) -> bytes:
    """The body of a request, of so many bytes at most.

    An honest Content-Length is refused before a byte is read; a dishonest or chunked one is cut off as
    soon as the cap is passed.

    Raises:
        BodyError: It is longer, does not come in time, or whoever sent it has left.
    """
    declared = headers.get("content-length", "0")
    if not declared.isascii() or not declared.isdigit():
        raise BodyError(400, "Content-Length is not a number")
    if len(declared) > 18 or int(declared) > most:
        raise _too_large_error(most)
    body, timed = bytearray(), TimedBody(receive)
    more = True
    while more:
        message = await timed.receive()
        if message["type"] == "http.disconnect":
            raise BodyError(400, "the body was cut off")
        body += message.get("body", b"")
        more = message.get("more_body", False)
        if len(body) > most:
            raise _too_large_error(most)
    return bytes(body)


def _too_large_error(most: int) -> BodyError:
    return BodyError(413, f"a request body may have at most {most} bytes")


def require_bytes_type(types: list[str]) -> None:
    """Raise ``BodyError`` (415) unless the Content-Type is plain bytes."""
    if [kind.strip().lower() for kind in types] != [BYTES]:
        raise BodyError(415, "an upload must be plain bytes", hint=f"Send Content-Type: {BYTES}.")


def require_json_type(types: list[str]) -> None:
    """Raise ``BodyError`` (415) unless the Content-Type is JSON in UTF-8."""
    kind, *parameters = [part.strip().lower() for part in "".join(types).split(";")]
    charsets = [item.partition("=")[2].strip('"') for item in parameters if "charset" in item]
    if len(types) != 1 or kind != "application/json" or any(c != "utf-8" for c in charsets):
        raise BodyError(
            415, "a request body must be JSON", hint="Send Content-Type: application/json."
        )
