"""Whether what was computed is what was written, told without solving anything anew."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Mapping, Sequence, Set
from typing import Any

from app.errors import StorageError
from app.review.doctor.check import Check, compared
from app.soccer.group import Group
from app.soccer.policy import Policy
from app.soccer.solution import Solution
from app.solving.calibrate import view_keys
from app.solving.facts_codec import facts_from_bytes
from app.store.codecs import paint_to_json
from app.store.datasets import policy_of
from app.store.digest import group_inputs_hash
from app.store.groups import read_groups
from app.store.session import Session
from app.store.solutions import read_summary
from app.store.stored_solutions import (
    calibrations_of,
    damaged_calibrations,
    damaged_readings,
    decode_row,
    solution_batches,
)
from app.store.summary import SolutionSummary, summarize

WRONG = "not as it was written"
_EQUAL = 1e-6
"""Relative; the same figures of another machine may differ in their last digits."""


def examine_computed(session: Session, restore: str) -> list[Check]:
    """Read every calibration, every reading of paint, and every solution of this solver.

    A solution has to be that of its row, and its summary that of its own figures; one that fits its
    group as it is has to be of that group's views, and to rest on what was said of them.

    Args:
        session: A read session.
        restore: What to do where one is not as it was written.
    """
    calibrations, damaged = _damaged(damaged_calibrations(session))
    readings, unread = _damaged(damaged_readings(session))
    solutions, apart = 0, list[str]()
    for rows in solution_batches(session):
        solutions += len(rows)
        apart += _apart(session, rows, {*damaged})
    return [
        _told("calibrations", calibrations, damaged, restore),
        _told("readings of paint", readings, unread, restore),
        _told("solutions", solutions, apart, restore),
    ]


def _damaged(items: Iterable[tuple[str, bool]]) -> tuple[int, list[str]]:
    count, damaged = 0, []
    for key, is_damaged in items:
        count += 1
        if is_damaged:
            damaged.append(key)
    return count, damaged


def _told(name: str, count: int, apart: Sequence[str], restore: str) -> Check:
    return compared(name, f"{count:,}, each as it was written", apart, WRONG, restore)


def _apart(session: Session, rows: Sequence[Any], damaged: Set[str]) -> Iterator[str]:
    """Names of the solutions that are not as they were written.

    What rests on a damaged calibration cannot be told; the calibration is named by itself.
    """
    groups = _groups(session, [row.group_id for row in rows if row.current])
    for row in rows:
        try:
            known = damaged.isdisjoint(calibrations_of(row))
            is_whole = not known or _is_whole(session, row, groups)
        except StorageError:
            is_whole = False
        if not is_whole:
            yield f"{row.id} of group {row.group_id}"


def _groups(session: Session, ids: Sequence[int]) -> dict[int, Group]:
    """Groups of which a solution can be told to be theirs: what their rows say is what they hash.

    None where a row cannot be read: that is a fault of the tables.
    """
    try:
        found = read_groups(session, ids, extras=False)
    except StorageError:
        return {}
    return {
        key: item.group
        for key, item in found.items()
        if item.inputs_hash == group_inputs_hash(item.group, paint_to_json(item.group.paint))
    }


def _is_whole(session: Session, row: Any, groups: Mapping[int, Group]) -> bool:
    solution, summary = decode_row(session, row), read_summary(row.summary)
    if row.facts is not None:
        facts_from_bytes([row.facts])
    if not row.current or row.group_id not in groups:
        return True
    group = groups[row.group_id]
    is_theirs = _is_of(group, solution, policy_of(row.policy))
    return is_theirs and _agree(summary, summarize(group, solution))


def _is_of(group: Group, solution: Solution, policy: Policy) -> bool:
    """Whether a solution has the views of a group, with cameras of what was said of them."""
    if [view.key for view in group.views] != [view.view for view in solution.views]:
        return False
    return all(
        solved.calibration_key in view_keys(group, view, policy.calibration)
        for view, solved in zip(group.views, solution.views, strict=True)
    )


def _agree(stored: SolutionSummary, computed: SolutionSummary) -> bool:
    return all(
        math.isclose(ours, theirs, rel_tol=_EQUAL, abs_tol=_EQUAL)
        if isinstance(ours, float) and isinstance(theirs, float)
        else ours == theirs
        for ours, theirs in zip(vars(stored).values(), vars(computed).values(), strict=True)
    )
