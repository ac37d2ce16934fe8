"""Whether accounts, roles and solutions are what was written."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence, Set
from dataclasses import dataclass, field
from typing import Any

from app.db.check import Check, compare_records, compare_with_log
from app.db.log import LogEntry, entries_of_kinds
from app.db.session import Session
from app.errors import StorageError
from app.features.datasets.queries import policy_from_row
from app.features.groups.codecs import paint_to_json
from app.features.groups.digest import group_inputs_hash
from app.features.groups.queries import read_groups
from app.features.people.queries import all_dataset_roles, all_people
from app.features.people.roles import PERSON
from app.features.people.visibility_queries import given_aliases
from app.features.solutions.codec import SolutionSummary, summarize
from app.features.solutions.queries import read_summary
from app.features.solutions.stored_queries import (
    calibration_keys,
    damaged_calibrations,
    damaged_readings,
    decode_row,
    solution_batches,
)
from app.soccer.group import Group
from app.soccer.policy import Policy
from app.soccer.solution import Solution
from app.solving.calibrate import view_keys
from app.solving.facts_codec import facts_from_bytes

DATASET, DELETED = "dataset", "dataset_deleted"


@dataclass
class People:
    """Who there is, and as what.

    Attributes:
        accounts: Role on the server, and whether they are disabled, by name.
        roles: Role in a single dataset, by name and the dataset's id.
        unsure: Such as an earlier version may have moved, which did not say so.
        shown: As whose the work of another actor is shown, by that actor.
    """

    accounts: dict[str, tuple[str, bool]] = field(default_factory=dict)
    roles: dict[tuple[str, int], str] = field(default_factory=dict)
    unsure: dict[tuple[str, int], str] = field(default_factory=dict)
    shown: dict[str, str] = field(default_factory=dict)


def examine_people(session: Session, restore: str) -> list[Check]:
    """Compare accounts, roles in datasets and adopted names with what the log says of them.

    Args:
        session: A read session on a log whose chain is whole.
        restore: What to do where a row is not what was said.
    """
    logged, present = _logged_people(session), _present_people(session)
    for key, role in logged.unsure.items():
        if present.roles.get(key) == role:
            logged.roles[key] = role
    parts = {"accounts": "accounts", "roles": "roles in datasets", "shown": "adopted names"}
    return [
        compare_with_log(
            words, getattr(logged, name), getattr(present, name), restore, _record_name
        )
        for name, words in parts.items()
    ]


def _present_people(session: Session) -> People:
    people = all_people(session)
    names = {row.id: row.name for row in people}
    return People(
        accounts={row.name: (row.role, bool(row.disabled)) for row in people},
        roles={
            (names[row.person_id], row.dataset_id): row.role for row in all_dataset_roles(session)
        },
        shown=given_aliases(session),
    )


def _logged_people(session: Session) -> People:
    people, deleted = People(), None
    for entry in entries_of_kinds(session, [PERSON, DELETED, DATASET]):
        if entry.kind == DELETED:
            _replay_dataset_deletion(people, entry)
        elif entry.kind == DATASET:
            _replay_dataset_creation(people, entry, deleted)
        elif (step := _STEPS.get(entry.body["did"])) is not None:
            step(people, entry, str(entry.body["person"]))
        deleted = entry if entry.kind == DELETED else None
    return people


def _replay_dataset_deletion(people: People, deleted: LogEntry) -> None:
    """Roles in a dataset go with it, or to the one that begins afresh in its place."""
    gone = {key: role for key, role in people.roles.items() if key[1] == deleted.dataset_id}
    for name, dataset in gone:
        role, heir = people.roles.pop((name, dataset)), deleted.body.get("heir")
        if heir is not None:
            people.roles[name, heir] = role
        elif "heir" not in deleted.body:
            people.unsure[name, dataset] = role


def _replay_dataset_creation(people: People, made: LogEntry, deleted: LogEntry | None) -> None:
    """A dataset that an earlier version made right after it deleted another may have its roles."""
    if deleted is None or made.body["name"] != deleted.body["name"]:
        return
    assert made.dataset_id is not None
    for name, dataset in [key for key in people.unsure if key[1] == deleted.dataset_id]:
        people.unsure[name, made.dataset_id] = people.unsure.pop((name, dataset))


def _replay_account(people: People, entry: LogEntry, name: str) -> None:
    _, disabled = people.accounts.get(name, ("", False))
    people.accounts[name] = (entry.body["role"], disabled)


def _replay_disabling(people: People, entry: LogEntry, name: str) -> None:
    people.accounts[name] = (entry.body["role"], entry.body["did"] == "disabled")


def _replay_role_given(people: People, entry: LogEntry, name: str) -> None:
    assert entry.dataset_id is not None
    people.unsure.pop((name, entry.dataset_id), None)
    people.roles[name, entry.dataset_id] = entry.body["role"]


def _replay_role_taken(people: People, entry: LogEntry, name: str) -> None:
    assert entry.dataset_id is not None
    people.unsure.pop((name, entry.dataset_id), None)
    people.roles.pop((name, entry.dataset_id), None)


def _replay_adoption(people: People, entry: LogEntry, name: str) -> None:
    people.shown[entry.body["from"]] = name


_STEPS: Mapping[str, Callable[[People, LogEntry, str], None]] = {
    "first admin": _replay_account,
    "invited": _replay_account,
    "came by single sign-on": _replay_account,
    "role": _replay_account,
    "disabled": _replay_disabling,
    "enabled": _replay_disabling,
    "role in dataset": _replay_role_given,
    "role taken": _replay_role_taken,
    "adopted": _replay_adoption,
}
"""What of the words about people changes who there is, and as what."""


def _record_name(key: str | tuple[str, int]) -> str:
    return key if isinstance(key, str) else f"{key[0]} in dataset {key[1]}"


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
    calibrations, damaged = _count_damaged(damaged_calibrations(session))
    readings, unread = _count_damaged(damaged_readings(session))
    solutions, apart = 0, list[str]()
    for rows in solution_batches(session):
        solutions += len(rows)
        apart += _differing_solutions(session, rows, {*damaged})
    return [
        _check_written_records("calibrations", calibrations, damaged, restore),
        _check_written_records("readings of paint", readings, unread, restore),
        _check_written_records("solutions", solutions, apart, restore),
    ]


def _count_damaged(items: Iterable[tuple[str, bool]]) -> tuple[int, list[str]]:
    count, damaged = 0, []
    for key, is_damaged in items:
        count += 1
        if is_damaged:
            damaged.append(key)
    return count, damaged


def _check_written_records(name: str, count: int, apart: Sequence[str], restore: str) -> Check:
    return compare_records(name, f"{count:,}, each as it was written", apart, WRONG, restore)


def _differing_solutions(session: Session, rows: Sequence[Any], damaged: Set[str]) -> Iterator[str]:
    """Names of the solutions that are not as they were written.

    What rests on a damaged calibration cannot be told; the calibration is named by itself.
    """
    groups = _groups_with_sound_rows(session, [row.group_id for row in rows if row.current])
    for row in rows:
        try:
            known = damaged.isdisjoint(calibration_keys(row))
            is_whole = not known or _is_as_written(session, row, groups)
        except StorageError:
            is_whole = False
        if not is_whole:
            yield f"{row.id} of group {row.group_id}"


def _groups_with_sound_rows(session: Session, ids: Sequence[int]) -> dict[int, Group]:
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


def _is_as_written(session: Session, row: Any, groups: Mapping[int, Group]) -> bool:
    solution, summary = decode_row(session, row), read_summary(row.summary)
    if row.facts is not None:
        facts_from_bytes([row.facts])
    if not row.current or row.group_id not in groups:
        return True
    group = groups[row.group_id]
    is_theirs = _fits_group(group, solution, policy_from_row(row.policy))
    return is_theirs and _are_equal_values(summary, summarize(group, solution))


def _fits_group(group: Group, solution: Solution, policy: Policy) -> bool:
    """Whether a solution has the views of a group, with cameras of what was said of them."""
    if [view.key for view in group.views] != [view.view for view in solution.views]:
        return False
    return all(
        solved.calibration_key in view_keys(group, view, policy.calibration)
        for view, solved in zip(group.views, solution.views, strict=True)
    )


def _are_equal_values(stored: SolutionSummary, computed: SolutionSummary) -> bool:
    return all(
        math.isclose(ours, theirs, rel_tol=_EQUAL, abs_tol=_EQUAL)
        if isinstance(ours, float) and isinstance(theirs, float)
        else ours == theirs
        for ours, theirs in zip(vars(stored).values(), vars(computed).values(), strict=True)
    )
