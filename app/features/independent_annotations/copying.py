"""Copying: a group as it was, into the dataset of somebody's copies, through the log."""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass, replace
from itertools import count

from app.db.log import LogEntry, list_group_entries
from app.db.session import Session
from app.features.datasets.queries import find_dataset, parse_stored_policy
from app.features.datasets.service import insert_dataset, save_policy
from app.features.groups.edit import SetPaintReadings
from app.features.groups.edit_codec import edit_from_json
from app.features.groups.queries import StoredGroup
from app.features.groups.reimport import SharedStations
from app.features.imports.ingest import ImportContext, insert_new_groups
from app.features.imports.queries import find_newest_imports, list_shared_stations
from app.features.independent_annotations.queries import (
    BARE,
    IMPORTED,
    CopyDatasetKey,
    find_copy_dataset,
    read_gold_start,
)
from app.features.paint.queries import PAINT, insert_paint_readings, read_paint_readings
from app.soccer.codec import hash_imported_group, view_from_json
from app.soccer.group import Group, Station, View

SOURCE = "copy"
"""What the log calls the source of a copy."""
_NAME = 60
"""Letters of a dataset's name that the name of its copies begins with."""
_LONGEST = 88
_OTHER = re.compile(r"[^\w. -]")
_BACK = frozenset({"edit", "undo", "redo", "pitch", "position", "noise", PAINT})


@dataclass(frozen=True)
class CopyRequest:
    """A copy that is wanted: of what, for which batch, for whom, and how it is called.

    ``name`` None: as the original is.
    """

    original: StoredGroup
    batch_id: int | None
    person: str
    name: str | None


def copy_group(session: Session, order: CopyRequest, start: Group) -> int:
    """Insert a copy of a group, as ``start`` has it, into its person's dataset; returns its id.

    Frames are named, not copied; lines, balls, given cameras, what is known of the match and what
    was read of the paint are the copy's own from then on.
    """
    dataset_id = _ensure_copy_dataset(session, order)
    # Static cameras that a copy is there of already are as their person left them.
    own = {item.station.key: item.station for item in list_shared_stations(session, dataset_id)}
    group = replace(start, views=tuple(_replace_view_station(view, own) for view in start.views))
    if order.name is not None:
        group = _hide_names(group, order.name)
    insert_paint_readings(session, dataset_id, group.paint.values())
    shared = SharedStations(session, dataset_id, SOURCE, order.person)
    shared.insert_or_update(view.station for view in group.views if view.station.key not in own)
    origin = ImportContext(dataset_id, SOURCE, order.person)
    (copy_id,) = insert_new_groups(
        session, origin, [(group, hash_imported_group(group))], shared.ids
    )
    return copy_id


def make_gold_group_start(session: Session, stored: StoredGroup) -> Group:
    """A gold group as its own start says, before it is stripped as all copies of the batch are."""
    if read_gold_start(session, stored.id) == IMPORTED:
        return _rebuild_imported_group(session, stored)
    return stored.group


def strip_to_gold_start(group: Group, start: str) -> Group:
    """A group without what annotators of a batch with gold groups draw themselves.

    Every copy of such a batch is stripped alike, ordinary ones too: else what a copy begins with
    tells what it is of.
    """
    bare = start == BARE
    group = replace(
        group, views=tuple(_strip_view_to_gold_start(view, start) for view in group.views)
    )
    if start == IMPORTED:
        return replace(group, paint={}, positions={})
    return replace(group, paint={} if bare else group.paint)


def rebuild_group_before_edits(
    session: Session, stored: StoredGroup, since: str, *, before: int | None = None
) -> Group:
    """A group without its edits from a time on, back to the import before, the last one first.

    ``before``: ``stored`` is as it was before this entry of the log; None: as it is now.
    """
    group = stored.group
    for entry in reversed(list_group_entries(session, stored.id, verdicts=False)):
        if before is not None and entry.id >= before:
            continue
        if entry.at < since:
            break
        if entry.kind == "import":
            break
        if entry.kind in _BACK:
            group = _undo_entry(session, entry, group)
    return group


