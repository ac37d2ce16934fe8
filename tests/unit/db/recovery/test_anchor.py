from __future__ import annotations

from collections.abc import Iterator
from contextlib import closing
from dataclasses import replace
from pathlib import Path

import pytest
from sqlalchemy import Engine, text
from structlog.testing import capture_logs

from app.config import Settings
from app.db.dialects.dialect import get_dialect, make_engine
from app.db.log import NewLogEntry, append_entries
from app.db.recovery import anchor
from app.db.recovery.anchor import (
    DatabaseAnchor,
    find_anchor_file,
    read_anchor,
    renew_anchor,
    write_anchor,
)
from app.db.store import Store
from app.errors import DamagedError
from tests.unit.db.homes import log_ids, say


def anchored(own_store: Store) -> DatabaseAnchor:
    found = read_anchor(own_store.settings.database_file)
    assert found is not None
    return found


def cut_log(own_store: Store, *, after: int) -> None:
    """Take the end of the log away, as only somebody can who changes the schema."""
    on_file = get_dialect(own_store.settings).is_file
    with own_store.write() as session:
        session.execute(text(_OPENED_ON_FILE if on_file else _OPENED_ON_SERVER))
        session.execute(text(f"DELETE FROM log WHERE id > {after}"))


_OPENED_ON_FILE = "DROP TRIGGER log_refuses_delete"
_OPENED_ON_SERVER = "ALTER TABLE log DISABLE TRIGGER USER"


def say_at_once(own_store: Store, times: int) -> None:
    with own_store.write() as session:
        for _ in range(times):
            append_entries(session, [NewLogEntry("work", "ada", "2026-11-23T10:00:00+00:00", {})])


def refuse(*_: object) -> None:
    raise PermissionError("refused")


@pytest.fixture
def engine(own_store: Store) -> Iterator[Engine]:
    engine = make_engine(own_store.settings)
    yield engine
    engine.dispose()


