"""Stored responses: for a day, by key and actor."""

from __future__ import annotations

import threading
from concurrent.futures import ThreadPoolExecutor
from typing import Any

import pytest
from sqlalchemy import select, update

from app.db.idempotency import (
    IdempotencyKey,
    KeyedRequest,
    PendingResponse,
    StoredResponse,
    StoredResponseModel,
    delete_old_responses,
    find_response,
    find_stored_response,
    has_idempotency_key,
    insert_response,
    read_progress,
    save_progress,
    store_sent_response,
    without_pending_response,
)
from app.db.log import NewLogEntry, append_entries
from app.db.store import Store
from app.errors import ConflictError
from tests.unit.features.pending import keyed_request

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


RESPONSE = StoredResponse("digest", 201, {"etag": '"a"'}, b"{}")


def work(store: Store, outcome: object) -> object:
    """What a service does: it writes, and answers the request as the last of its transaction."""
    with store.write() as session:
        append_entries(
            session, [NewLogEntry("deed", "ann", "2026-01-01T00:00:00Z", {"did": str(outcome)})]
        )
        session.respond(outcome)
    return outcome


def entries(store: Store) -> int:
    with store.read() as session:
        count: int = session.exec_driver_sql("SELECT count(*) FROM log").scalar_one()
        return count


class TestStoreSent:
    def test_the_first_one_stays(self, store: Store) -> None:
        assert find_stored_response(store, "key", "ann") is None
        store_sent_response(store, "key", "ann", RESPONSE)
        store_sent_response(store, "key", "ann", StoredResponse("other", 200, {}, b""))
        assert find_stored_response(store, "key", "ann") == RESPONSE
        assert find_stored_response(store, "key", "ben") is None


