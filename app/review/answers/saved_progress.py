"""Saved progress: how far work of several transactions is, kept where its answer will be."""

from __future__ import annotations

from dataclasses import dataclass

from app.finite import json_text
from app.store.answers import UNDER_WAY, Answer, find_answer, keep_answer
from app.store.session import Session
from app.store.stored_json import Json, parse


@dataclass(frozen=True)
class SavedProgress:
    """How far work of several transactions has come that was asked for under a key.

    Saved in each transaction, it lets the same request go on where a stopped server left it.
    """

    key: str
    actor: str
    request_digest: str

    def read(self, session: Session) -> Json | None:
        """What was saved last; None where the work has not begun."""
        found = find_answer(session, self.key, self.actor)
        if found is None or found.body is None or not found.under_way:
            return None
        return parse(found.body)

    def save(self, session: Session, value: Json) -> None:
        """Say how far the work is."""
        body = json_text(value).encode()
        keep_answer(session, self.key, self.actor, Answer(self.request_digest, UNDER_WAY, {}, body))
