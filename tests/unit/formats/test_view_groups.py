from __future__ import annotations

from app.formats.report import Report
from app.formats.view_groups import PlacedView, ViewGroups
from app.formats.view_state import GroupHead
from app.soccer.frames import ImageSize
from app.soccer.group import Station, View
from app.soccer.pitch import Pitch


def placed(key: str, group: str = "g", position: int = 0, views: int = 2) -> PlacedView:
    head = GroupHead(group, "", "", "", Pitch(), views)
    station = Station("cam1", ImageSize(8, 8), shared=True)
    return PlacedView(head, position, View(key, station))


class TestViewGroups:
    def test_a_group_comes_when_its_last_view_does_in_the_order_of_positions(
        self, report: Report
    ) -> None:
        groups = ViewGroups(report)
        assert list(groups.add(placed("b", position=1), "a.json")) == []
        assert list(groups.add(placed("x", "other"), "a.json")) == []
        (group,) = groups.add(placed("a"), "a.json")
        assert [view.key for view in group.views] == ["a", "b"]
        (rest,) = groups.incomplete_groups()
        assert (rest.key, report.imported) == ("other", 3)
        assert list(groups.incomplete_groups()) == []
        assert report.remarks == [
            "1 group has fewer views than when it was written: other (1 of 2)"
        ]

    def test_static_cameras_of_one_key_are_one_station(self, report: Report) -> None:
        groups = ViewGroups(report)
        first, second = (
            group for name in "ab" for group in groups.add(placed("v", name, views=1), "a.json")
        )
        assert first.views[0].station is second.views[0].station

    def test_a_view_that_comes_twice_counts_once(self, report: Report) -> None:
        groups = ViewGroups(report)
        assert list(groups.add(placed("a"), "a.json")) == []
        assert list(groups.add(placed("a"), "a.json")) == []
        (problem,) = report.problems
        assert (problem.path, "comes twice" in problem.problem) == ("a.json", True)

    def test_a_group_that_comes_again_in_another_file_is_not_handed_on_twice(
        self, report: Report
    ) -> None:
        groups = ViewGroups(report)
        found = [
            group
            for path in ("a.json", "b.json")
            for key in ("a", "b")
            for group in groups.add(placed(key), path)
        ]
        assert (len(found), report.imported, list(groups.incomplete_groups())) == (1, 2, [])
        assert [(problem.path, problem.field) for problem in report.problems] == [
            ("b.json", "a"),
            ("b.json", "b"),
        ]
