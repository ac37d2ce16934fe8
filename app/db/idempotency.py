"""Idempotency: a request that is sent again under its key gets its first response, and is not repeated.

The response is stored in the transaction of the work (``Session.respond``), so that wherever the
server is stopped a repetition finds either both or neither.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from datetime import UTC, datetime, timedelta
from typing import Any, Generic, TypeVar, cast

from sqlalchemy import Index, LargeBinary, Table, bindparam, delete, or_, select, text
from sqlalchemy.orm import Mapped, mapped_column
from zlib_ng import zlib_ng

from app.db.dialects.dialect import insert
from app.db.json_columns import Json, decompress, parse_json_column
from app.db.session import Base, Session, format_utc_time, now, pending_response
from app.db.store import Store
from app.errors import ConflictError
from app.json_text import json_text


class StoredResponseModel(Base):
    """The response to a request that carried an Idempotency-Key (the body compressed)."""

    __tablename__ = "answer"
    __table_args__ = (Index("answer_at", "at"),)

    key: Mapped[str] = mapped_column(primary_key=True)
    actor: Mapped[str] = mapped_column(primary_key=True)
    request_digest: Mapped[str]
    status: Mapped[int]
    headers: Mapped[str]
    body: Mapped[bytes] = mapped_column(LargeBinary)
    at: Mapped[str]


KEPT_HOURS = 24
"""How long a response is stored; what an edit builds on (If-Match) still stops a later repetition."""
UNDER_WAY = 102
"""Status of a response that is none yet: the row holds how far the work is."""
_FAST = 2
_RESPONSE = cast(Table, StoredResponseModel.__table__)


@dataclass(frozen=True)
class IdempotencyKey:
    """Names one request: the key, the actor who sent it, and the digest of what it asks for."""

    key: str
    actor: str
    request_digest: str


@dataclass(frozen=True)
class StoredResponse:
    """A response as it was sent; ``request_digest`` is that of the request.

    The body is None where it is no longer stored: the request was carried out, and shall not be
    again.
    """

    request_digest: str
    status: int
    headers: dict[str, str]
    body: bytes | None

    @property
    def is_in_progress(self) -> bool:
        """Whether it is none yet: the work was begun, and the body says how far it is."""
        return self.status == UNDER_WAY


def find_response(session: Session, key: str, actor: str) -> StoredResponse | None:
    """The response that is stored under an actor's key, or None."""
    row = session.execute(
        _FIND, {"key": key, "actor": actor, "oldest": _oldest_kept_time()}
    ).one_or_none()
    if row is None:
        return None
    body = decompress(row.body) if row.body else None
    return StoredResponse(row.request_digest, row.status, parse_json_column(row.headers), body)


def insert_response(session: Session, key: str, actor: str, response: StoredResponse) -> bool:
    """Store a response under an actor's key; False where one is stored already, which stays."""
    row = {
        "key": key,
        "actor": actor,
        "request_digest": response.request_digest,
        "status": response.status,
        "headers": json_text(response.headers, ascii_=True),
        "body": zlib_ng.compress(response.body or b"", _FAST),
        "at": now(),
        "oldest": _oldest_kept_time(),
    }
    return session.execute(_KEEP, row).one_or_none() is not None


def delete_old_responses(session: Session) -> int:
    """Delete the responses that are too old; returns how many."""
    gone = (
        delete(StoredResponseModel)
        .where(StoredResponseModel.at < _oldest_kept_time())
        .returning(StoredResponseModel.key)
    )
    return len(session.scalars(gone).all())


def delete_oldest_response_bodies(session: Session, most: int) -> int:
    """Delete the bodies of the oldest responses, so that all take at most so many bytes.

    Their keys stay for as long as was promised: the requests still count once.

    Returns:
        How many lost it.
    """
    return len(session.scalars(_SHORTEN, {"most": most, "empty": b""}).all())


def _oldest_kept_time() -> str:
    oldest = datetime.now(UTC) - timedelta(hours=KEPT_HOURS)
    return format_utc_time(oldest)


