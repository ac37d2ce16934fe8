"""First answers: what a request under an Idempotency-Key was answered, for when it comes again."""

from __future__ import annotations

import json
import zlib
from dataclasses import dataclass
from datetime import UTC, datetime, timedelta

from sqlalchemy import delete, select
from sqlalchemy.dialects.sqlite import insert
from sqlalchemy.orm import Session

from app.finite import json_text
from app.store.clock import now
from app.store.job_models import AnswerModel

KEPT_HOURS = 24
"""How long an answer is kept; a later repetition still does not do an edit twice."""
_FAST = 1


@dataclass(frozen=True)
class Answer:
    """An answer as it was sent; ``request_digest`` is that of the request."""

    request_digest: str
    status: int
    headers: dict[str, str]
    body: bytes


def find_answer(session: Session, key: str, actor: str) -> Answer | None:
    """The answer that is kept under a key, or None."""
    row = session.execute(
        select(*AnswerModel.__table__.columns).where(
            AnswerModel.key == key, AnswerModel.actor == actor
        )
    ).one_or_none()
    if row is None:
        return None
    body = zlib.decompress(row.body)
    return Answer(row.request_digest, row.status, json.loads(row.headers), body)


def keep_answer(session: Session, key: str, actor: str, answer: Answer) -> None:
    """Keep an answer under a key, unless one is kept; those that are too old are forgotten."""
    oldest = datetime.now(UTC) - timedelta(hours=KEPT_HOURS)
    session.execute(
        delete(AnswerModel).where(AnswerModel.at < oldest.isoformat(timespec="microseconds"))
    )
    values = {
        "key": key,
        "actor": actor,
        "request_digest": answer.request_digest,
        "status": answer.status,
        "headers": json_text(answer.headers, ascii_=True),
        "body": zlib.compress(answer.body, _FAST),
        "at": now(),
    }
    session.execute(insert(AnswerModel).on_conflict_do_nothing(), [values])
