from __future__ import annotations

import fcntl
import os

import pytest

from app.config import Settings
from app.db import locks
from app.db.locks import (
    DatabaseOpenLock,
    hold_exclusive_database_lock,
    hold_practice_lock,
    hold_server_lock,
    read_server_address,
)
from app.errors import BusyError, StorageError

FLOCK = fcntl.flock


class TestDatabaseLock:
    def test_who_opens_first_is_alone_and_the_next_wait_until_it_is_shared(
        self, settings: Settings, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        monkeypatch.setattr(locks, "OPENING_SECONDS", 0.05)
        first = DatabaseOpenLock(settings)
        assert first.alone
        with pytest.raises(BusyError, match="has been opening the database") as refused:
            DatabaseOpenLock(settings)
        assert "Ctrl-Z" in str(refused.value.hint)
        first.share()
        second, third = DatabaseOpenLock(settings), DatabaseOpenLock(settings)
        assert not (first.alone or second.alone or third.alone)
        for lock in (first, second, third):
            lock.release()

    def test_nobody_is_alone_while_a_lock_is_changed_to_a_shared_one(
        self, settings: Settings, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        monkeypatch.setattr(locks, "OPENING_SECONDS", 0.05)
        first, waited = DatabaseOpenLock(settings), []

        def with_a_gap(handle: int, operation: int) -> None:
            """Lets go before it shares, as the system may, and somebody opens just then."""
            FLOCK(handle, fcntl.LOCK_UN)
            monkeypatch.setattr(fcntl, "flock", FLOCK)
            try:
                DatabaseOpenLock(settings).release()
            except BusyError:
                waited.append(True)
            FLOCK(handle, operation)

        monkeypatch.setattr(fcntl, "flock", with_a_gap)
        first.share()
        assert waited
        first.release()

    def test_what_must_be_alone_is_refused_beside_others_and_runs_after_them(
        self, settings: Settings
    ) -> None:
        first = DatabaseOpenLock(settings)
        first.share()
        refused = pytest.raises(StorageError, match="has the database open: not now")
        with refused, hold_exclusive_database_lock(settings, "not now"):
            pass
        first.release()
        first.release()
        with hold_exclusive_database_lock(settings, "not now"):
            pass


class TestServerLock:
    def test_a_home_has_one_server(self, settings) -> None:
        refused = pytest.raises(StorageError, match="another Touchline server")
        with hold_server_lock(settings), refused, hold_server_lock(settings):
            pass
        with hold_server_lock(settings):
            pass

    def test_its_address_is_known_as_long_as_it_runs(self, settings: Settings) -> None:
        assert read_server_address(settings) is None
        for shared in (False, True):
            with hold_server_lock(settings, shared=shared) as tell_address:
                assert read_server_address(settings) is None
                tell_address("http://127.0.0.1:8471")
                assert read_server_address(settings) == "http://127.0.0.1:8471"
                named = pytest.raises(StorageError, match=rf"process {os.getpid()}\)")
                with named, hold_server_lock(settings):
                    pass
            assert read_server_address(settings) is None


class TestPracticeLock:
    def test_who_comes_second_waits_until_the_first_is_done(self, settings: Settings) -> None:
        told, first = [], hold_practice_lock(settings, lambda: None)
        first.__enter__()

        def waiting() -> None:
            told.append(True)
            first.__exit__(None, None, None)

        with hold_practice_lock(settings, waiting):
            assert told == [True]
