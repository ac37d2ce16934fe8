"""A request that is being carried out, as far as services know of it."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any

from app.db.idempotency import IdempotencyKey, KeyedRequest, PendingResponse, StoredResponse
from app.db.session import Session, pending_response


def keyed_request(key: str = "key", actor: str = "ann") -> PendingResponse[Any]:
    """The response to a request with a key, which is the outcome itself."""
    request = KeyedRequest(IdempotencyKey(key, actor, "digest"))
    return PendingResponse(
        request, lambda outcome: outcome, lambda _, digest: StoredResponse(digest, 200, {}, b"{}")
    )


class _Stored:
    key = None

    def __init__(self, store: Callable[[Session, Any], None]):
        self.store = store


@contextmanager
def stored_by(store: Callable[[Session, Any], None]) -> Iterator[None]:
    """Let a function take the place of the storing of a response."""
    token = pending_response.set(_Stored(store))
    try:
        yield
    finally:
        pending_response.reset(token)
