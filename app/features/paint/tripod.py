"""Tripod: what the main cameras of a match, each on its paint, know together of the pitch that they show."""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping

from app.db.store import Store
from app.features.datasets.service import DatasetHead
from app.features.groups.edit import SetPaintReadings
from app.features.groups.group_edits import edit_groups
from app.features.groups.queries import StoredGroup, read_groups
from app.features.paint.queries import PAINT, count_paint_by_match, insert_paint_readings
from app.soccer.paint_evidence import PaintReading
from app.solving.match_tripod import add_match_tripod_to_readings


def solve_match_tripods(
    store: Store,
    dataset: DatasetHead,
    matches: Collection[str] | None,
    actor: str,
    run: str,
    require_wanted: Callable[[], None] | None,
) -> None:
    """Give the main cameras of each match what they know together; groups without a match share none.

    Args:
        store: The database.
        dataset: Whose paint was read.
        matches: By name; None: all.
        actor: Who wants it.
        run: Name of the reading, with which it is taken back.
        require_wanted: Called in each transaction that gives something, before it does.
    """
    with store.read() as session:
        items = [
            item
            for item in count_paint_by_match(session, dataset.id)
            if item.match and item.painted
        ]
    for item in items:
        if matches is not None and item.match not in matches:
            continue
        with store.read() as session:
            groups = {it.id: it.group for it in read_groups(session, item.painted).values()}
        before = {number: group.paint.get(group.views[0].key) for number, group in groups.items()}
        after = add_match_tripod_to_readings(groups, dataset.policy.calibration)
        changed = {number: read for number, read in after.items() if read != before[number]}
        if not changed:
            continue

        def make_paint_edits(
            some: Mapping[int, StoredGroup],
            before: Mapping[int, PaintReading | None] = before,
            changed: Mapping[int, PaintReading] = changed,
        ) -> dict[int, SetPaintReadings]:
            # What was drawn and read meanwhile says something else.
            return {
                number: SetPaintReadings({**stored.group.paint, key: changed[number]})
                for number, stored in some.items()
                if stored.group.paint.get(key := stored.group.views[0].key) == before[number]
            }

        with store.write() as session:
            if require_wanted is not None:
                require_wanted()
            insert_paint_readings(session, dataset.id, changed.values())
            where = (session, dataset.id, PAINT, sorted(changed), make_paint_edits)
            edit_groups(*where, actor=actor, body={"run": run})
