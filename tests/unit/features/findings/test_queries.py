from __future__ import annotations

from app.features.findings.queries import (
    add_group_findings,
    filter_groups_with_finding,
    find_station_finding,
    list_group_import_findings,
    replace_group_import_findings,
    replace_station_finding,
)


class TestGroupFindings:
    def test_they_come_in_the_order_in_which_they_were_noticed(self, filled) -> None:
        with filled.write() as session:
            add_group_findings(session, "upstream", [(1, "7.png", "b"), (1, None, "a")])
            assert list_group_import_findings(session, 1) == [("7.png", "b"), (None, "a")]

    def test_new_findings_replace_all_of_the_group(self, filled) -> None:
        with filled.write() as session:
            add_group_findings(session, "upstream", [(1, "7.png", "b")])
            replace_group_import_findings(session, 1, "upstream", [("cam1", "c")])
            assert list_group_import_findings(session, 1) == [("cam1", "c")]
            replace_group_import_findings(session, 1, "upstream", [])
            assert list_group_import_findings(session, 1) == []


class TestGroupsTold:
    def test_a_sentence_about_one_view_is_not_about_the_group(self, filled) -> None:
        with filled.write() as session:
            add_group_findings(session, "upstream", [(1, "7.png", "gone")])
            assert filter_groups_with_finding(session, [1, 2], "gone") == set()
            add_group_findings(session, "upstream", [(1, None, "gone")])
            assert filter_groups_with_finding(session, [1, 2], "gone") == {1}
            assert filter_groups_with_finding(session, [2], "gone") == set()


class TestStationFinding:
    def test_a_station_has_at_most_one_finding(self, filled) -> None:
        with filled.write() as session:
            assert find_station_finding(session, 1) is None
            for sentence in ("first", "second"):
                replace_station_finding(session, 1, "upstream", sentence)
            assert find_station_finding(session, 1) == "second"
            replace_station_finding(session, 1, "upstream", None)
            assert find_station_finding(session, 1) is None
