"""How a route responds: what its work came to is made a response once, stored with the work, and sent."""

from __future__ import annotations

import inspect
from collections.abc import Callable
from functools import partial, wraps
from typing import Annotated, Any, Concatenate, ParamSpec, TypeVar

from fastapi import Depends, Request
from starlette.responses import Response

from app.db.idempotency import KeyedRequest, PendingResponse, StoredResponse
from app.http.documents import json_of

P = ParamSpec("P")
T = TypeVar("T")

KEYED_REQUEST = "touchline.keyed_request"
"""Where a request's scope says under which key it was sent."""
STORED_HEADERS = ("content-type", "etag", "location", "cache-control")


def responds(
    make: Callable[Concatenate[T, ...], Response], *names: str
) -> Callable[[Callable[P, T | Response]], Callable[P, Response]]:
    """Let a route return what its work came to, of which the response is made.

    Under an Idempotency-Key the response is stored by the transaction that calls
    ``Session.respond`` with that outcome. A ``Response`` that the route returns is sent as it is.

    Args:
        make: Makes the response of the outcome.
        names: Parameters of the route that ``make`` takes, too.
    """

    def decorate(route: Callable[P, T | Response]) -> Callable[P, Response]:
        # A coroutine shares its thread with those of other requests.
        assert not inspect.iscoroutinefunction(route)

        @wraps(route)
        def respond(*, keyed_request: KeyedRequest | None = None, **given: Any) -> Response:
            made = partial(make, **{name: given[name] for name in names})
            pending = PendingResponse(keyed_request, made, stored_form)
            with pending.open():
                outcome: Any = route(**given)  # type: ignore[call-arg]
            return outcome if isinstance(outcome, Response) else pending.response_to(outcome)

        respond.__signature__ = _signature_with_key(route)  # type: ignore[attr-defined]
        return respond  # type: ignore[return-value]

    return decorate


def stored_form(response: Response, digest: str) -> StoredResponse:
    """What is stored of a response; ``digest`` is that of its request."""
    headers = {name: response.headers[name] for name in STORED_HEADERS if name in response.headers}
    return StoredResponse(digest, response.status_code, headers, bytes(response.body))


def document(content: Any, status: int = 200, headers: dict[str, str] | None = None) -> Response:
    """A document, or a frozen value that is its own, as it is sent."""
    return Response(json_of(content), status, headers, "application/json")


def as_document(show: Callable[[T], Any], status: int = 200) -> Callable[[T], Response]:
    """How an outcome is sent of which ``show`` makes a document."""
    return lambda outcome: document(show(outcome), status)


def no_content(_outcome: object) -> Response:
    """The response of what leaves nothing to say: 204."""
    return Response(status_code=204)


async def get_keyed_request(request: Request) -> KeyedRequest | None:
    """The key under which a request was sent, or None."""
    keyed: KeyedRequest | None = request.scope.get(KEYED_REQUEST)
    return keyed


def _signature_with_key(route: Callable[..., Any]) -> inspect.Signature:
    """The signature of a route as FastAPI calls it."""
    signature = inspect.signature(route, eval_str=True)
    keyword = inspect.Parameter.KEYWORD_ONLY
    given = [one.replace(kind=keyword) for one in signature.parameters.values()]
    keyed = Annotated[KeyedRequest | None, Depends(get_keyed_request)]
    added = inspect.Parameter("keyed_request", keyword, annotation=keyed)
    return signature.replace(parameters=[*given, added], return_annotation=Response)
