from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import pytest

from app.features.imports.body import MAX_POINTS, MAX_VIEWS, GroupLimits, count_points
from app.formats.report import ReaderReport
from app.soccer.annotation import Lines, make_lines
from app.soccer.group import Group

MakeGroup = Callable[..., Group]


def lines_of(**counts: int) -> Lines:
    """Markings with so many points each; a name's underscores are spaces."""
    points = [(float(place), 2.0) for place in range(MAX_POINTS + 1)]
    return make_lines({name.replace("_", " "): points[:count] for name, count in counts.items()})


def with_lines(group: Group, lines: Lines, proposed: tuple[str, ...] = ()) -> Group:
    view = group.views[0]
    station = replace(view.station, lines=lines, proposed=proposed)
    return group.with_view(replace(view, station=station))


@pytest.fixture
def report() -> ReaderReport:
    return ReaderReport()


@pytest.fixture
def limits(report: ReaderReport) -> GroupLimits:
    return GroupLimits("files", report)


class TestViews:
    def test_as_many_as_a_group_may_have_stay(
        self, limits: GroupLimits, report: ReaderReport, make_group: MakeGroup
    ) -> None:
        view = make_group(7).views[0]
        views = tuple(replace(view, key=str(number)) for number in range(MAX_VIEWS))
        group = replace(make_group(7), views=views)
        assert limits.trim_group_to_limits(group) == group
        assert report.problems == []

    def test_a_group_of_more_is_left_out_and_named(
        self, limits: GroupLimits, report: ReaderReport, make_group: MakeGroup
    ) -> None:
        group = make_group(7)
        assert (
            limits.trim_group_to_limits(replace(group, views=group.views[:1] * (MAX_VIEWS + 1)))
            is None
        )
        (problem,) = report.problems
        assert (problem.path, problem.record) == ("files", group.key)
        assert problem.problem == "has 101 views; the limit is 100, so the group is left out"


class TestPoints:
    def test_as_many_as_a_view_may_have_stay(
        self, limits: GroupLimits, report: ReaderReport, make_group: MakeGroup
    ) -> None:
        lines = lines_of(Middle_line=MAX_POINTS - 10, Side_line_top=10)
        group = with_lines(make_group(7), lines)
        assert limits.trim_group_to_limits(group) == group
        assert report.problems == []

    def test_a_marking_of_more_is_left_out_and_named(
        self, limits: GroupLimits, report: ReaderReport, make_group: MakeGroup
    ) -> None:
        lines = lines_of(Middle_line=MAX_POINTS + 1, Side_line_top=4)
        held = limits.trim_group_to_limits(
            with_lines(make_group(7), lines, ("Middle line", "Side line top"))
        )
        assert held is not None
        station = held.views[0].station
        assert station.lines == lines_of(Side_line_top=4)
        assert station.proposed == ("Side line top",)
        assert held.views[1] == make_group(7).views[1]
        assert [problem.message for problem in report.problems] == [
            f"files, {held.key}, view 7.png, Middle line: has 1,001 of 1,005 points; the limit of a "
            "view is 1,000: this marking is left out"
        ]

    def test_the_densest_markings_go_until_the_others_may_stay(
        self, limits: GroupLimits, report: ReaderReport, make_group: MakeGroup
    ) -> None:
        lines = lines_of(Middle_line=600, Side_line_top=500, Circle_central=450, Side_line_left=50)
        held = limits.trim_group_to_limits(with_lines(make_group(7), lines))
        assert held is not None
        assert held.views[0].station.lines.keys() == {
            "Side line top", "Circle central", "Side line left",
        }  # fmt: skip
        assert count_points(held.views[0].station.lines) == MAX_POINTS
        assert len(report.problems) == 1

    def test_a_static_camera_is_told_once_and_held_in_every_group(
        self, limits: GroupLimits, report: ReaderReport, make_static: MakeGroup
    ) -> None:
        lines = lines_of(Middle_line=MAX_POINTS + 1, Side_line_top=4)
        for frame in (10, 11):
            held = limits.trim_group_to_limits(with_lines(make_static(frame), lines))
            assert held is not None
            assert held.views[0].station.lines == lines_of(Side_line_top=4)
        (problem,) = report.problems
        assert (problem.record, problem.field) == ("10", "camera cam1, Middle line")

    def test_cameras_of_single_views_are_told_each_time(
        self, limits: GroupLimits, report: ReaderReport, make_group: MakeGroup
    ) -> None:
        for number in (7, 8):
            limits.trim_group_to_limits(
                with_lines(make_group(number), lines_of(Middle_line=MAX_POINTS + 1))
            )
        assert len(report.problems) == 2
