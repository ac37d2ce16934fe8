"""Stored responses of requests with an Idempotency-Key, for when they come again."""

from __future__ import annotations

from dataclasses import dataclass
from datetime import UTC, datetime, timedelta
from typing import cast

from sqlalchemy import Index, LargeBinary, Table, bindparam, delete, or_, select, text
from sqlalchemy.orm import Mapped, mapped_column
from zlib_ng import zlib_ng

from app.db.base import Base
from app.db.dialects.statements import insert
from app.db.json_columns import inflate, parse
from app.db.session import Session, now, text_of
from app.finite import json_text


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
    def under_way(self) -> bool:
        """Whether it is none yet: the work was begun, and the body says how far it is."""
        return self.status == UNDER_WAY


def find_response(session: Session, key: str, actor: str) -> StoredResponse | None:
    """The response that is stored under an actor's key, or None."""
    row = session.execute(
        _FIND, {"key": key, "actor": actor, "oldest": _oldest_kept_time()}
    ).one_or_none()
    if row is None:
        return None
    body = inflate(row.body) if row.body else None
    return StoredResponse(row.request_digest, row.status, parse(row.headers), body)


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


def shorten_responses(session: Session, most: int) -> int:
    """Delete the bodies of the oldest responses, so that all take at most so many bytes.

    Their keys stay for as long as was promised: the requests still count once.

    Returns:
        How many lost it.
    """
    return len(session.scalars(_SHORTEN, {"most": most, "empty": b""}).all())


def _oldest_kept_time() -> str:
    oldest = datetime.now(UTC) - timedelta(hours=KEPT_HOURS)
    return text_of(oldest)


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
