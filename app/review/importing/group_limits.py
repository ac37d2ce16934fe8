"""Group limits: how much of a group an import takes, so that it can be solved in a moment."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

from app.datasets.report import Report
from app.soccer.annotation import Lines
from app.soccer.group import Group, View

MAX_VIEWS = 100
"""Of a group: solving it grows with their square, and 100 take a second."""
MAX_POINTS = 1000
"""Of all lines of a view: calibrating takes about a millisecond for each, and the public datasets have
at most 85."""


class GroupLimits:
    """Holds the groups of one import to what a group may have, and tells what it leaves out.

    Args:
        source: Where they come from.
        report: Hears of each group and each marking that is left out.
    """

    def __init__(self, source: str, report: Report):
        self._source, self._report = source, report
        self._told: set[str] = set()
        """Static cameras whose markings are told already: every group brings them again."""

    def held(self, group: Group) -> Group | None:
        """The group with no more points than its views may have; None where it has too many views."""
        count = len(group.views)
        if count > MAX_VIEWS:
            problem = f"has {count:,} views, a group may have {MAX_VIEWS}; it is left out"
            self._report.note(self._source, group.key, None, problem)
            return None
        return replace(group, views=tuple(self._thinned(group, view) for view in group.views))

    def _thinned(self, group: Group, view: View) -> View:
        station = view.station
        dense = list(_too_dense(station.lines))
        if not dense:
            return view
        if station.key not in self._told:
            for marking in dense:
                self._tell(group, view, marking)
        if station.shared:
            self._told.add(station.key)
        lines = {name: points for name, points in station.lines.items() if name not in dense}
        proposed = tuple(name for name in station.proposed if name in lines)
        return replace(view, station=replace(station, lines=lines, proposed=proposed))

    def _tell(self, group: Group, view: View, marking: str) -> None:
        station = view.station
        what = f"camera {station.key}" if station.shared else f"view {view.key}"
        count, total = len(station.lines[marking]), points_of(station.lines)
        problem = (
            f"has {count:,} of {total:,} points, and a view may have {MAX_POINTS:,}; "
            "this marking is left out"
        )
        self._report.note(self._source, group.key, f"{what}, {marking}", problem)


def points_of(lines: Lines) -> int:
    """How many points lines have in all."""
    return sum(map(len, lines.values()))


def _too_dense(lines: Lines) -> Iterator[str]:
    """The densest markings, as many as have to go until the others may stay."""
    total = points_of(lines)
    for marking in sorted(lines, key=lambda name: len(lines[name]), reverse=True):
        if total <= MAX_POINTS:
            return
        total -= len(lines[marking])
        yield marking
