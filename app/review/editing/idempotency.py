"""Idempotency: a request that is sent twice is carried out once."""

from __future__ import annotations

from dataclasses import dataclass

from sqlalchemy import insert, select
from sqlalchemy.orm import Session

from app.errors import IdempotencyError
from app.store.codecs import Json
from app.store.digest import digest
from app.store.models import IdempotencyModel


@dataclass(frozen=True)
class Request:
    """A request as its sender names it (``key`` may be None) and what it asks for."""

    key: str | None
    actor: str
    content: Json

    @property
    def digest(self) -> str:
        """Digest of what is asked for."""
        return digest(self.content)


def is_repeated(session: Session, request: Request) -> bool:
    """Whether this request was carried out before.

    Raises:
        IdempotencyError: Another request was, under the same key.
    """
    if request.key is None:
        return False
    statement = select(IdempotencyModel.request_digest).where(
        IdempotencyModel.key == request.key, IdempotencyModel.actor == request.actor
    )
    known = session.scalar(statement)
    if known is not None and known != request.digest:
        raise IdempotencyError("this Idempotency-Key was used for another change")
    return known is not None


def remember(session: Session, request: Request, log_id: int, at: str) -> None:
    """Note a request with the log entry that it made, in that entry's transaction."""
    if request.key is None:
        return
    values = {
        "key": request.key,
        "actor": request.actor,
        "request_digest": request.digest,
        "log_id": log_id,
        "at": at,
    }
    session.execute(insert(IdempotencyModel), [values])
