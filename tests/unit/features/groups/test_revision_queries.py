from __future__ import annotations

from app.db.log import NewLogEntry, append_entries, find_newest_entry_id
from app.features.groups.revision_queries import (
    StoredChange,
    iterate_changes_after_entry,
    list_groups_solved_after,
)
from app.features.solutions.queries import find_newest_solution_id


class TestLoggedChanges:
    def test_what_is_said_of_a_static_camera_is_told_of_each_of_its_groups(self, filled) -> None:
        with filled.write() as session:
            append_entries(session, [NewLogEntry("user", "ann", "t", {})])
            append_entries(session, [NewLogEntry("station_edit", "ann", "t", {}, 1, station_id=1)])
            append_entries(session, [NewLogEntry("edit", "bob", "t", {}, 1, 1)])
            assert find_newest_entry_id(session) == 3
            assert list(iterate_changes_after_entry(session, 2)) == [
                StoredChange(3, 1, "edit", "bob", 1)
            ]
            assert set(iterate_changes_after_entry(session, 0)) == {
                StoredChange(2, 1, "station_edit", "ann", None),
                StoredChange(2, 1, "station_edit", "ann", 1),
                StoredChange(3, 1, "edit", "bob", 1),
            }


class TestSolvedGroups:
    def test_nothing_is_solved_where_nothing_was(self, filled) -> None:
        with filled.read() as session:
            assert (find_newest_solution_id(session), list_groups_solved_after(session, 0)) == (
                0,
                [],
            )
