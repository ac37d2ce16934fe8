"""Stored responses: for a day, by key and actor."""

from __future__ import annotations

from sqlalchemy import select, update

from app.store.idempotency import (
    StoredResponse,
    delete_old_responses,
    find_response,
    insert_response,
)
from app.store.store import Store
from app.store.tables.jobs import StoredResponseModel

ANSWER = StoredResponse(
    "digest", 201, {"etag": '"a"', "content-type": "text/plain"}, b"\x00body" * 9
)


def keep(store: Store, key: str, actor: str, answer: StoredResponse) -> bool:
    with store.write() as session:
        return insert_response(session, key, actor, answer)


def find(store: Store, key: str, actor: str) -> StoredResponse | None:
    with store.read() as session:
        return find_response(session, key, actor)


class TestInsertResponse:
    def test_the_first_one_stays(self, store: Store) -> None:
        assert keep(store, "k", "ann", ANSWER)
        assert not keep(store, "k", "ann", StoredResponse("other", 200, {}, b""))
        assert find(store, "k", "ann") == ANSWER

    def test_another_person_may_use_the_same_key(self, store: Store) -> None:
        keep(store, "k", "ann", ANSWER)
        assert find(store, "k", "bob") is None

    def test_an_expired_answer_is_not_found_and_its_key_is_free(self, store: Store) -> None:
        keep(store, "old", "ann", ANSWER)
        age(store)
        assert find(store, "old", "ann") is None
        other = StoredResponse("other", 200, {}, b"")
        assert keep(store, "old", "ann", other)
        assert find(store, "old", "ann") == other


class TestDeleteOldResponses:
    def test_only_old_ones_go(self, store: Store) -> None:
        keep(store, "old", "ann", ANSWER)
        age(store)
        keep(store, "new", "ann", ANSWER)
        with store.write() as session:
            delete_old_responses(session)
            assert list(session.scalars(select(StoredResponseModel.key))) == ["new"]


def age(store: Store) -> None:
    with store.write() as session:
        session.execute(update(StoredResponseModel).values(at="2020-01-01T00:00:00"))
