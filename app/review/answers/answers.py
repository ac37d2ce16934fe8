"""First answers: a request that is sent again under its key gets what it got the first time."""

from __future__ import annotations

from collections.abc import Callable

from app.errors import ConflictError
from app.review.answers.keep import Kept
from app.store.answers import Answer as Answer
from app.store.answers import find_answer, keep_answer
from app.store.session import Session
from app.store.store import Store


def find_first(store: Store, key: str, actor: str, *, at_once: bool = False) -> Answer | None:
    """The answer that is kept under a key, or None.

    Args:
        store: The database.
        key: Of the request.
        actor: Who sent it.
        at_once: Not to wait for anything, as on the event loop.

    Raises:
        BusyError: There was something to wait for.
    """
    with store.peek() if at_once else store.glance() as session:
        return find_answer(session, key, actor)


def claim(store: Store, key: str, actor: str) -> bool:
    """Let no other process answer under a key; False where one does at the moment.

    Raises:
        StorageError: The database cannot be asked.
    """
    return store.sharing.take(_claim(key, actor))


def end_claim(store: Store, key: str, actor: str) -> None:
    """Let others answer under it: what they find is kept by now."""
    store.sharing.give_back(_claim(key, actor))


def _claim(key: str, actor: str) -> str:
    return f"answer/{actor}/{key}"


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
