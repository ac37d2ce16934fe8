"""First answers: what a request under an Idempotency-Key was answered, for when it comes again."""

from __future__ import annotations

import json
import zlib
from collections.abc import Callable
from dataclasses import dataclass
from datetime import UTC, datetime, timedelta
from typing import TypeVar, cast

from sqlalchemy import Table, bindparam, delete, or_, select
from sqlalchemy.dialects.sqlite import insert
from sqlalchemy.orm import Session

from app.finite import json_text
from app.store.clock import now
from app.store.codecs import Json
from app.store.job_models import AnswerModel

T = TypeVar("T")

KEPT_HOURS = 24
"""How long an answer is kept; what an edit builds on (If-Match) still stops a later repetition."""
_FAST = 1
_UNDER_WAY = 102
_ANSWER = cast(Table, AnswerModel.__table__)


@dataclass(frozen=True)
class Answer:
    """An answer as it was sent; ``request_digest`` is that of the request."""

    request_digest: str
    status: int
    headers: dict[str, str]
    body: bytes

    @property
    def under_way(self) -> bool:
        """Whether it is none yet: the work was begun, and the body says how far it came."""
        return self.status == _UNDER_WAY


@dataclass(frozen=True)
class Progress:
    """How far work of several transactions has come that was asked for under a key.

    Saved in each transaction, it lets the same request go on where a stopped server left it.
    """

    key: str
    actor: str
    request_digest: str

    def read(self, session: Session) -> Json | None:
        """What was saved last; None where the work has not begun."""
        found = find_answer(session, self.key, self.actor)
        return json.loads(found.body) if found is not None and found.under_way else None

    def save(self, session: Session, value: Json) -> None:
        """Say how far the work is."""
        body = json_text(value).encode()
        keep_answer(
            session, self.key, self.actor, Answer(self.request_digest, _UNDER_WAY, {}, body)
        )


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
    body = zlib.decompress(row.body)
    return Answer(row.request_digest, row.status, json.loads(row.headers), body)


def keep_answer(session: Session, key: str, actor: str, answer: Answer) -> bool:
    """Keep an answer under a key; False where one is kept already, which stays."""
    row = {
        "key": key,
        "actor": actor,
        "request_digest": answer.request_digest,
        "status": answer.status,
        "headers": json_text(answer.headers, ascii_=True),
        "body": zlib.compress(answer.body, _FAST),
        "at": now(),
        "oldest": _oldest(),
    }
    return session.execute(_KEEP, row).one_or_none() is not None


def forget_answers(session: Session) -> None:
    """Forget the answers that are too old."""
    session.execute(delete(AnswerModel).where(AnswerModel.at < _oldest()))


def _oldest() -> str:
    oldest = datetime.now(UTC) - timedelta(hours=KEPT_HOURS)
    return oldest.isoformat(timespec="microseconds")


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
    where=or_(_ANSWER.c.at < bindparam("oldest"), _ANSWER.c.status == _UNDER_WAY),
).returning(_ANSWER.c.key)
