"""What processes with one PostgreSQL leave to each other and say, here two stores of one process."""

from __future__ import annotations

import queue
from collections.abc import Iterator
from contextlib import closing

import pytest
from sqlalchemy import text

from app.db.dialects.dialect import ALL_CHANGED
from app.db.store import COMMITTED, Store
from tests.databases import POSTGRESQL
from tests.unit.db.homes import say
from tests.waiting import SECONDS

DATABASES = [POSTGRESQL]
OTHERS = (
    "SELECT pg_terminate_backend(pid, 10000) FROM pg_stat_activity"
    " WHERE datname = current_database() AND query LIKE '{}%' AND pid <> pg_backend_pid()"
)


@pytest.fixture
def other(own_store: Store) -> Iterator[Store]:
    with closing(Store.open(own_store.settings)) as other:
        yield other


def words(own_store: Store) -> queue.Queue[str]:
    """What a store hears from now on."""
    heard: queue.Queue[str] = queue.Queue()
    own_store.sharing.subscribe(heard.put)
    own_store.subscribe()
    assert heard.get(timeout=SECONDS) == ALL_CHANGED
    return heard


def end(own_store: Store, begins: str) -> None:
    """End the connections whose last statement begins so."""
    with own_store.read_for_one_statement() as session:
        assert all(session.scalars(text(OTHERS.format(begins))).all())


class TestClaims:
    def test_one_process_has_it_until_it_gives_it_back(
        self, own_store: Store, other: Store
    ) -> None:
        assert (own_store.sharing.claim("jobs"), other.sharing.claim("jobs")) == (True, False)
        assert other.sharing.claim("something else")
        # Nor has anybody else in the same process.
        assert not own_store.sharing.claim("jobs")
        own_store.sharing.release("jobs")
        assert (other.sharing.claim("jobs"), other.sharing.holds("jobs")) == (True, True)

    def test_it_ends_with_its_connection(self, own_store: Store, other: Store) -> None:
        assert own_store.sharing.claim("jobs")
        end(other, "SELECT pg_try")
        assert other.sharing.claim("jobs")
        assert not own_store.sharing.holds("jobs")
        own_store.sharing.release("jobs")
        assert other.sharing.holds("jobs")

    def test_it_ends_with_its_store(self, own_store: Store, other: Store) -> None:
        assert other.sharing.claim("jobs")
        other.close()
        with closing(Store.open(own_store.settings)) as next_one:
            assert next_one.sharing.claim("jobs")


class TestWords:
    def test_others_hear_what_was_kept_and_nobody_hears_themselves(
        self, own_store: Store, other: Store
    ) -> None:
        heard, own = words(other), words(own_store)
        with pytest.raises(KeyError), own_store.write() as session:
            own_store.sharing.publish(session, "lost")
            raise KeyError
        own_store.publish("first")
        say(own_store)
        assert [heard.get(timeout=SECONDS) for _ in range(2)] == ["first", COMMITTED]
        other.publish("back")
        assert own.get(timeout=SECONDS) == "back"

    def test_who_listens_is_told_of_commits_of_others(self, own_store: Store, other: Store) -> None:
        told: queue.Queue[int] = queue.Queue()
        words(other)
        other.listen(lambda: told.put(1))
        say(own_store)
        assert told.get(timeout=SECONDS) == 1

    def test_a_line_that_broke_is_taken_up_and_what_was_missed_is_looked_for(
        self, own_store: Store, other: Store, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        monkeypatch.setattr("app.db.dialects.postgresql_sharing.AGAIN_SECONDS", 0.01)
        heard = words(other)
        end(own_store, "LISTEN")
        assert heard.get(timeout=SECONDS) == ALL_CHANGED
        own_store.publish("after")
        assert heard.get(timeout=SECONDS) == "after"

    def test_what_is_too_long_is_not_said(self, own_store: Store, other: Store) -> None:
        heard = words(other)
        own_store.publish("x" * 8000)
        own_store.publish("short")
        assert heard.get(timeout=SECONDS) == "short"
