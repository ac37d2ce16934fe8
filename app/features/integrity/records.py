"""Whether accounts, roles, solutions and frozen versions are what was written."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence, Set
from dataclasses import dataclass, field
from typing import Any

from app.db.check import CheckResult, compare_with_log, summarize_faulty_records
from app.db.dialects.dialect import get_session_dialect
from app.db.json_columns import decompress_json, parse_json_column, translate_shape_errors_to_damage
from app.db.log import LogEntry, iterate_entries_of_kinds
from app.db.session import Session
from app.db.store import Store
from app.errors import StorageError
from app.features.datasets.queries import parse_stored_policy
from app.features.groups.queries import read_groups
from app.features.people.queries import list_dataset_roles, list_people_rows
from app.features.people.roles import PERSON
from app.features.people.visibility_queries import read_aliases, show_entries_under_aliases
from app.features.solutions.codec import SolutionSummary, summarize_solution
from app.features.solutions.queries import read_summary
from app.features.solutions.stored_queries import (
    check_stored_calibrations,
    check_stored_paint_readings,
    decode_solution_row,
    iterate_solution_row_chunks,
    list_calibration_keys_of_row,
)
from app.features.versions.frozen_queries import (
    SAID,
    SOLUTION,
    collect_shared_keys,
    compute_content_key,
    decode_frozen_json,
    filter_stored_frozen_keys,
    iterate_frozen_batches,
    list_lost_calibrations,
    list_members_without_content,
)
from app.features.versions.queries import (
    VersionRow,
    iterate_version_group_state_rows,
    list_all_versions,
)
from app.features.versions.service import collect_calibration_keys, hash_version
from app.soccer.codec import hash_group_inputs, paint_digests_to_json, policy_from_json
from app.soccer.group import Group
from app.soccer.policy import Policy
from app.soccer.solution import Solution
from app.solving.calibrate import compute_view_calibration_keys
from app.solving.facts import facts_from_bytes

DATASET, DELETED = "dataset", "dataset_deleted"


WRONG = "not as it was written"
_EQUAL = 1e-6
"""Relative; the same figures of another machine may differ in their last digits."""
WRONG_VERSION = "not as it was frozen"


@dataclass
class PeopleSnapshot:
    """The accounts and their roles.

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


def examine_people(session: Session, restore: str) -> list[CheckResult]:
    """Compare accounts, roles in datasets and adopted names with what the log says of them.

    Args:
        session: A read session on a log whose chain is whole.
        restore: What to do where a row is not what was said.
    """
    logged, present = _replay_logged_people(session), _read_present_people(session)
    for key, role in logged.unsure.items():
        if present.roles.get(key) == role:
            logged.roles[key] = role
    parts = {"accounts": "accounts", "roles": "roles in datasets", "shown": "adopted names"}
    return [
        compare_with_log(
            words, getattr(logged, name), getattr(present, name), restore, _format_people_key
        )
        for name, words in parts.items()
    ]


def _read_present_people(session: Session) -> PeopleSnapshot:
    people = list_people_rows(session)
    names = {row.id: row.name for row in people}
    return PeopleSnapshot(
        accounts={row.name: (row.role, bool(row.disabled)) for row in people},
        roles={
            (names[row.person_id], row.dataset_id): row.role for row in list_dataset_roles(session)
        },
        shown=read_aliases(session),
    )


def _replay_logged_people(session: Session) -> PeopleSnapshot:
    people, deleted = PeopleSnapshot(), None
    for entry in iterate_entries_of_kinds(session, [PERSON, DELETED, DATASET]):
        if entry.kind == DELETED:
            _replay_dataset_deletion(people, entry)
        elif entry.kind == DATASET:
            _replay_dataset_creation(people, entry, deleted)
        elif (step := _STEPS.get(entry.body["did"])) is not None:
            step(people, entry, str(entry.body["person"]))
        deleted = entry if entry.kind == DELETED else None
    return people


def _replay_dataset_deletion(people: PeopleSnapshot, deleted: LogEntry) -> None:
    """Roles in a dataset go with it, or to the one that begins afresh in its place."""
    gone = {key: role for key, role in people.roles.items() if key[1] == deleted.dataset_id}
    for name, dataset in gone:
        role, heir = people.roles.pop((name, dataset)), deleted.body.get("heir")
        if heir is not None:
            people.roles[name, heir] = role
        elif "heir" not in deleted.body:
            people.unsure[name, dataset] = role


def _replay_dataset_creation(
    people: PeopleSnapshot, made: LogEntry, deleted: LogEntry | None
) -> None:
    """A dataset that an earlier version made right after it deleted another may have its roles."""
    if deleted is None or made.body["name"] != deleted.body["name"]:
        return
    assert made.dataset_id is not None
    for name, dataset in [key for key in people.unsure if key[1] == deleted.dataset_id]:
        people.unsure[name, made.dataset_id] = people.unsure.pop((name, dataset))


def _replay_account(people: PeopleSnapshot, entry: LogEntry, name: str) -> None:
    _, disabled = people.accounts.get(name, ("", False))
    people.accounts[name] = (entry.body["role"], disabled)


