"""Documents, responses made of them, and a cache of identical ones."""

from __future__ import annotations

import inspect
from collections import OrderedDict
from collections.abc import Callable
from dataclasses import fields
from functools import cache, partial, wraps
from inspect import get_annotations
from threading import Lock
from typing import Annotated, Any, Concatenate, Generic, ParamSpec, TypeVar, get_type_hints

from fastapi import Depends, Request
from pydantic import BaseModel, ConfigDict, Field, TypeAdapter
from starlette.responses import Response

from app.db.idempotency import KeyedRequest, PendingResponse, StoredResponse

Item = TypeVar("Item")


T = TypeVar("T")
R = TypeVar("R")
P = ParamSpec("P")
Outcome = TypeVar("Outcome")
KEYED_REQUEST = "touchline.keyed_request"
"""Where a request's scope says under which key it was sent."""
STORED_HEADERS = ("content-type", "etag", "location", "cache-control")


class Document(BaseModel):
    """An answer; a field is the attribute of that name, or the one that its alias names.

    One that ``shows`` a dataclass has all its fields, in their order, and writes down only those
    of which it says more: a description, another type. Fields of its own come after them.
    """

    model_config = ConfigDict(from_attributes=True, validate_by_name=True, validate_by_alias=True)

    def __init_subclass__(cls, shows: type[Any] | None = None, **options: Any) -> None:
        super().__init_subclass__(**options)
        if shows is not None:
            hints = get_type_hints(shows, include_extras=True)
            shown = {field.name: hints[field.name] for field in fields(shows)}
            cls.__annotations__ = shown | get_annotations(cls)


class RequestBody(BaseModel, extra="forbid"):
    """The body of a request, or a part of one: a field that it does not know is an error.

    Its ``examples``, if it has any, stand in its schema.
    """

    def __init_subclass__(cls, examples: list[Any] | None = None, **options: Any) -> None:
        super().__init_subclass__(**options)
        if examples is not None:
            cls.model_config["json_schema_extra"] = {"examples": examples}


def encode_document(value: Any) -> bytes:
    """The JSON of a document, or of a frozen dataclass, which is its own; no number is infinite or NaN."""
    kind: Any = type(value)
    return _adapter_of_type(kind).dump_json(value)


@cache
def _adapter_of_type(kind: Any) -> TypeAdapter[Any]:
    return TypeAdapter(kind)


class ListDocument(Document, Generic[Item]):
    """An answer of several things, in an order that its own words tell."""

    items: list[Item] = Field(description="The items; one page of them if `limit` is given.")
    next: str | None = Field(
        default=None, description="`cursor` of the next page; null on the last one."
    )


class IdentityCache(Generic[T, R]):
    """Calls a function once for each value; the value itself is the key, not what it equals.

    For frozen values that are expensive to hash and live as long as their own cache keeps them.

    Args:
        make: The function; it depends on nothing but the value and what is given beside it.
        size: How many results are kept; the one that was not asked for the longest goes first.
    """

    def __init__(self, make: Callable[..., R], size: int):
        self._make, self._size = make, size
        self._lock = Lock()
        self._kept: OrderedDict[int, tuple[T, tuple[object, ...], R]] = OrderedDict()

    def __call__(self, value: T, *beside: object) -> R:
        """What the function makes of the value; what is beside it counts by what it equals."""
        key = id(value)
        with self._lock:
            # A value that is kept lives, so no other has its id.
            if key in self._kept and self._kept[key][1] == beside:
                self._kept.move_to_end(key)
                return self._kept[key][2]
        made = self._make(value, *beside)
        with self._lock:
            self._kept[key] = value, beside, made
            self._kept.move_to_end(key)
            if len(self._kept) > self._size:
                self._kept.popitem(last=False)
        return made


def respond_with(
    make: Callable[Concatenate[Outcome, ...], Response], *names: str
) -> Callable[[Callable[P, Outcome | Response]], Callable[P, Response]]:
    """Let a route return what its work came to, of which the response is made.

    Under an Idempotency-Key the response is stored by the transaction that calls
    ``Session.respond`` with that outcome. A ``Response`` that the route returns is sent as it is.

    Args:
        make: Makes the response of the outcome.
        names: Parameters of the route that ``make`` takes, too.
    """

    def decorate(route: Callable[P, Outcome | Response]) -> Callable[P, Response]:
        # A coroutine shares its thread with those of other requests.
        assert not inspect.iscoroutinefunction(route)

        @wraps(route)
        def respond(*, keyed_request: KeyedRequest | None = None, **given: Any) -> Response:
            made = partial(make, **{name: given[name] for name in names})
            pending = PendingResponse(keyed_request, made, make_stored_response)
            with pending.activate():
                outcome: Any = route(**given)  # type: ignore[call-arg]
            return (
                outcome if isinstance(outcome, Response) else pending.make_or_get_response(outcome)
            )

        respond.__signature__ = _add_key_parameter(route)  # type: ignore[attr-defined]
        return respond  # type: ignore[return-value]

    return decorate


def make_stored_response(response: Response, digest: str) -> StoredResponse:
    """What is stored of a response; ``digest`` is that of its request."""
    headers = {name: response.headers[name] for name in STORED_HEADERS if name in response.headers}
    return StoredResponse(digest, response.status_code, headers, bytes(response.body))


def make_document_response(
    content: Any, status: int = 200, headers: dict[str, str] | None = None
) -> Response:
    """A document, or a frozen value that is its own, as it is sent."""
    return Response(encode_document(content), status, headers, "application/json")


def make_document_responder(
    show: Callable[[Outcome], Any], status: int = 200
) -> Callable[[Outcome], Response]:
    """How an outcome is sent of which ``show`` makes a document."""
    return lambda outcome: make_document_response(show(outcome), status)


def make_empty_response(_outcome: object) -> Response:
    """The response of what leaves nothing to say: 204."""
    return Response(status_code=204)


async def get_keyed_request(request: Request) -> KeyedRequest | None:
    """The key under which a request was sent, or None."""
    keyed: KeyedRequest | None = request.scope.get(KEYED_REQUEST)
    return keyed


def _add_key_parameter(route: Callable[..., Any]) -> inspect.Signature:
    """The signature of a route as FastAPI calls it."""
    signature = inspect.signature(route, eval_str=True)
    keyword = inspect.Parameter.KEYWORD_ONLY
    given = [one.replace(kind=keyword) for one in signature.parameters.values()]
    keyed = Annotated[KeyedRequest | None, Depends(get_keyed_request)]
    added = inspect.Parameter("keyed_request", keyword, annotation=keyed)
    return signature.replace(parameters=[*given, added], return_annotation=Response)
