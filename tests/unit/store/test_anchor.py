from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import pytest
from sqlalchemy import Engine

from app.errors import DamagedError
from app.store import anchor
from app.store.anchor import Anchor, anchor_file, make_anchor, read_anchor, renew_anchor
from app.store.engine import make_engine
from app.store.store import Store
from tests.unit.store.homes import say


def anchored(store: Store) -> Anchor:
    found = read_anchor(store.settings.database_file)
    assert found is not None
    return found


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
