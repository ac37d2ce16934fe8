"""Names that nobody knows: a parameter or field that would be ignored is refused, with the nearest one.

So is a parameter that stands there twice, of which one would be ignored.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterator
from difflib import get_close_matches
from functools import lru_cache
from typing import Any

from fastapi import Request
from fastapi.dependencies.utils import get_dependant, get_flat_params
from fastapi.exceptions import RequestValidationError
from fastapi.params import Query
from fastapi.routing import APIRoute
from pydantic import TypeAdapter

UNKNOWN = "extra_forbidden"
"""What the framework calls a field that a body does not have."""
REPEATED = "repeated"
"""What we call a parameter that is there more than once."""
_ONCE = "is there more than once; no parameter is a list"
_FIELDS: dict[Callable[..., Any], frozenset[str]] = {}
"""Of each route by its function, once somebody misspelt one."""


async def refuse_unknown_parameters(request: Request) -> None:
    """Refuse a query parameter that its route does not read, or of which it would read one alone.

    Raises:
        RequestValidationError: There is one; a misspelt ``dry_run`` must not become a deed.
    """
    known = _parameters(request.scope["route"])
    given = Counter(name for name, _ in request.query_params.multi_items())
    problems = [
        {"type": REPEATED if name in known else UNKNOWN, "loc": ("query", name), "msg": _ONCE}
        for name, times in given.items()
        if name not in known or times > 1
    ]
    if problems:
        raise RequestValidationError(problems)


def sentence_about(request: Request, location: tuple[int | str, ...]) -> str:
    """What to say of a name that nobody knows, at its place in the request."""
    place, name = location[0], str(location[-1])
    route = request.scope["route"]
    known = _parameters(route) if place == "query" else _fields(route)
    what = "parameter" if place == "query" else "field"
    nearest = get_close_matches(name, known, n=1)
    meant = f"; did you mean {nearest[0]}?" if nearest else ""
    return f"there is no such {what}{meant}"


def _parameters(route: APIRoute) -> frozenset[str]:
    return _read_by(route.path_format, route.endpoint)


@lru_cache(maxsize=256)
def _read_by(path: str, endpoint: Callable[..., Any]) -> frozenset[str]:
    dependant = get_dependant(path=path, call=endpoint)
    found = get_flat_params(dependant)
    return frozenset(item.alias for item in found if isinstance(item.field_info, Query))


def _fields(route: APIRoute) -> frozenset[str]:
    """Every name that stands anywhere in the body of a route."""
    if route.body_field is None:
        return frozenset()
    if route.endpoint not in _FIELDS:
        body: Any = route.body_field.field_info.annotation
        # To make a schema takes milliseconds, in which nobody is answered.
        _FIELDS[route.endpoint] = frozenset(_names(TypeAdapter(body).json_schema()))
    return _FIELDS[route.endpoint]


def _names(schema: Any) -> Iterator[str]:
    if isinstance(schema, dict):
        properties = schema.get("properties")
        if isinstance(properties, dict):
            yield from properties
        for part in schema.values():
            yield from _names(part)
    elif isinstance(schema, list):
        for part in schema:
            yield from _names(part)
