"""Yield facts: the rows of a ``YieldTable`` as they stand beside the solutions, in chunks."""

from __future__ import annotations

import json
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from app.review.yields.table import EMPTY, YieldTable, join
from app.solving.facts import Facts, group_facts
from app.solving.facts import join as join_facts
from app.solving.facts_codec import facts_from_bytes
from app.store.groups import read_groups
from app.store.session import Session, Store
from app.store.solutions import read_calibrations, solution_facts

CHUNK = 400
"""Groups that are read at once, each chunk from a snapshot of its own."""


@dataclass(frozen=True)
class Wanted:
    """A group whose facts are asked for, and the solution that holds them."""

    group_id: int
    inputs: str
    solution_id: int


def read_facts(store: Store, wanted: Sequence[Wanted]) -> YieldTable:
    """The table of some groups; one whose solution is gone by now is left out."""
    tables = [EMPTY]
    for start in range(0, len(wanted), CHUNK):
        chunk = wanted[start : start + CHUNK]
        with store.read() as session:
            found = dict(_facts(session, chunk))
        there = [item for item in chunk if item.group_id in found]
        if there:
            tables.append(
                YieldTable(
                    np.array([item.group_id for item in there], np.int64),
                    np.array([item.inputs for item in there]),
                    join_facts([found[item.group_id] for item in there]),
                )
            )
    return join(tables)


def _facts(session: Session, wanted: Sequence[Wanted]) -> Iterator[tuple[int, Facts]]:
    """Groups with their facts."""
    rows = solution_facts(session, [item.solution_id for item in wanted])
    yield from _gathered(session, [row for row in rows if row.facts is None])
    for row in rows:
        if row.facts is not None:
            yield row.group_id, facts_from_bytes(row.facts)


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
