"""First answers: kept for a day, by key and actor."""

from __future__ import annotations

from sqlalchemy import update

from app.store.answers import Answer, find_answer, keep_answer
from app.store.job_models import AnswerModel
from app.store.session import Store

ANSWER = Answer("digest", 201, {"etag": '"a"', "content-type": "text/plain"}, b"\x00body" * 9)


def keep(store: Store, key: str, actor: str, answer: Answer) -> None:
    with store.write() as session:
        keep_answer(session, key, actor, answer)


def find(store: Store, key: str, actor: str) -> Answer | None:
    with store.read() as session:
        return find_answer(session, key, actor)


class TestKeepAnswer:
    def test_the_first_one_stays(self, store: Store) -> None:
        keep(store, "k", "ann", ANSWER)
        keep(store, "k", "ann", Answer("other", 200, {}, b""))
        assert find(store, "k", "ann") == ANSWER

    def test_another_person_may_use_the_same_key(self, store: Store) -> None:
        keep(store, "k", "ann", ANSWER)
        assert find(store, "k", "bob") is None

    def test_old_ones_are_forgotten(self, store: Store) -> None:
        keep(store, "old", "ann", ANSWER)
        with store.write() as session:
            session.execute(update(AnswerModel).values(at="2020-01-01T00:00:00"))
        keep(store, "new", "ann", ANSWER)
        assert find(store, "old", "ann") is None
        assert find(store, "new", "ann") == ANSWER