def _replay_account_disabling(people: PeopleSnapshot, entry: LogEntry, name: str) -> None:
    people.accounts[name] = (entry.body["role"], entry.body["did"] == "disabled")


def _replay_role_given(people: PeopleSnapshot, entry: LogEntry, name: str) -> None:
    assert entry.dataset_id is not None
    people.unsure.pop((name, entry.dataset_id), None)
    people.roles[name, entry.dataset_id] = entry.body["role"]


def _replay_role_taken(people: PeopleSnapshot, entry: LogEntry, name: str) -> None:
    assert entry.dataset_id is not None
    people.unsure.pop((name, entry.dataset_id), None)
    people.roles.pop((name, entry.dataset_id), None)


def _replay_name_adoption(people: PeopleSnapshot, entry: LogEntry, name: str) -> None:
    people.shown[entry.body["from"]] = name


_STEPS: Mapping[str, Callable[[PeopleSnapshot, LogEntry, str], None]] = {
    "first admin": _replay_account,
    "invited": _replay_account,
    "came by single sign-on": _replay_account,
    "role": _replay_account,
    "disabled": _replay_account_disabling,
    "enabled": _replay_account_disabling,
    "role in dataset": _replay_role_given,
    "role taken": _replay_role_taken,
    "adopted": _replay_name_adoption,
}
"""What of the words about people changes who there is, and as what."""


def _format_people_key(key: str | tuple[str, int]) -> str:
    return key if isinstance(key, str) else f"{key[0]} in dataset {key[1]}"


def examine_computed_records(session: Session, restore: str) -> list[CheckResult]:
    """Read every calibration, every reading of paint, and every solution of this solver.

    A solution has to be that of its row, and its summary that of its own figures; one that fits its
    group as it is has to be of that group's views, and to rest on what was said of them.

    Args:
        session: A read session.
        restore: What to do where one is not as it was written.
    """
    calibrations, damaged = _count_damaged(check_stored_calibrations(session))
    readings, unread = _count_damaged(check_stored_paint_readings(session))
    solutions, apart = 0, list[str]()
    for rows in iterate_solution_row_chunks(session):
        solutions += len(rows)
        apart += _find_differing_solutions(session, rows, {*damaged})
    return [
        _summarize_damaged_records("calibrations", calibrations, damaged, restore),
        _summarize_damaged_records("readings of paint", readings, unread, restore),
        _summarize_damaged_records("solutions", solutions, apart, restore),
    ]


def _count_damaged(items: Iterable[tuple[str, bool]]) -> tuple[int, list[str]]:
    count, damaged = 0, []
    for key, is_damaged in items:
        count += 1
        if is_damaged:
            damaged.append(key)
    return count, damaged


def _summarize_damaged_records(
    name: str, count: int, apart: Sequence[str], restore: str
) -> CheckResult:
    return summarize_faulty_records(
        name, f"{count:,}, each as it was written", apart, WRONG, restore
    )


def _find_differing_solutions(
    session: Session, rows: Sequence[Any], damaged: Set[str]
) -> Iterator[str]:
    """Names of the solutions that are not as they were written.

    What rests on a damaged calibration cannot be told; the calibration is named by itself.
    """
    groups = _read_undamaged_groups(session, [row.group_id for row in rows if row.current])
    for row in rows:
        try:
            known = damaged.isdisjoint(list_calibration_keys_of_row(row))
            is_whole = not known or _is_solution_unchanged(session, row, groups)
        except StorageError:
            is_whole = False
        if not is_whole:
            yield f"{row.id} of group {row.group_id}"


def _read_undamaged_groups(session: Session, ids: Sequence[int]) -> dict[int, Group]:
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
        if item.inputs_hash
        == hash_group_inputs(item.group, paint_digests_to_json(item.group.paint))
    }


def _is_solution_unchanged(session: Session, row: Any, groups: Mapping[int, Group]) -> bool:
    solution, summary = decode_solution_row(session, row), read_summary(row.summary)
    if row.facts is not None:
        facts_from_bytes([row.facts])
    if not row.current or row.group_id not in groups:
        return True
    group = groups[row.group_id]
    is_theirs = _is_solution_of_group(group, solution, parse_stored_policy(row.policy))
    return is_theirs and _are_equal_summaries(summary, summarize_solution(group, solution))


def _is_solution_of_group(group: Group, solution: Solution, policy: Policy) -> bool:
    """Whether a solution has the views of a group, with cameras of what was said of them."""
    if [view.key for view in group.views] != [view.view for view in solution.views]:
        return False
    return all(
        solved.calibration_key in compute_view_calibration_keys(group, view, policy.calibration)
        for view, solved in zip(group.views, solution.views, strict=True)
    )


def _are_equal_summaries(stored: SolutionSummary, computed: SolutionSummary) -> bool:
    return all(
        math.isclose(ours, theirs, rel_tol=_EQUAL, abs_tol=_EQUAL)
        if isinstance(ours, float) and isinstance(theirs, float)
        else ours == theirs
        for ours, theirs in zip(vars(stored).values(), vars(computed).values(), strict=True)
    )


