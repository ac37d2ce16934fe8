"""Idempotency: a request that is sent again under its key gets its first response, and is not repeated.

The response is stored in the transaction of the work (``Session.respond``), so that wherever the
server is stopped a repetition finds either both or neither.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Any, Generic, TypeVar

from app.db.json_columns import Json, parse
from app.db.session import Session, pending_response
from app.db.store import Store
from app.db.stored_responses import UNDER_WAY, find_response, insert_response
from app.db.stored_responses import IdempotencyKey as IdempotencyKey
from app.db.stored_responses import StoredResponse as StoredResponse
from app.errors import ConflictError
from app.finite import json_text

R = TypeVar("R")


@dataclass
class KeyedRequest:
    """A request with an Idempotency-Key; ``stored`` once its response is in the database."""

    key: IdempotencyKey
    stored: bool = False


class PendingResponse(Generic[R]):
    """The response to the request that a route carries out.

    Args:
        request: The request, where it has a key; else nothing is stored.
        make: Makes the response of what the work came to.
        encode: What is stored of a response.
    """

    def __init__(
        self,
        request: KeyedRequest | None,
        make: Callable[[Any], R],
        encode: Callable[[R, str], StoredResponse],
    ):
        self._request, self._make, self._encode = request, make, encode
        self._committed: tuple[object, R | None] | None = None

    @property
    def key(self) -> IdempotencyKey | None:
        """Under which the request was sent."""
        return None if self._request is None else self._request.key

    @contextmanager
    def open(self) -> Iterator[None]:
        """Let the work that is done meanwhile, in this thread, answer with ``Session.respond``."""
        token = pending_response.set(self)
        try:
            yield
        finally:
            pending_response.reset(token)

    def store(self, session: Session, outcome: object) -> None:
        """Store the response in the transaction of its work.

        Raises:
            ConflictError: One is stored already: the work was done meanwhile.
            RuntimeError: The request was answered in an earlier transaction.
        """
        if self._committed is not None:
            raise RuntimeError("a request is answered once: use without_response for inner work")
        response: R | None = None
        if self._request is not None:
            key, response = self._request.key, self._make(outcome)
            stored = self._encode(response, key.request_digest)
            if not insert_response(session, key.key, key.actor, stored):
                raise ConflictError(
                    "the same request was answered in the meantime",
                    hint="Wait, then send it again with the same Idempotency-Key.",
                )
        session.once_kept(lambda: self._commit(outcome, response))

    def _commit(self, outcome: object, response: R | None) -> None:
        self._committed = outcome, response
        if self._request is not None:
            self._request.stored = True

    def response_to(self, outcome: object) -> R:
        """The response to send: the stored one, or a new one where nothing is stored.

        Raises:
            RuntimeError: The response that is stored was made of another outcome.
        """
        if self._committed is None:
            return self._make(outcome)
        answered, response = self._committed
        if answered is not outcome:
            raise RuntimeError("a route must return the outcome that its request is answered with")
        return self._make(outcome) if response is None else response


@contextmanager
def without_response() -> Iterator[None]:
    """For work inside other work: the outer one answers the request."""
    token = pending_response.set(None)
    try:
        yield
    finally:
        pending_response.reset(token)


def has_key() -> bool:
    """Whether the request that this thread carries out was sent under a key."""
    pending = pending_response.get()
    return pending is not None and pending.key is not None


def read_progress(session: Session) -> Json | None:
    """How far this very request had come when a server was stopped; None where it begins.

    Work of several transactions saves it in each of them, and goes on from it.
    """
    key = session.idempotency_key
    found = None if key is None else find_response(session, key.key, key.actor)
    if found is None or found.body is None or not found.under_way:
        return None
    return parse(found.body)


def save_progress(session: Session, value: Json) -> None:
    """Save how far a request with a key is, where its response will be."""
    key = session.idempotency_key
    if key is not None:
        body = json_text(value).encode()
        progress = StoredResponse(key.request_digest, UNDER_WAY, {}, body)
        insert_response(session, key.key, key.actor, progress)


def find_stored(
    store: Store, key: str, actor: str, *, at_once: bool = False
) -> StoredResponse | None:
    """The response that is stored under an actor's key, or None.

    Args:
        store: The database.
        key: Of the request.
        actor: Who sent it.
        at_once: Not to wait for anything, as on the event loop.

    Raises:
        BusyError: There was something to wait for.
    """
    with store.read_without_waiting() if at_once else store.read_one() as session:
        return find_response(session, key, actor)


def claim(store: Store, key: str, actor: str) -> bool:
    """Let no other process respond under a key; False where one does at the moment.

    Raises:
        StorageError: The database cannot be asked.
    """
    return store.sharing.claim(_claim_name(key, actor))


def end_claim(store: Store, key: str, actor: str) -> None:
    """Let others respond under it: what they find is stored by now."""
    store.sharing.release(_claim_name(key, actor))


def _claim_name(key: str, actor: str) -> str:
    return f"answer/{actor}/{key}"


def store_sent(store: Store, key: str, actor: str, response: StoredResponse) -> None:
    """Store a response that was sent already; one that is stored under its key stays."""
    with store.write() as session:
        insert_response(session, key, actor, response)