class TestPendingResponse:
    @staticmethod
    def pending(request: KeyedRequest | None, made: list[object]) -> PendingResponse[str]:
        def make(outcome: object) -> str:
            made.append(outcome)
            return f"response to {outcome}"

        return PendingResponse(
            request, make, lambda text, digest: StoredResponse(digest, 200, {}, text.encode())
        )

    def test_is_stored_with_its_work_and_sent_as_it_is_stored(self, store: Store) -> None:
        request, made = KeyedRequest(IdempotencyKey("key", "ann", "digest")), list[object]()
        pending = self.pending(request, made)
        with pending.activate():
            outcome = work(store, "outcome")
        assert request.stored
        assert pending.make_or_get_response(outcome) == "response to outcome"
        assert made == ["outcome"]
        stored = find_stored_response(store, "key", "ann")
        assert stored == StoredResponse("digest", 200, {}, b"response to outcome")

    def test_is_stored_as_the_last_statement_of_the_transaction(
        self, store: Store, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        statements: list[str] = []
        with keyed_request().activate(), store.write() as session:
            session.respond("outcome")
            run = session.execute

            def execute(statement: Any, *values: Any, **options: Any) -> Any:
                statements.append(str(statement))
                return run(statement, *values, **options)

            monkeypatch.setattr(session, "execute", execute)
            append_entries(
                session, [NewLogEntry("deed", "ann", "2026-01-01T00:00:00Z", {"did": "it"})]
            )
            before = len(statements)
        assert before > 0
        # PostgreSQL tells other processes of the commit, too.
        last = [text.split()[0] for text in statements[before:] if "pg_notify" not in text]
        assert last == ["INSERT"]

    def test_of_a_request_without_a_key_nothing_is_stored_and_the_response_is_made_afterwards(
        self, store: Store
    ) -> None:
        made = list[object]()
        pending = self.pending(None, made)
        with pending.activate():
            outcome = work(store, "outcome")
            assert made == []
        assert pending.make_or_get_response(outcome) == "response to outcome"
        assert find_stored_response(store, "key", "ann") is None

    def test_is_not_stored_where_the_work_is_rolled_back(self, store: Store) -> None:
        request = KeyedRequest(IdempotencyKey("key", "ann", "digest"))
        pending = self.pending(request, [])
        with pending.activate():
            with pytest.raises(KeyError), store.write() as session:
                session.respond("first")
                raise KeyError
            assert find_stored_response(store, "key", "ann") is None
            assert not request.stored
            # As where a service tries again what somebody else has changed meanwhile.
            outcome = work(store, "second")
        assert pending.make_or_get_response(outcome) == "response to second"

    def test_is_not_stored_where_the_commit_fails(
        self, store: Store, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        request, before = KeyedRequest(IdempotencyKey("key", "ann", "digest")), entries(store)
        with self.pending(request, []).activate():
            with pytest.raises(OSError, match="full"), store.write() as session:
                session.respond("outcome")
                monkeypatch.setattr(
                    session, "commit", lambda: (_ for _ in ()).throw(OSError("full"))
                )
            assert (request.stored, entries(store)) == (False, before)
            assert find_stored_response(store, "key", "ann") is None

    def test_of_two_that_do_the_same_work_the_second_does_nothing(self, store: Store) -> None:
        with keyed_request().activate():
            work(store, "outcome")
        done = entries(store)
        with (
            pytest.raises(ConflictError, match="was carried out first"),
            keyed_request().activate(),
        ):
            work(store, "outcome")
        assert entries(store) == done

    def test_the_last_outcome_of_a_transaction_counts(self, store: Store) -> None:
        pending = self.pending(KeyedRequest(IdempotencyKey("key", "ann", "digest")), [])
        with pending.activate(), store.write() as session:
            session.respond("inner")
            session.respond("outer")
        assert pending.make_or_get_response("outer") == "response to outer"

    @pytest.mark.parametrize("has_a_key", [True, False])
    def test_a_request_is_answered_in_one_transaction_alone(
        self, store: Store, has_a_key: bool
    ) -> None:
        request = KeyedRequest(IdempotencyKey("key", "ann", "digest")) if has_a_key else None
        with self.pending(request, []).activate():
            work(store, "first")
            with pytest.raises(RuntimeError, match="stored already"):
                work(store, "second")

    @pytest.mark.parametrize("has_a_key", [True, False])
    def test_what_is_sent_is_the_outcome_that_the_work_answered_with(
        self, store: Store, has_a_key: bool
    ) -> None:
        request = KeyedRequest(IdempotencyKey("key", "ann", "digest")) if has_a_key else None
        pending = self.pending(request, [])
        with pending.activate():
            work(store, ["answered"])
        with pytest.raises(RuntimeError, match="must return the same outcome"):
            pending.make_or_get_response(["answered"])

    def test_other_threads_and_what_comes_after_have_no_request(self, store: Store) -> None:
        looked = threading.Event()

        def look() -> bool:
            looked.set()
            return has_idempotency_key()

        with keyed_request().activate(), ThreadPoolExecutor(1) as pool:
            assert has_idempotency_key()
            assert pool.submit(look).result() is False
            assert looked.is_set()
        assert not has_idempotency_key()


class TestWithoutResponse:
    def test_inner_work_leaves_the_response_to_the_outer_one(self, store: Store) -> None:
        pending = keyed_request()
        with pending.activate():
            with without_pending_response():
                work(store, "inner")
            assert find_stored_response(store, "key", "ann") is None
            assert work(store, "outer") == "outer"
        assert pending.make_or_get_response("outer") == "outer"


class TestProgress:
    @staticmethod
    def save(store: Store, value: object) -> None:
        with store.write() as session:
            save_progress(session, value)

    @staticmethod
    def read(store: Store) -> object:
        with store.read() as session:
            return read_progress(session)

    def test_what_was_saved_last_is_read(self, store: Store) -> None:
        with keyed_request().activate():
            assert self.read(store) is None
            self.save(store, {"next": 7})
            self.save(store, {"next": 9})
            assert self.read(store) == {"next": 9}
        with keyed_request(actor="ben").activate():
            assert self.read(store) is None

    def test_the_response_takes_its_place(self, store: Store) -> None:
        with keyed_request().activate():
            self.save(store, {"next": 7})
            found = find_stored_response(store, "key", "ann")
            assert found is not None
            assert found.is_in_progress
            work(store, "outcome")
            assert self.read(store) is None
        found = find_stored_response(store, "key", "ann")
        assert found is not None
        assert not found.is_in_progress

    def test_a_request_without_a_key_saves_none(self, store: Store) -> None:
        self.save(store, {"next": 7})
        assert self.read(store) is None
