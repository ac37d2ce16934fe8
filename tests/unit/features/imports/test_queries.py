from __future__ import annotations

from app.db.log import NewLogEntry, append_entries
from app.features.imports.queries import (
    VERDICT,
    KnownGroup,
    find_newest_imports,
    list_known_groups,
    list_shared_stations,
    list_verdicts_of_groups,
)
from app.features.verdicts.queries import StoredVerdict, insert_verdicts_and_end_work

VALUES = ("ann", "t", "rejected", "bad", None, "i", "p", False, None)


class TestKnownGroups:
    def test_gives_all_groups_or_those_of_some_keys(self, filled) -> None:
        expected = [KnownGroup(1, "m/7.png", "m", "source")]
        with filled.read() as session:
            assert (
                list_known_groups(session, 1)
                == list_known_groups(session, 1, ["m/7.png"])
                == expected
            )
            assert list_known_groups(session, 1, []) == list_known_groups(session, 2) == []


class TestNewestImports:
    def test_finds_the_last_import_of_each_group(self, filled) -> None:
        with filled.write() as session:
            for source in ("old", "new"):
                append_entries(
                    session, [NewLogEntry("import", "ann", "t", {"source": source}, 1, 1)]
                )
            append_entries(session, [NewLogEntry("edit", "ann", "t", {}, 1, 1)])
            found = find_newest_imports(session, [1, 2])
        assert [(entry.group_id, entry.body["source"]) for entry in found] == [(1, "new")]


class TestSharedStations:
    def test_a_camera_of_one_view_is_no_shared_station(self, filled, full_group) -> None:
        with filled.read() as session:
            (found,) = list_shared_stations(session, 1)
            assert found.station == full_group.views[1].station
            assert list_shared_stations(session, 1, "cam1") == [found]
            assert list_shared_stations(session, 1, "m/7.png") == []


class TestGroupVerdicts:
    def test_they_come_back_as_they_were_added(self, filled) -> None:
        first = dict(zip(VERDICT, VALUES, strict=True))
        second = first | {"state": "accepted", "reason": None, "fixed": True}
        with filled.write() as session:
            given = [StoredVerdict(1, 1, **first), StoredVerdict(2, 1, **second)]
            insert_verdicts_and_end_work(session, 1, given, actor="ann", at="t")
            assert list_verdicts_of_groups(session, [1, 2]) == {1: [first, second]}
