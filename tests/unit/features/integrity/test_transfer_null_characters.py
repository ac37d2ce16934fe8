"""Neither database takes U+0000, and where a file of older days holds it is found."""

from __future__ import annotations

import pytest
from sqlalchemy import text

from app.db.store import Store
from app.errors import InputError
from app.features.integrity.transfer import (
    TextWithNullCharacter,
    find_null_characters,
    replace_null_characters,
)
from tests.unit.db.homes import INSERT, add, names

DATABASES = ["sqlite", "postgresql"]
COLUMNS = "(name, created, policy, policy_hash)"


class TestStore:
    def test_a_text_with_u_0000_is_refused_and_nothing_is_kept(self, own_store: Store) -> None:
        add(own_store, "before")
        statement = text(f"INSERT INTO dataset {COLUMNS} VALUES (:name, '', '', '')")
        with pytest.raises(InputError, match=r"such as U\+0000"), own_store.write() as session:
            session.execute(text(INSERT.format("beside")))
            session.execute(statement, {"name": "a\0b"})
        assert names(own_store) == ["before"]

    def test_so_are_many_rows_one_of_which_holds_it(self, own_store: Store) -> None:
        statement = text(f"INSERT INTO dataset {COLUMNS} VALUES (:name, '', '', '')")
        with pytest.raises(InputError, match=r"such as U\+0000"), own_store.write() as session:
            session.execute(statement, [{"name": "a"}, {"name": "b\0"}])
        assert names(own_store) == []

    def test_a_question_with_it_is_refused_alike(self, own_store: Store) -> None:
        with pytest.raises(InputError, match=r"such as U\+0000"), own_store.read() as session:
            session.execute(text("SELECT id FROM dataset WHERE name = :name"), {"name": "\0"})


class TestFindNullCharacters:
    def test_a_database_without_them_has_none(self, own_store: Store) -> None:
        add(own_store, "plain")
        with own_store.read() as session:
            assert find_null_characters(session) == []

    def test_every_column_of_texts_is_looked_at(self, own_store: Store) -> None:
        if own_store.settings.database.startswith("postgresql"):
            # It refuses the very function that makes one.
            return
        add(own_store, "plain")
        with own_store.write() as session:
            session.execute(text("UPDATE dataset SET name = 'a' || char(0), policy = char(0)"))
            found = find_null_characters(session)
        assert found == [
            TextWithNullCharacter("dataset", {"id": 1}, "name", "a\0"),
            TextWithNullCharacter("dataset", {"id": 1}, "policy", "\0"),
        ]
        assert str(found[0]) == "dataset id=1 column name"


class TestWithoutNullCharacters:
    def test_texts_alone_are_changed(self) -> None:
        row = {"a": "x\0y", "b": b"\0", "c": 0, "d": None}
        assert replace_null_characters(row) == {"a": "x\ufffdy", "b": b"\0", "c": 0, "d": None}