def _undo_entry(session: Session, entry: LogEntry, group: Group) -> Group:
    inverse = entry.body["inverse"]
    if inverse["edit"] == "set_paint":
        read = read_paint_readings(session, inverse["paint"].values())
        return SetPaintReadings({view: read[key] for view, key in inverse["paint"].items()}).apply(
            group
        )
    return edit_from_json(inverse).apply(group)


def _rebuild_imported_group(session: Session, stored: StoredGroup) -> Group:
    """The group as its dataset brought it last, without what people said since.

    Static cameras are as they are: the labels of one picture are not theirs alone.
    """
    (entry,) = find_newest_imports(session, [stored.id])
    body = entry.body["base"] or entry.body["group"]
    present = {view.key: view for view in stored.group.views}
    views = []
    for value in body["views"]:
        now = present.get(value["key"])
        shared = now.station if now and isinstance(value["station"], str) else None
        view = view_from_json(value, shared)
        if now is not None:
            # Which views are left out, and how noisy they are, copies of other groups have, too.
            view = replace(view, included=now.included, left_out=now.left_out, noise=now.noise)
        views.append(view)
    return replace(stored.group, views=tuple(views))


def _strip_view_to_gold_start(view: View, start: str) -> View:
    station = view.station
    if start == BARE and not station.shared:
        station = replace(station, lines={}, proposed=(), not_visible=())
    return replace(view, station=station, balls=view.balls if start == IMPORTED else ())


def _replace_view_station(view: View, own: dict[str, Station]) -> View:
    station = own.get(view.station.key) if view.station.shared else None
    return view if station is None else replace(view, station=station)


def rename_views_as_original(original: Group, copy: Group) -> Group:
    """A copy under the names that its views have in the original; they are in the same order."""
    if all(original.view(view.key) is not None for view in copy.views):
        return copy
    names = [view.key for view in original.views]
    return _rename_views(copy, dict(zip((view.key for view in copy.views), names, strict=False)))


def _hide_names(group: Group, name: str) -> Group:
    """A group that does not say which one it is: names of views hold that of their group."""
    names = {view.key: f"view {place}" for place, view in enumerate(group.views, 1)}
    group = _rename_views(group, names)
    views = tuple(
        view
        if view.station.shared
        else replace(view, station=replace(view.station, key=f"{name}/{view.key}"))
        for view in group.views
    )
    label = f"Group {name.rpartition('-')[2]}"
    return replace(group, key=name, label=label, match="", split="", views=views)


def _rename_views(group: Group, names: Mapping[str, str]) -> Group:
    """A group whose views have other keys."""
    return replace(
        group,
        views=tuple(replace(view, key=names.get(view.key, view.key)) for view in group.views),
        positions={names.get(key, key): at for key, at in group.positions.items()},
        paint={names.get(key, key): read for key, read in group.paint.items()},
    )


def _ensure_copy_dataset(session: Session, order: CopyRequest) -> int:
    """Id of the dataset of somebody's copies, which the first of them makes."""
    stored = order.original
    copies = CopyDatasetKey(stored.dataset_id, order.batch_id or 0, order.person)
    row = find_copy_dataset(session, copies)
    if row is None:
        name = _find_free_name(
            session, f"{stored.dataset[:_NAME]} {copies.batch_id} {order.person}"
        )
        return insert_dataset(session, name, stored.policy, order.person, copies)
    held = find_dataset(session, row.dataset_id)
    if held is not None and parse_stored_policy(held.policy) != stored.policy:
        save_policy(session, row.dataset_id, stored.policy, order.person)
    return row.dataset_id


def _find_free_name(session: Session, wanted: str) -> str:
    """A name that a dataset can have and none has; those of scripts hold other letters, too."""
    plain = _OTHER.sub("-", wanted)[:_LONGEST].strip()
    names = (plain if n == 1 else f"{plain} copy {n}" for n in count(1))
    return next(name for name in names if find_dataset(session, name) is None)
