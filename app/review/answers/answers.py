"""First answers: a request that is sent again under its key gets what it got the first time."""

from __future__ import annotations

from collections.abc import Callable

from app.errors import ConflictError
from app.store.answers import Answer, Kept, find_answer, keep_answer
from app.store.session import Session, Store


def find_first(store: Store, key: str, actor: str) -> Answer | None:
    """The answer that is kept under a key, or None."""
    with store.read() as session:
        return find_answer(session, key, actor)


def keep_first(store: Store, key: str, actor: str, answer: Answer) -> None:
    """Keep an answer under a key; one that is kept already stays."""
    with store.write() as session:
        keep_answer(session, key, actor, answer)


def keep_with_work(key: str, actor: str, answer: Answer, kept: Callable[[], None]) -> Kept:
    """Keeps an answer in the transaction of its work, and then calls ``kept``.

    Raises:
        ConflictError: (When it is called) one is kept already: the work was done meanwhile.
    """

    def keep(session: Session) -> None:
        if not keep_answer(session, key, actor, answer):
            raise ConflictError(
                "the same request was answered in the meantime", hint="Send it again."
            )
        kept()

    return keep