class TestReadAnchor:
    def test_one_that_was_half_written_when_it_was_read_is_read_once_more(
        self, own_store: Store, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        expected, read = anchored(own_store), Path.read_bytes
        torn = iter([b'{"installation": "a'])
        monkeypatch.setattr(Path, "read_bytes", lambda path: next(torn, None) or read(path))
        assert read_anchor(own_store.settings.database_file) == expected

    def test_one_that_stays_broken_is_damage(self, own_store: Store) -> None:
        find_anchor_file(own_store.settings.database_file).write_bytes(b"{")
        with pytest.raises(DamagedError, match="is damaged"):
            read_anchor(own_store.settings.database_file)


class TestRequireOwnDatabase:
    def test_an_anchor_of_two_halves_is_no_damage_when_the_next_look_finds_it_whole(
        self, own_store: Store, engine: Engine, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        say(own_store, 2)
        whole = anchored(own_store)
        found = iter([replace(whole, hash="of another entry")])
        monkeypatch.setattr(anchor, "read_anchor", lambda _database: next(found, whole))
        anchor.require_own_database(engine, own_store.settings)


class TestRenewAnchor:
    def test_beside_a_writer_an_anchor_that_knows_less_is_left_to_the_writer(
        self, own_store: Store, engine: Engine
    ) -> None:
        say(own_store, 2)
        file = own_store.settings.database_file
        behind = replace(anchored(own_store), entries=0, hash="")
        write_anchor(file, behind)
        renew_anchor(engine, own_store.settings, alone=False)
        assert anchored(own_store) == behind
        renew_anchor(engine, own_store.settings, alone=True)
        assert anchored(own_store).entries == 2

    @pytest.mark.parametrize("value", ["installation", "schema"])
    def test_beside_a_writer_one_of_another_database_or_schema_is_made_anew(
        self, own_store: Store, engine: Engine, value: str
    ) -> None:
        whole = anchored(own_store)
        write_anchor(own_store.settings.database_file, replace(whole, **{value: "another"}))
        renew_anchor(engine, own_store.settings, alone=False)
        assert anchored(own_store) == whole

    def test_one_that_is_missing_is_made_anew(self, own_store: Store, engine: Engine) -> None:
        whole = anchored(own_store)
        find_anchor_file(own_store.settings.database_file).unlink()
        renew_anchor(engine, own_store.settings, alone=False)
        assert anchored(own_store) == whole


class TestBeforeTheCommit:
    @pytest.mark.parametrize("times", [1, 5])
    def test_a_log_that_has_lost_its_end_takes_no_entry_and_the_home_forgets_nothing(
        self, own_store: Store, times: int
    ) -> None:
        say(own_store, 5)
        cut_log(own_store, after=3)
        with pytest.raises(DamagedError, match="ends after 3 entries, but this home recorded 5"):
            say_at_once(own_store, times)
        with pytest.raises(DamagedError, match="nothing can be changed now"):
            say(own_store)
        assert (log_ids(own_store), anchored(own_store).entries) == ([1, 2, 3], 5)

    def test_an_end_that_another_process_wrote_counts_too(self, own_store: Store) -> None:
        say(own_store, 2)
        with closing(Store.open(own_store.settings)) as other:
            say(other, 3)
        cut_log(own_store, after=4)
        with pytest.raises(DamagedError, match="ends after 4 entries, but this home recorded 5"):
            say(own_store)

    def test_beside_the_writes_of_another_process_the_log_grows(self, own_store: Store) -> None:
        say(own_store, 2)
        with closing(Store.open(own_store.settings)) as other:
            say(other, 3)
            say(own_store)
            say(other)
        assert (log_ids(own_store), anchored(own_store).entries) == ([1, 2, 3, 4, 5, 6, 7], 7)

    def test_an_anchor_that_cannot_be_read_costs_no_change(
        self, own_store: Store, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        say(own_store)
        with monkeypatch.context() as broken:
            broken.setattr("app.db.store.read_anchor", refuse)
            say(own_store)
            cut_log(own_store, after=1)
            # What this process has said itself it knows all the same.
            with pytest.raises(DamagedError, match="but this home recorded 2"):
                say(own_store)

    def test_a_home_whose_anchor_was_taken_away_believes_its_database(
        self, own_store: Store
    ) -> None:
        say(own_store, 5)
        cut_log(own_store, after=3)
        find_anchor_file(own_store.settings.database_file).unlink()
        say(own_store)
        assert log_ids(own_store) == [1, 2, 3, 4]


class TestAfterTheCommit:
    @pytest.mark.parametrize("error", [PermissionError, OSError])
    def test_a_home_that_takes_no_anchor_costs_no_change_and_is_logged_once(
        self, own_store: Store, monkeypatch: pytest.MonkeyPatch, error: type[OSError]
    ) -> None:
        def refuse(*_: object) -> None:
            raise error("refused")

        told: list[int] = []
        own_store.listen(lambda: told.append(1))
        with capture_logs() as logs:
            for _round in range(2):
                with monkeypatch.context() as broken:
                    broken.setattr("app.db.store.overwrite_anchor", refuse)
                    say(own_store)
                    say(own_store)
                say(own_store)
        assert [line["event"] for line in logs] == ["home.json cannot be written"] * 2
        assert len(told) == 6
        assert anchored(own_store).entries == 6

    def test_an_anchor_that_cannot_be_synced_costs_nothing_when_it_is_closed(
        self, settings: Settings, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        def refuse(*_: object) -> None:
            raise OSError(5, "Input/output error")

        monkeypatch.setattr("app.db.store.flush_anchor_to_disk", refuse)
        with capture_logs() as logs:
            Store.open(settings).close()
        assert [line["event"] for line in logs] == ["home.json cannot be synced"]
        monkeypatch.undo()
        Store.open(settings).close()
