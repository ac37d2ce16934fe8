"""What the log keeps of an import of a group.

Limits say how large a group may be; groups that are not brought any more are named.
"""

from __future__ import annotations

from collections.abc import Collection, Iterable, Iterator, Sequence
from dataclasses import replace

from app.db.json_columns import Json
from app.db.log import NewLogEntry, append_entries
from app.db.session import Session, now
from app.features.findings.queries import (
    add_group_findings,
    filter_groups_with_finding,
    list_group_import_findings,
)
from app.features.groups.queries import StoredGroup, read_groups
from app.features.groups.reimport import KIND
from app.features.groups.revision_chain import RevisionChains
from app.features.groups.revision_queries import save_reimported_group
from app.features.imports.queries import list_known_groups
from app.features.queue.refresh_queries import refresh_queue
from app.formats.report import ReaderReport
from app.soccer.annotation import Lines
from app.soccer.codec import group_without_views_to_json, view_to_json
from app.soccer.group import Group, View


def collect_view_and_station_ids(stored: StoredGroup) -> dict[str, tuple[int, int]]:
    """Ids of each view and its station, by the view's key."""
    return {key: (stored.view_ids[key], stored.stations[key].id) for key in stored.view_ids}


def make_import_entry_body(
    group: Group,
    base: Group | None,
    source: str,
    digest: str,
    places: dict[str, tuple[int, int]],
) -> dict[str, Json]:
    """What the log keeps of an import: the group whole, with the ids of its rows.

    ``base`` is left out where it is the group itself.
    """
    return {
        "source": source,
        "source_hash": digest,
        "group": _group_to_log_json(group),
        "base": None if base is None or base == group else _group_to_log_json(base),
        "ids": {key: list(pair) for key, pair in places.items()},
    }


def _group_to_log_json(group: Group) -> Json:
    """A group in which a shared station is its key: the log has it in an entry of its own."""
    views = [
        view_to_json(view, view.station.key if view.station.shared else None)
        for view in group.views
    ]
    return {**group_without_views_to_json(group), "views": views}


GONE = "this group is no longer in the imported files; it is kept until a person rejects it"
_BATCH = 500


def filter_missing_groups_of_read_matches(
    session: Session, dataset_id: int, matches: Collection[str], missing: Collection[int]
) -> list[int]:
    """The missing groups whose match was imported: these are gone from the source.

    A source may bring a part of what it brought last, a match at a time.

    Args:
        session: Any session.
        dataset_id: The dataset.
        matches: Those of which groups came; an empty one means groups of no match.
        missing: Ids of groups that the same source brought last and that did not come.
    """
    if not missing:
        return []
    groups = list_known_groups(session, dataset_id)
    return [group.id for group in groups if group.id in missing and group.match in matches]


def count_new_missing_group_findings(session: Session, ids: Sequence[int]) -> int:
    """How many findings ``save_missing_group_findings`` would save."""
    return len(set(ids) - filter_groups_with_finding(session, ids, GONE))


def save_missing_group_findings(
    session: Session, dataset_id: int, ids: Sequence[int], *, source: str, actor: str
) -> int:
    """Save a finding for each group that has none of the kind yet; returns how many."""
    fresh = sorted(set(ids) - filter_groups_with_finding(session, ids, GONE))
    for start in range(0, len(fresh), _BATCH):
        _save_missing_groups(
            session, dataset_id, fresh[start : start + _BATCH], source=source, actor=actor
        )
    return len(fresh)


def _save_missing_groups(
    session: Session, dataset_id: int, ids: Sequence[int], *, source: str, actor: str
) -> None:
    stored = read_groups(session, ids)
    chains = RevisionChains(session, dataset_id).read_chains_by_group_id(stored.values())
    at, entries = now(), []
    for number, item in stored.items():
        base = chains[number].base
        save_reimported_group(session, item, item.group, at=at, source=base)
        body = _make_missing_group_entry_body(
            item, base, source, list_group_import_findings(session, number)
        )
        entries.append(NewLogEntry("import", actor, at, body, dataset_id, number))
    append_entries(session, entries)
    add_group_findings(session, KIND, ((number, None, GONE) for number in stored))
    refresh_queue(session, list(stored))


def _make_missing_group_entry_body(
    stored: StoredGroup,
    base: Group,
    source: str,
    noticed: Iterable[tuple[str | None, str]],
) -> dict[str, Json]:
    body = make_import_entry_body(
        stored.group, base, source, stored.source_hash, collect_view_and_station_ids(stored)
    )
    body["kept"] = [[view, sentence] for view, sentence in [*noticed, (None, GONE)]]
    return body


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

    def __init__(self, source: str, report: ReaderReport):
        self._source, self._report = source, report
        self._told: set[str] = set()
        """Static cameras whose markings are told already: every group brings them again."""

    def trim_group_to_limits(self, group: Group) -> Group | None:
        """The group with no more points than its views may have; None where it has too many views."""
        count = len(group.views)
        if count > MAX_VIEWS:
            problem = f"has {count:,} views; the limit is {MAX_VIEWS}, so the group is left out"
            self.report_group_left_out(group.key, problem)
            return None
        return replace(
            group, views=tuple(self._drop_densest_markings(group, view) for view in group.views)
        )

    def report_group_left_out(self, group: str, problem: str) -> None:
        """Tell of a group that is left out, by its key, and why."""
        self._report.add_problem_at(self._source, group, None, problem)

    def _drop_densest_markings(self, group: Group, view: View) -> View:
        station = view.station
        dense = list(_iterate_densest_markings(station.lines))
        if not dense:
            return view
        if station.key not in self._told:
            for marking in dense:
                self._report_left_out(group, view, marking)
        if station.shared:
            self._told.add(station.key)
        lines = {name: points for name, points in station.lines.items() if name not in dense}
        proposed = tuple(name for name in station.proposed if name in lines)
        return replace(view, station=replace(station, lines=lines, proposed=proposed))

    def _report_left_out(self, group: Group, view: View, marking: str) -> None:
        station = view.station
        what = f"camera {station.key}" if station.shared else f"view {view.key}"
        count, total = len(station.lines[marking]), count_points(station.lines)
        problem = (
            f"has {count:,} of {total:,} points; the limit of a view is {MAX_POINTS:,}: "
            "this marking is left out"
        )
        self._report.add_problem_at(self._source, group.key, f"{what}, {marking}", problem)


def count_points(lines: Lines) -> int:
    """How many points lines have in all."""
    return sum(map(len, lines.values()))


def _iterate_densest_markings(lines: Lines) -> Iterator[str]:
    """The densest markings, as many as have to go until the others may stay."""
    total = count_points(lines)
    for marking in sorted(lines, key=lambda name: len(lines[name]), reverse=True):
        if total <= MAX_POINTS:
            return
        total -= len(lines[marking])
        yield marking