def examine_versions(store: Store) -> list[CheckResult]:
    """Compare each version with its groups and the log, and each frozen content with its key.

    Whether solutions would come out as they were frozen is what ``verify`` tells.
    """
    with store.read() as session:
        restore = get_session_dialect(session).restoring
        versions = list_all_versions(session)
        apart = [*_find_differing_versions(session, versions)]
        count, changed = _check_frozen_contents(session)
        return [
            summarize_faulty_records(
                "frozen versions", f"{len(versions):,}, as frozen", apart, WRONG_VERSION, restore
            ),
            summarize_faulty_records(
                "frozen content", f"{count:,}, as frozen", changed, WRONG_VERSION, restore
            ),
        ]


def _find_differing_versions(session: Session, versions: Any) -> Iterator[str]:
    """Each version that is not what was frozen, with what is wrong with it."""
    try:
        with translate_shape_errors_to_damage():
            logged = _read_logged_freezes(session)
    except StorageError:
        # Nothing follows from a log that cannot be read, which is named by itself.
        logged = None
    for row in versions:
        entry = None if logged is None else logged.pop(row.id, None)
        why = None
        if logged is not None and not _version_matches_log(row, entry):
            why = "the log says otherwise"
        why = why or _find_version_fault(session, row)
        if why is not None:
            yield f"{row.dataset}/{row.name} ({why})"
    for entry in (logged or {}).values():
        yield f"{entry.body.get('name')} of dataset {entry.dataset_id} (it is gone)"


def _read_logged_freezes(session: Session) -> dict[int, LogEntry]:
    """What the log says of each version by its id, but for datasets that were deleted."""
    found: dict[int, LogEntry] = {}
    entries = iterate_entries_of_kinds(session, ("freeze", "dataset_deleted"))
    for entry in show_entries_under_aliases(session, entries):
        if entry.kind == "freeze":
            found[entry.body["version"]] = entry
        else:
            found = {key: at for key, at in found.items() if at.dataset_id != entry.dataset_id}
    return found


def _version_matches_log(row: VersionRow, entry: LogEntry | None) -> bool:
    if entry is None:
        return False
    logged = (
        entry.dataset_id,
        entry.body.get("name"),
        entry.body.get("hash"),
        entry.at,
        entry.actor,
    )
    return logged == (row.dataset_id, row.name, row.hash, row.created, row.actor)


def _find_version_fault(session: Session, row: VersionRow) -> str | None:
    """What in a version does not follow from its groups; None: all of it does."""
    rows = [item._asdict() for item in iterate_version_group_state_rows(session, row.id)]
    try:
        with translate_shape_errors_to_damage():
            counts, policy = (
                parse_json_column(row.counts),
                policy_from_json(parse_json_column(row.policy)),
            )
            members = sum(item["member"] for item in rows)
            left_out = sum(counts["left_out"].values())
            tracks = parse_json_column(row.tracks) if row.tracks else {}
            found = hash_version(policy, row.solver_version, rows, tracks)
    except StorageError:
        return "it cannot be read"
    if (members, len(rows) - members) != (counts["groups"], left_out):
        return f"{len(rows):,} groups of {counts['groups'] + left_out:,} are there"
    if found != row.hash or policy.hash != row.policy_hash:
        return "its hash does not follow from its groups"
    lost = set(tracks.values()) - filter_stored_frozen_keys(
        session, row.dataset_id, tracks.values()
    )
    if lost:
        return f"{len(lost):,} of its tracks are missing"
    without = list_members_without_content(session, row.id)
    return f"frozen content is missing, of {without[0]} first" if without else None


def _check_frozen_contents(session: Session) -> tuple[int, list[str]]:
    """How many frozen contents there are, and which of them are damaged or missing."""
    count, apart = 0, list_lost_calibrations(session)
    for rows in iterate_frozen_batches(session):
        count += len(rows)
        named: dict[int, set[str]] = {}
        for row in rows:
            try:
                named.setdefault(row.dataset_id, set()).update(
                    _find_referenced_keys(row.key, row.body)
                )
            except StorageError:
                apart.append(row.key)
        for dataset_id, keys in named.items():
            apart += sorted(keys - filter_stored_frozen_keys(session, dataset_id, keys))
    return count, list(dict.fromkeys(apart))


def _find_referenced_keys(key: str, body: bytes | None) -> set[str]:
    """Keys of what a content names.

    Raises:
        DamagedError: The content is not what its key says.
    """
    if body is None:
        return set()
    with translate_shape_errors_to_damage():
        if not key.startswith((SAID, SOLUTION)):
            decompress_json(body)
        if compute_content_key(key, body) != key:
            raise ValueError(f"the key {key} does not match the content stored under it")
        if key.startswith(SAID):
            return collect_shared_keys(decode_frozen_json(body))
        return (
            collect_calibration_keys(decode_frozen_json(body))
            if key.startswith(SOLUTION)
            else set()
        )
