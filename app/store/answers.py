"""First answers: what a request under an Idempotency-Key was answered, for when it comes again."""

from __future__ import annotations

from dataclasses import dataclass
from datetime import UTC, datetime, timedelta
from typing import cast

from sqlalchemy import Table, bindparam, delete, or_, select, text
from zlib_ng import zlib_ng

from app.finite import json_text
from app.store.clock import now, text_of
from app.store.dialect.statements import insert
from app.store.session import Session
from app.store.stored_json import inflate, parse
from app.store.tables.jobs import AnswerModel

KEPT_HOURS = 24
"""How long an answer is kept; what an edit builds on (If-Match) still stops a later repetition."""
UNDER_WAY = 102
"""Status of an answer that is none yet."""
_FAST = 2
_ANSWER = cast(Table, AnswerModel.__table__)


@dataclass(frozen=True)
class Answer:
    """An answer as it was sent; ``request_digest`` is that of the request.

    The body is None where it is no longer kept: the request was answered, and shall not be again.
    """

    request_digest: str
    status: int
    headers: dict[str, str]
    body: bytes | None

    @property
    def under_way(self) -> bool:
        """Whether it is none yet: the work was begun, and the body says how far it came."""
        return self.status == UNDER_WAY


def find_answer(session: Session, key: str, actor: str) -> Answer | None:
    """The answer that is kept under a key, or None."""
    row = session.execute(_FIND, {"key": key, "actor": actor, "oldest": _oldest()}).one_or_none()
    if row is None:
        return None
    body = inflate(row.body) if row.body else None
    return Answer(row.request_digest, row.status, parse(row.headers), body)


def keep_answer(session: Session, key: str, actor: str, answer: Answer) -> bool:
    """Keep an answer under a key; False where one is kept already, which stays."""
    row = {
        "key": key,
        "actor": actor,
        "request_digest": answer.request_digest,
        "status": answer.status,
        "headers": json_text(answer.headers, ascii_=True),
        "body": zlib_ng.compress(answer.body or b"", _FAST),
        "at": now(),
        "oldest": _oldest(),
    }
    return session.execute(_KEEP, row).one_or_none() is not None


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
    return len(session.scalars(_SHORTEN, {"most": most, "empty": b""}).all())


def _oldest() -> str:
    oldest = datetime.now(UTC) - timedelta(hours=KEPT_HOURS)
    return text_of(oldest)


_SHORTEN = text(
    "UPDATE answer SET body = :empty WHERE (key, actor) IN (SELECT key, actor FROM (SELECT key,"
    " actor, status, length(body) AS size, sum(length(body)) OVER (ORDER BY at DESC, key, actor)"
    " AS total FROM answer) AS sized WHERE total > :most AND size > 0 AND status >= 200)"
    " RETURNING key"
)
_FIND = select(*_ANSWER.columns).where(
    _ANSWER.c.key == bindparam("key"),
    _ANSWER.c.actor == bindparam("actor"),
    _ANSWER.c.at >= bindparam("oldest"),
)
_NEW = insert(_ANSWER)
_KEEP = _NEW.on_conflict_do_update(
    index_elements=[_ANSWER.c.key, _ANSWER.c.actor],
    set_={
        column.name: _NEW.excluded[column.name]
        for column in _ANSWER.columns
        if not column.primary_key
    },
    where=or_(_ANSWER.c.at < bindparam("oldest"), _ANSWER.c.status == UNDER_WAY),
).returning(_ANSWER.c.key)
