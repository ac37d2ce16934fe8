from __future__ import annotations

from collections.abc import Iterator
from contextlib import closing
from dataclasses import replace
from pathlib import Path

import pytest
from sqlalchemy import Engine, text
from structlog.testing import capture_logs

from app.config import Settings
from app.errors import DamagedError
from app.store.dialect.dialect import dialect_of
from app.store.engine import make_engine
from app.store.log import Entry, append
from app.store.recovery import anchor
from app.store.recovery.anchor import Anchor, anchor_file, make_anchor, read_anchor, renew_anchor
from app.store.store import Store
from tests.unit.store.homes import log_ids, say


def anchored(store: Store) -> Anchor:
    found = read_anchor(store.settings.database_file)
    assert found is not None
    return found


def cut_log(store: Store, *, after: int) -> None:
    """Take the end of the log away, as only somebody can who changes the schema."""
    on_file = dialect_of(store.settings).is_file
    with store.write() as session:
        session.execute(text(_OPENED_ON_FILE if on_file else _OPENED_ON_SERVER))
        session.execute(text(f"DELETE FROM log WHERE id > {after}"))


_OPENED_ON_FILE = "DROP TRIGGER log_refuses_delete"
_OPENED_ON_SERVER = "ALTER TABLE log DISABLE TRIGGER USER"


def say_at_once(store: Store, times: int) -> None:
    with store.write() as session:
        for _ in range(times):
            append(session, [Entry("work", "ada", "2026-11-23T10:00:00+00:00", {})])


def refuse(*_: object) -> None:
    raise PermissionError("refused")


@pytest.fixture
def engine(store: Store) -> Iterator[Engine]:
    engine = make_engine(store.settings)
    yield engine
    engine.dispose()


class TestReadAnchor:
    def test_one_that_was_half_written_when_it_was_read_is_read_once_more(
        self, store: Store, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        expected, read = anchored(store), Path.read_bytes
        torn = iter([b'{"installation": "a'])
        monkeypatch.setattr(Path, "read_bytes", lambda path: next(torn, None) or read(path))
        assert read_anchor(store.settings.database_file) == expected

    def test_one_that_stays_broken_is_damage(self, store: Store) -> None:
        anchor_file(store.settings.database_file).write_bytes(b"{")
        with pytest.raises(DamagedError, match="not what was written"):
            read_anchor(store.settings.database_file)


class TestRequireOwnDatabase:
    def test_an_anchor_of_two_halves_is_no_damage_when_the_next_look_finds_it_whole(
        self, store: Store, engine: Engine, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        say(store, 2)
        whole = anchored(store)
        found = iter([replace(whole, hash="of another entry")])
        monkeypatch.setattr(anchor, "read_anchor", lambda _database: next(found, whole))
        anchor.require_own_database(engine, store.settings)


class TestRenewAnchor:
    def test_beside_a_writer_an_anchor_that_knows_less_is_left_to_the_writer(
        self, store: Store, engine: Engine
    ) -> None:
        say(store, 2)
        file = store.settings.database_file
        behind = replace(anchored(store), entries=0, hash="")
        make_anchor(file, behind)
        renew_anchor(engine, store.settings, alone=False)
        assert anchored(store) == behind
        renew_anchor(engine, store.settings, alone=True)
        assert anchored(store).entries == 2

    @pytest.mark.parametrize("value", ["installation", "schema"])
    def test_beside_a_writer_one_of_another_database_or_schema_is_made_anew(
        self, store: Store, engine: Engine, value: str
    ) -> None:
        whole = anchored(store)
        make_anchor(store.settings.database_file, replace(whole, **{value: "another"}))
        renew_anchor(engine, store.settings, alone=False)
        assert anchored(store) == whole

    def test_one_that_is_missing_is_made_anew(self, store: Store, engine: Engine) -> None:
        whole = anchored(store)
        anchor_file(store.settings.database_file).unlink()
        renew_anchor(engine, store.settings, alone=False)
        assert anchored(store) == whole


class TestBeforeTheCommit:
    @pytest.mark.parametrize("times", [1, 5])
    def test_a_log_that_has_lost_its_end_takes_no_entry_and_the_home_forgets_nothing(
        self, store: Store, times: int
    ) -> None:
        say(store, 5)
        cut_log(store, after=3)
        with pytest.raises(DamagedError, match="ends after 3 entries, but this home has noted 5"):
            say_at_once(store, times)
        with pytest.raises(DamagedError, match="nothing can be changed now"):
            say(store)
        assert (log_ids(store), anchored(store).entries) == ([1, 2, 3], 5)

    def test_an_end_that_another_process_wrote_counts_too(self, store: Store) -> None:
        say(store, 2)
        with closing(Store.open(store.settings)) as other:
            say(other, 3)
        cut_log(store, after=4)
        with pytest.raises(DamagedError, match="ends after 4 entries, but this home has noted 5"):
            say(store)

    def test_beside_the_writes_of_another_process_the_log_grows(self, store: Store) -> None:
        say(store, 2)
        with closing(Store.open(store.settings)) as other:
            say(other, 3)
            say(store)
            say(other)
        assert (log_ids(store), anchored(store).entries) == ([1, 2, 3, 4, 5, 6, 7], 7)

    def test_an_anchor_that_cannot_be_read_costs_no_change(
        self, store: Store, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        say(store)
        with monkeypatch.context() as broken:
            broken.setattr("app.store.store.read_anchor", refuse)
            say(store)
            cut_log(store, after=1)
            # What this process has said itself it knows all the same.
            with pytest.raises(DamagedError, match="but this home has noted 2"):
                say(store)

    def test_a_home_whose_anchor_was_taken_away_believes_its_database(self, store: Store) -> None:
        say(store, 5)
        cut_log(store, after=3)
        anchor_file(store.settings.database_file).unlink()
        say(store)
        assert log_ids(store) == [1, 2, 3, 4]


class TestAfterTheCommit:
    @pytest.mark.parametrize("error", [PermissionError, OSError])
    def test_a_home_that_takes_no_anchor_costs_no_change_and_is_logged_once(
        self, store: Store, monkeypatch: pytest.MonkeyPatch, error: type[OSError]
    ) -> None:
        def refuse(*_: object) -> None:
            raise error("refused")

        told: list[int] = []
        store.listen(lambda: told.append(1))
        with capture_logs() as logs:
            for _round in range(2):
                with monkeypatch.context() as broken:
                    broken.setattr("app.store.store.move_anchor", refuse)
                    say(store)
                    say(store)
                say(store)
        assert [line["event"] for line in logs] == ["home.json cannot be written"] * 2
        assert len(told) == 6
        assert anchored(store).entries == 6

    def test_an_anchor_that_cannot_be_synced_costs_nothing_when_it_is_closed(
        self, settings: Settings, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        def refuse(*_: object) -> None:
            raise OSError(5, "Input/output error")

        monkeypatch.setattr("app.store.store.sync_anchor", refuse)
        with capture_logs() as logs:
            Store.open(settings).close()
        assert [line["event"] for line in logs] == ["home.json cannot be synced"]
        monkeypatch.undo()
        Store.open(settings).close()
