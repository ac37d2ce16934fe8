"""Stored responses: for a day, by key and actor."""

from __future__ import annotations

from sqlalchemy import select, update

from app.db.store import Store
from app.db.stored_responses import (
    StoredResponse,
    StoredResponseModel,
    delete_old_responses,
    find_response,
    insert_response,
)

ANSWER = StoredResponse(
    "digest", 201, {"etag": '"a"', "content-type": "text/plain"}, b"\x00body" * 9
)


def keep(own_store: Store, key: str, actor: str, answer: StoredResponse) -> bool:
    with own_store.write() as session:
        return insert_response(session, key, actor, answer)


def find(own_store: Store, key: str, actor: str) -> StoredResponse | None:
    with own_store.read() as session:
        return find_response(session, key, actor)


class TestInsertResponse:
    def test_the_first_one_stays(self, own_store: Store) -> None:
        assert keep(own_store, "k", "ann", ANSWER)
        assert not keep(own_store, "k", "ann", StoredResponse("other", 200, {}, b""))
        assert find(own_store, "k", "ann") == ANSWER

    def test_another_person_may_use_the_same_key(self, own_store: Store) -> None:
        keep(own_store, "k", "ann", ANSWER)
        assert find(own_store, "k", "bob") is None

    def test_an_expired_answer_is_not_found_and_its_key_is_free(self, own_store: Store) -> None:
        keep(own_store, "old", "ann", ANSWER)
        age(own_store)
        assert find(own_store, "old", "ann") is None
        other = StoredResponse("other", 200, {}, b"")
        assert keep(own_store, "old", "ann", other)
        assert find(own_store, "old", "ann") == other


class TestDeleteOldResponses:
    def test_only_old_ones_go(self, own_store: Store) -> None:
        keep(own_store, "old", "ann", ANSWER)
        age(own_store)
        keep(own_store, "new", "ann", ANSWER)
        with own_store.write() as session:
            delete_old_responses(session)
            assert list(session.scalars(select(StoredResponseModel.key))) == ["new"]


def age(own_store: Store) -> None:
    with own_store.write() as session:
        session.execute(update(StoredResponseModel).values(at="2020-01-01T00:00:00"))
