"""Groups from views that come one by one, each with what it says about its group."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace

from app.formats.report import Report
from app.formats.view_state import GroupHead
from app.plural import plural
from app.soccer.group import Group, Station, View


@dataclass(frozen=True)
class PlacedView:
    """A view, its place in its group, and its group's head."""

    head: GroupHead
    position: int
    view: View


class ViewGroups:
    """Puts together views whose group has one key.

    A group is ready when it has as many views as it says; views of static cameras may lie in
    several files. Stations of one key become one, so that a thousand groups share it.
    """

    def __init__(self, report: Report):
        self._report = report
        self._waiting: dict[str, list[PlacedView]] = {}
        self._shared: dict[str, Station] = {}
        self._done: set[str] = set()
        """Groups that were ready: whatever comes of them afterwards comes twice."""

    def add(self, item: PlacedView, path: str) -> Iterator[Group]:
        """The group that this view completes, if it does; ``path`` is the file that it comes from."""
        key = item.head.key
        waiting = [] if key in self._done else self._waiting.setdefault(key, [])
        if key in self._done or any(other.view.key == item.view.key for other in waiting):
            self._report.note(path, key, item.view.key, "comes twice; the first one counts")
            return
        waiting.append(item)
        if len(waiting) == item.head.views:
            self._done.add(key)
            yield self._make_group(self._waiting.pop(key))

    def incomplete_groups(self) -> Iterator[Group]:
        """Groups that have fewer views than they say, as they are, which is said."""
        lacking = [
            f"{key} ({len(items)} of {items[0].head.views})"
            for key, items in self._waiting.items()
            if items[0].head.views > len(items)
        ]
        if lacking:
            count = plural(len(lacking), "group has", "groups have")
            shown = ", ".join(lacking[:5]) + (", ..." if len(lacking) > 5 else "")
            self._report.remark(f"{count} fewer views than when it was written: {shown}")
        for key in list(self._waiting):
            yield self._make_group(self._waiting.pop(key))

    def _make_group(self, items: list[PlacedView]) -> Group:
        self._report.imported += len(items)
        items.sort(key=lambda item: item.position)
        return items[0].head.group(tuple(self._with_shared_station(item.view) for item in items))

    def _with_shared_station(self, view: View) -> View:
        station = view.station
        if not station.shared:
            return view
        return replace(view, station=self._shared.setdefault(station.key, station))