_SHORTEN = text(
    "UPDATE answer SET body = :empty WHERE (key, actor) IN (SELECT key, actor FROM (SELECT key,"
    " actor, status, length(body) AS size, sum(length(body)) OVER (ORDER BY at DESC, key, actor)"
    " AS total FROM answer) AS sized WHERE total > :most AND size > 0 AND status >= 200)"
    " RETURNING key"
)
_FIND = select(*_RESPONSE.columns).where(
    _RESPONSE.c.key == bindparam("key"),
    _RESPONSE.c.actor == bindparam("actor"),
    _RESPONSE.c.at >= bindparam("oldest"),
)
_NEW = insert(_RESPONSE)
_KEEP = _NEW.on_conflict_do_update(
    index_elements=[_RESPONSE.c.key, _RESPONSE.c.actor],
    set_={
        column.name: _NEW.excluded[column.name]
        for column in _RESPONSE.columns
        if not column.primary_key
    },
    where=or_(_RESPONSE.c.at < bindparam("oldest"), _RESPONSE.c.status == UNDER_WAY),
).returning(_RESPONSE.c.key)


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
    def activate(self) -> Iterator[None]:
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
            raise RuntimeError(
                "the response of this request is stored already: wrap the inner work in"
                " without_pending_response"
            )
        response: R | None = None
        if self._request is not None:
            key, response = self._request.key, self._make(outcome)
            stored = self._encode(response, key.request_digest)
            if not insert_response(session, key.key, key.actor, stored):
                raise ConflictError(
                    "another copy of this request was carried out first",
                    hint="Wait, then send it again with the same Idempotency-Key.",
                )
        session.call_after_commit(lambda: self._mark_committed(outcome, response))

    def _mark_committed(self, outcome: object, response: R | None) -> None:
        self._committed = outcome, response
        if self._request is not None:
            self._request.stored = True

    def make_or_get_response(self, outcome: object) -> R:
        """The response to send: the stored one, or a new one where nothing is stored.

        Raises:
            RuntimeError: The response that is stored was made of another outcome.
        """
        if self._committed is None:
            return self._make(outcome)
        answered, response = self._committed
        if answered is not outcome:
            raise RuntimeError(
                "a route must return the same outcome that it stored the response for"
            )
        return self._make(outcome) if response is None else response


@contextmanager
def without_pending_response() -> Iterator[None]:
    """For work inside other work: the outer one answers the request."""
    token = pending_response.set(None)
    try:
        yield
    finally:
        pending_response.reset(token)


def has_idempotency_key() -> bool:
    """Whether the request that this thread carries out was sent under a key."""
    pending = pending_response.get()
    return pending is not None and pending.key is not None


def read_progress(session: Session) -> Json | None:
    """How far this very request had come when a server was stopped; None where it begins.

    Work of several transactions saves it in each of them, and goes on from it.
    """
    key = session.idempotency_key
    found = None if key is None else find_response(session, key.key, key.actor)
    if found is None or found.body is None or not found.is_in_progress:
        return None
    return parse_json_column(found.body)


def save_progress(session: Session, value: Json) -> None:
    """Save how far a request with a key is, where its response will be."""
    key = session.idempotency_key
    if key is not None:
        body = json_text(value).encode()
        progress = StoredResponse(key.request_digest, UNDER_WAY, {}, body)
        insert_response(session, key.key, key.actor, progress)


def find_stored_response(
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
    with store.read_without_waiting() if at_once else store.read_for_one_statement() as session:
        return find_response(session, key, actor)


def claim_key(store: Store, key: str, actor: str) -> bool:
    """Let no other process respond under a key; False where one does at the moment.

    Raises:
        StorageError: The database cannot be asked.
    """
    return store.sharing.claim(_make_claim_name(key, actor))


def release_key(store: Store, key: str, actor: str) -> None:
    """Let others respond under it: what they find is stored by now."""
    store.sharing.release(_make_claim_name(key, actor))


def _make_claim_name(key: str, actor: str) -> str:
    return f"answer/{actor}/{key}"


def store_sent_response(store: Store, key: str, actor: str, response: StoredResponse) -> None:
    """Store a response that was sent already; one that is stored under its key stays."""
    with store.write() as session:
        insert_response(session, key, actor, response)
