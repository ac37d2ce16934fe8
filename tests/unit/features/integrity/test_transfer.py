from __future__ import annotations

import json
from contextlib import closing
from pathlib import Path
from typing import Any

import pytest
from sqlalchemy import Column, MetaData, Table, create_engine, select, text

from app.config import Settings
from app.db.store import Store
from app.errors import DamagedError, InputError, StorageError
from app.features.groups.revision_queries import find_newest_change_id
from app.features.integrity import transfer as module
from app.features.integrity.transfer import transfer_database
from tests.databases import POSTGRESQL
from tests.unit.db.homes import say

pytestmark = pytest.mark.file_of_sqlite("begins with a file, and goes to PostgreSQL in every run")

DATABASES = [POSTGRESQL]


@pytest.fixture
def source(filled: Store, tmp_path: Path) -> Settings:
    """A home of SQLite with a dataset, moved there from PostgreSQL."""
    say(filled, 3)
    filled.close()
    home = Settings(home=tmp_path / "file")
    transfer_database(filled.settings, home)
    return home


def contents(settings: Settings) -> list[tuple[object, ...]]:
    with closing(Store.open(settings)) as store, store.read() as session:
        rows = session.execute(text('SELECT id, "key", inputs_hash FROM groups')).all()
        rows += session.execute(text("SELECT id, at, hash FROM log ORDER BY id")).all()
        return [tuple(row) for row in rows]


class TestTransfer:
    def test_either_way_everything_comes_and_ids_are_counted_on(
        self, source: Settings, filled: Store, databases, tmp_path: Path
    ) -> None:
        assert contents(source) == contents(filled.settings)
        target = source.model_copy(update={"database_url": databases.new()})
        target.yields.mkdir(parents=True)
        with closing(Store.open(source)) as store, store.write() as session:
            session.execute(text("UPDATE groups SET split = split"))
            assert find_newest_change_id(session) == 2
        done = transfer_database(source, target)
        assert done.entries == 3
        # Marks of changes are the target's own, and nothing remembers those of the source.
        assert not target.yields.exists()
        assert contents(target) == contents(source)
        with closing(Store.open(target)) as store, store.write() as session:
            made = "INSERT INTO dataset (name, created, policy, policy_hash)"
            statement = text(f"{made} VALUES ('x', '', '', '') RETURNING id")
            assert session.scalar(statement) == 2
            assert find_newest_change_id(session) == 1

    def test_one_that_was_stopped_goes_on_and_nothing_else_opens_its_target(
        self, source: Settings, databases
    ) -> None:
        target = source.model_copy(update={"database_url": databases.new()})

        def stop(name: str, _rows: int) -> None:
            if name == "groups":
                raise KeyboardInterrupt

        with pytest.raises(KeyboardInterrupt):
            transfer_database(source, target, stop)
        with pytest.raises(StorageError, match="was interrupted"):
            Store.open(target.model_copy(update={"home": source.home.parent / "else"}))
        seen: list[str] = []
        done = transfer_database(source, target, lambda name, _: seen.append(name))
        assert "view" in seen
        assert "groups" not in seen
        assert done.copied < sum(done.rows.values())
        assert contents(target) == contents(source)

    def test_a_copy_that_differs_is_not_opened(
        self, source: Settings, databases, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        target = source.model_copy(update={"database_url": databases.new()})
        monkeypatch.setattr(module, "_digest_rows", lambda connection, _: (id(connection), ""))
        with pytest.raises(DamagedError, match="differs from the source"):
            transfer_database(source, target)
        monkeypatch.undo()
        with pytest.raises(StorageError, match="was interrupted"):
            Store.open(target.model_copy(update={"home": source.home.parent / "else"}))

    def test_a_database_in_use_is_left_alone(self, source: Settings, filled: Store) -> None:
        before = contents(filled.settings)
        with pytest.raises(InputError, match="already uses the target"):
            transfer_database(source, filled.settings)
        assert contents(filled.settings) == before

    def test_the_command_reads_an_address_from_a_private_file(
        self, source: Settings, databases, touchline, tmp_path: Path
    ) -> None:
        file = tmp_path / "database_url"
        file.touch(mode=0o600)
        file.write_text(databases.new() + "\n")
        code, out, _ = touchline("transfer", source.home, file, "--json")
        assert (code, json.loads(out)["entries"]) == (0, 3)
        code, out, _ = touchline("transfer", file, tmp_path / "back", "--json")
        assert (code, json.loads(out)["entries"]) == (0, 3)
        assert contents(Settings(home=tmp_path / "back")) == contents(source)

    def test_the_command_says_what_is_equal(self, source: Settings, databases, touchline) -> None:
        code, out, _ = touchline("transfer", source.home, databases.new(), "--json")
        assert (code, json.loads(out)["entries"]) == (0, 3)


def make_row(table: Table) -> dict[Column[Any], Any]:
    """A value in every column."""
    by_type = {int: 1, str: "x", float: 0.5, bytes: b"x", bool: True}
    return {column: by_type[column.type.python_type] for column in table.columns}


def test_every_column_of_every_table_is_copied() -> None:
    engines = create_engine("sqlite://"), create_engine("sqlite://")
    with engines[0].connect() as source, engines[1].connect() as target:
        for table in module._tables_to_copy():
            # Neither keys to other tables nor values that must agree: what is copied is any row.
            bare = Table(
                table.name,
                MetaData(),
                *(
                    Column(one.name, one.type, key=one.key, primary_key=one.primary_key)
                    for one in table.columns
                ),
            )
            for connection in (source, target):
                bare.create(connection)
            source.execute(bare.insert().values(make_row(bare)))
            for row in module._read_rows(source, bare):
                target.execute(bare.insert(), [row])
            ours, theirs = (one.execute(select(bare)).all() for one in (target, source))
            assert ours == theirs, table.name


class TestNullCharacters:
    @pytest.fixture
    def older(self, source: Settings) -> Settings:
        """A home from before U+0000 was refused."""
        with closing(Store.open(source)) as store, store.write() as session:
            session.execute(text("UPDATE groups SET label = 'a' || char(0) || 'b' WHERE id = 1"))
        return source

    def test_they_are_named_before_anything_is_copied(self, older: Settings, databases) -> None:
        target = older.model_copy(update={"database_url": databases.new()})
        with pytest.raises(InputError, match="groups id=1 column label") as caught:
            transfer_database(older, target)
        assert "--replace-null" in (caught.value.hint or "")

    def test_they_are_replaced_when_that_is_asked_for(
        self, older: Settings, databases, touchline
    ) -> None:
        url = databases.new()
        code, out, _ = touchline("transfer", older.home, url, "--replace-null", "--json")
        assert (code, json.loads(out)["entries"]) == (0, 3)
        target = older.model_copy(update={"database_url": url})
        with closing(Store.open(target)) as store, store.read() as session:
            assert session.scalar(text("SELECT label FROM groups WHERE id = 1")) == "a\ufffdb"
