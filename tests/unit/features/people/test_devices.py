"""Tries and what was begun, as several processes of a server know them."""

from __future__ import annotations

from datetime import UTC, datetime, timedelta

from sqlalchemy import text

from app.db.store import Store
from app.features.people.devices import CHALLENGE_LASTS as LASTS
from app.features.people.devices import AttemptWindow, PasskeyChallenges, StoredPendingActions


class TestAttempts:
    def test_tries_of_all_processes_count_in_one_moving_window(self, store: Store) -> None:
        at = [1000.0]
        one, other = AttemptWindow(store, lambda: at[0]), AttemptWindow(store, lambda: at[0])
        assert [
            one.count_attempt_or_get_wait("ann", 3, 60.0),
            other.count_attempt_or_get_wait("ann", 3, 60.0),
        ] == [
            None,
            None,
        ]
        at[0] = 1030.0
        assert one.count_attempt_or_get_wait("ann", 3, 60.0) is None
        assert (
            one.count_attempt_or_get_wait("ann", 3, 60.0),
            other.count_attempt_or_get_wait("ann", 3, 60.0),
        ) == (
            30.0,
            30.0,
        )
        assert other.count_attempt_or_get_wait("ben", 3, 60.0) is None
        at[0] = 1061.0
        assert other.count_attempt_or_get_wait("ann", 3, 60.0) is None

    def test_who_is_refused_waits_for_no_writer(self, store: Store) -> None:
        attempts = AttemptWindow(store)
        attempts.count_attempt_or_get_wait("ann", 1, 60.0)
        with store.write():
            # A write of its own would wait for this one, and be refused itself.
            assert attempts.count_attempt_or_get_wait("ann", 1, 60.0) is not None


class TestWritten:
    def test_another_process_takes_what_was_begun_once(self, store: Store) -> None:
        at = [datetime.now(UTC)]
        one, other = (
            PasskeyChallenges(StoredPendingActions(store, lambda: at[0], LASTS, "passkey"))
            for _ in range(2)
        )
        made = one.make("ann")
        assert (other.take("ann"), one.take("ann")) == (made, None)
        one.make("ann")
        newest = other.make("ann")
        assert one.take("ann") == newest
        one.make("late")
        at[0] += LASTS + timedelta(seconds=1)
        assert other.take("late") is None

    def test_the_database_shows_neither_who_nor_what(self, store: Store) -> None:
        begun = StoredPendingActions(store, lambda: datetime.now(UTC), LASTS, "sign-on")
        begun.put("ann", b"the secret")
        with store.read() as session:
            name, value = session.execute(text("SELECT name, value FROM begun")).one()
        assert "ann" not in name
        assert b"secret" not in bytes(value)
