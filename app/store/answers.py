"""First answers: what a request under an Idempotency-Key was answered, for when it comes again."""

from __future__ import annotations

import json
import zlib
from collections.abc import Callable
from dataclasses import dataclass
from datetime import UTC, datetime, timedelta
from typing import TypeVar

from sqlalchemy import bindparam, delete, select, text
from sqlalchemy.dialects.sqlite import insert
from sqlalchemy.orm import Session

from app.finite import json_text
from app.store.clock import now
from app.store.codecs import inflate
from app.store.job_models import AnswerModel

T = TypeVar("T")

KEPT_HOURS = 24
"""How long an answer is kept; what an edit builds on (If-Match) still stops a later repetition."""
_FAST = 1


@dataclass(frozen=True)
class Answer:
    """An answer as it was sent; ``request_digest`` is that of the request.

    The body is None where it is no longer kept: the request was answered, and shall not be again.
    """

    request_digest: str
    status: int
    headers: dict[str, str]
    body: bytes | None


Kept = Callable[[Session], None]
"""Writes an answer into a transaction; called as the last in it."""
Keep = Callable[[T], Kept]
"""Makes the answer of what work came to, to be kept in the transaction of that work: then the
same request, sent again, gets it, wherever the server was stopped."""


def keep_nothing(_outcome: object) -> Kept:
    """For work that nobody asked for under a key."""
    return lambda _session: None


def find_answer(session: Session, key: str, actor: str) -> Answer | None:
    """The answer that is kept under a key, or None."""
    row = session.execute(_FIND, {"key": key, "actor": actor, "oldest": _oldest()}).one_or_none()
    if row is None:
        return None
    body = inflate(row.body) if row.body else None
    return Answer(row.request_digest, row.status, json.loads(row.headers), body)


def keep_answer(session: Session, key: str, actor: str, answer: Answer) -> bool:
    """Keep an answer under a key; False where one is kept already, which stays."""
    values = {
        "request_digest": answer.request_digest,
        "status": answer.status,
        "headers": json_text(answer.headers, ascii_=True),
        "body": zlib.compress(answer.body or b"", _FAST),
        "at": now(),
    }
    statement = insert(AnswerModel).values(key=key, actor=actor, **values)
    fresh = statement.on_conflict_do_update(
        index_elements=[AnswerModel.key, AnswerModel.actor],
        set_=values,
        where=AnswerModel.at < _oldest(),
    ).returning(AnswerModel.key)
    return session.execute(fresh).one_or_none() is not None


def forget_answers(session: Session) -> int:
    """Forget the answers that are too old; returns how many."""
    gone = delete(AnswerModel).where(AnswerModel.at < _oldest()).returning(AnswerModel.key)
    return len(session.scalars(gone).all())


def shorten_answers(session: Session, most: int) -> int:
    """Forget the text of the oldest answers, so that all take at most so many bytes.

    Their keys stay for as long as was promised: the requests still count once.

    Returns:
        How many lost it.
    """
    return len(session.scalars(_SHORTEN, {"most": most}).all())


def _oldest() -> str:
    oldest = datetime.now(UTC) - timedelta(hours=KEPT_HOURS)
    return oldest.isoformat(timespec="microseconds")


_SHORTEN = text(
    "UPDATE answer SET body = x'' WHERE rowid IN (SELECT rowid FROM (SELECT rowid, status,"
    " length(body) AS size, sum(length(body)) OVER (ORDER BY at DESC, rowid DESC) AS total"
    " FROM answer) WHERE total > :most AND size > 0 AND status >= 200) RETURNING key"
)
_FIND = select(*AnswerModel.__table__.columns).where(
    AnswerModel.key == bindparam("key"),
    AnswerModel.actor == bindparam("actor"),
    AnswerModel.at >= bindparam("oldest"),
)
