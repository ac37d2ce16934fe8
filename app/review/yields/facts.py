"""Yield facts: tables of groups as their facts stand beside the solutions."""

from __future__ import annotations

import json
from collections.abc import Iterator, Sequence
from typing import Any

from app.review.yields.table import YieldTable, join, table_of
from app.solving.facts import NOTHING, Facts, group_facts
from app.solving.facts_codec import facts_from_bytes, facts_to_bytes
from app.store.groups import read_groups
from app.store.session import Session
from app.store.solutions import read_calibrations, solution_facts

CHUNK = 400
"""Groups that are read at once."""


def read_tables(session: Session, rows: Sequence[Any]) -> tuple[YieldTable, YieldTable]:
    """The table of the groups that are solved, and that of the others.

    Args:
        session: A read session.
        rows: As ``groups_from`` returns them in the same session.
    """
    solved, others = [], []
    tables = []
    for start in range(0, len(rows), CHUNK):
        chunk = rows[start : start + CHUNK]
        found = _facts(session, [row.solution_id for row in chunk if row.solution_id is not None])
        solved = [row for row in chunk if row.group_id in found]
        others += [row for row in chunk if row.group_id not in found]
        tables.append(table_of(solved, facts_from_bytes([found[row.group_id] for row in solved])))
    return join([table_of([], NOTHING), *tables]), table_of(others, NOTHING)


def _facts(session: Session, solution_ids: Sequence[int]) -> dict[int, bytes]:
    """Facts of solutions, by group."""
    rows = solution_facts(session, solution_ids)
    found = {row.group_id: row.facts for row in rows if row.facts is not None}
    bare = [row for row in rows if row.facts is None]
    found.update((group, facts_to_bytes(facts)) for group, facts in _gathered(session, bare))
    return found


def _gathered(session: Session, rows: Sequence[Any]) -> Iterator[tuple[int, Facts]]:
    """Facts of solutions from before they were kept, where they still fit their group."""
    keys = {row.group_id: json.loads(row.calibrations) for row in rows}
    calibrations = read_calibrations(session, {key for names in keys.values() for key in names})
    groups = read_groups(session, list(keys), extras=False)
    for row in rows:
        stored = groups.get(row.group_id)
        if stored is not None and stored.inputs_hash == row.inputs_hash:
            found = [calibrations[key] for key in keys[row.group_id]]
            yield row.group_id, group_facts(stored.group.views, found)
