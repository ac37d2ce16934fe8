from __future__ import annotations

from dataclasses import replace

import pytest
from sqlalchemy import text

from app.db.log import (
    LogModel,
    NewLogEntry,
    append_entries,
    filter_groups_with_history,
    find_newest_entry_id,
    list_group_entries,
    list_station_entries,
    read_entries,
    read_log,
    verify_chain,
)
from app.errors import StorageError
from tests.databases import said_for_sqlite

FIRST = NewLogEntry("import", "ann", "2030-01-01T00:00:00+00:00", {"x": 0.1 + 0.2}, 1, 7)


def fill(own_store, count: int) -> None:
    with own_store.write() as session:
        append_entries(session, [replace(FIRST, body={"n": number}) for number in range(count)])


class TestAppend:
    def test_entries_come_back_in_order_with_ids(self, own_store) -> None:
        with own_store.write() as session:
            assert append_entries(session, [FIRST, replace(FIRST, kind="edit", group_id=8)]) == [
                1,
                2,
            ]
            assert append_entries(session, []) == []
        with own_store.write() as session:
            assert append_entries(session, [replace(FIRST, group_id=None, station_id=3)]) == [3]
        with own_store.read() as session:
            entries = list(read_log(session))
        assert [(item.id, item.kind, item.group_id) for item in entries] == [
            (1, "import", 7),
            (2, "edit", 8),
            (3, "import", None),
        ]
        assert entries[0].body == FIRST.body

    def test_an_entry_with_nan_is_refused(self, own_store) -> None:
        with pytest.raises(ValueError, match="JSON"), own_store.write() as session:
            append_entries(session, [replace(FIRST, body={"x": float("nan")})])


class TestReadLog:
    def test_a_long_log_comes_in_batches(self, own_store, monkeypatch) -> None:
        monkeypatch.setattr("app.db.log._BATCH", 3)
        fill(own_store, 10)
        with own_store.read() as session:
            assert [item.body["n"] for item in read_log(session)] == list(range(10))
            assert [item.id for item in read_log(session, LogModel.group_id == 7, after=8)] == [
                9,
                10,
            ]


class TestReadEntries:
    def test_few_ids_are_asked_for_at_once_and_all_come_in_order(
        self, own_store, monkeypatch
    ) -> None:
        fill(own_store, 10)
        asked = []

        def counting(session, *where):
            asked.extend(len(item.right.value) for item in where)
            return read_log(session, *where)

        monkeypatch.setattr("app.db.log._BATCH", 3)
        monkeypatch.setattr("app.db.log.read_log", counting)
        with own_store.read() as session:
            found = [entry.id for entry in read_entries(session, [1, 2, 4, 5, 7, 8, 9])]
        assert (found, asked) == ([1, 2, 4, 5, 7, 8, 9], [3, 3, 1])


class TestEntriesOfOne:
    def test_a_group_a_static_camera_and_neither(self, own_store) -> None:
        with own_store.write() as session:
            said = [
                FIRST,
                replace(FIRST, kind="verdict"),
                replace(FIRST, kind="station", group_id=None, station_id=3),
                replace(FIRST, kind="camera", station_id=3),
                replace(FIRST, group_id=8),
                replace(FIRST, group_id=8, kind="verdict"),
            ]
            append_entries(session, said)
            assert [item.id for item in list_group_entries(session, 7)] == [1, 2, 4]
            assert [item.id for item in list_group_entries(session, 7, verdicts=False)] == [1, 4]
            assert [item.id for item in list_station_entries(session, 3)] == [3]
            assert filter_groups_with_history(session, [7, 8, 9]) == {7}
            assert find_newest_entry_id(session) == 6


class TestVerifyChain:
    def test_counts_a_sound_log(self, own_store) -> None:
        fill(own_store, 5)
        with own_store.read() as session:
            assert verify_chain(session) == 5

    @pytest.mark.parametrize(
        ("statement", "row"),
        [
            ("UPDATE log SET actor = 'eve' WHERE id = 3", 3),
            ("UPDATE log SET group_id = 9 WHERE id = 3", 3),
            ("UPDATE log SET at = '2031' WHERE id = 5", 5),
            ("UPDATE log SET body = (SELECT body FROM log WHERE id = 1) WHERE id = 3", 3),
            ("DELETE FROM log WHERE id = 2", 3),
            ("DELETE FROM log WHERE id = 1", 2),
        ],
    )
    def test_names_the_first_row_that_is_not_what_was_written(
        self, own_store, statement: str, row: int
    ) -> None:
        fill(own_store, 5)
        with own_store.write() as session, said_for_sqlite(session):
            for verb in ("update", "delete"):
                session.execute(text(f"DROP TRIGGER log_refuses_{verb}"))
            session.execute(text(statement))
        with (
            own_store.read() as session,
            pytest.raises(StorageError, match=f"row {row} of the log"),
        ):
            verify_chain(session)
