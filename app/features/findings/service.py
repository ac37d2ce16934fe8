"""Findings of a whole dataset, and checking one off."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import asdict, dataclass, replace
from typing import Any

from app.db.session import now
from app.db.store import Store
from app.errors import InputError
from app.features.datasets.service import dataset_id
from app.features.findings.queries import insert_dismissal, read_import_findings_and_dismissals
from app.features.groups.state import (
    GroupState,
    read_states,
    require_unchanged,
    require_unchanged_content,
)
from app.features.groups.submit import ensure_group_solution, require_group_open
from app.features.queue.queries import (
    Condition,
    GroupListing,
    RowOrder,
    any_condition,
    compare_condition,
    contains_text_condition,
    has_list_item,
)
from app.features.queue.refresh_queries import refresh_queue
from app.features.solutions.queries import is_group_solved
from app.soccer.finding import Dismissal, Finding
from app.soccer.group import Group, strip_and_check_note

BATCH = 100


@dataclass(frozen=True)
class GroupFindings:
    """What was found in one group."""

    group_id: int
    number: int
    group: Group
    findings: tuple[Finding, ...]
    dismissed: tuple[Dismissal | None, ...]
    """Of each finding: who has checked it; None: nobody."""

    @property
    def findings_as_json(self) -> list[dict[str, Any]]:
        """The findings as plain values, each with the key of the group."""
        return [
            {
                "kind": finding.kind,
                "group": self.group.key,
                **asdict(finding),
                "dismissed": None
                if dismissal is None
                else {"by": dismissal.actor, "at": dismissal.at, "note": dismissal.note},
            }
            for finding, dismissal in zip(self.findings, self.dismissed, strict=True)
        ]


def count_groups(
    store: Store, dataset_id: int, kind: str | None, *, dismissed: bool | None = None
) -> int:
    """How many groups of a dataset have findings, of a kind, open or dismissed, where these are named."""
    with store.read() as session:
        return GroupListing(session, dataset_id, _finding_conditions(kind, dismissed)).count()


def read_findings(
    store: Store,
    dataset_id: int,
    *,
    after: int = 0,
    limit: int,
    kind: str | None = None,
    dismissed: bool | None = None,
) -> list[GroupFindings]:
    """Findings of up to ``limit`` groups, by number of the group, from the one after ``after``.

    ``dismissed`` names those that people have checked (True) or have not (False); None: all.
    """
    with store.read() as session:
        where = [*_finding_conditions(kind, dismissed), compare_condition("number", ">", after)]
        ids = GroupListing(session, dataset_id, where).ids(RowOrder("number"), limit)
        states = read_states(session, ids)
    return [_collect_group_findings(state, kind, dismissed) for state in states]


def iterate_findings_as_json(store: Store, dataset: str) -> Iterator[dict[str, Any]]:
    """Every finding of a dataset as plain values, in batches, so that memory does not grow."""
    found, after = dataset_id(store, dataset), 0
    while groups := read_findings(store, found, after=after, limit=BATCH):
        after = groups[-1].number
        for group in groups:
            yield from group.findings_as_json


def _finding_conditions(kind: str | None, dismissed: bool | None) -> list[Condition]:
    """What holds of groups with findings that can be read: those of an earlier solver cannot."""
    columns = {None: ("findings", "dismissed"), False: ("findings",), True: ("dismissed",)}
    has = any_condition(
        contains_text_condition(column, ",") if kind is None else has_list_item(column, kind)
        for column in columns[dismissed]
    )
    return [has, is_group_solved()]


def _collect_group_findings(
    state: GroupState, kind: str | None, dismissed: bool | None
) -> GroupFindings:
    found = state.solution.findings if state.solution is not None else ()
    chosen = [
        (item, dismissal)
        for item, dismissal in zip(found, state.dismissed, strict=True)
        if (kind is None or item.kind == kind)
        and (dismissed is None or dismissed == (dismissal is not None))
    ]
    findings, checked = (
        tuple(item for item, _ in chosen),
        tuple(dismissal for _, dismissal in chosen),
    )
    return GroupFindings(state.id, state.number, state.group, findings, checked)


@dataclass(frozen=True)
class FindingReference:
    """What tells a finding of a group from the others; ``number`` where several have the rest."""

    kind: str
    view: str | None = None
    marking: str | None = None
    suggested: str | None = None
    number: float | None = None


def set_dismissal(
    store: Store,
    group_id: int,
    named: FindingReference,
    *,
    dismissed: bool,
    note: str | None = None,
    if_match: str,
    actor: str,
) -> GroupState:
    """Dismiss a finding of a group, or open one again; the group is what it was.

    A dismissed finding stands again once it says something else (``Dismissal.covers``).

    Args:
        store: The database.
        group_id: The group.
        named: The finding.
        dismissed: False: it is to be looked at again.
        note: Why it is fine.
        if_match: ETag of the group that the person saw.
        actor: Who says so.

    Raises:
        InputError: The group has no such finding.
        StaleRevisionError: The group is not what the person saw.
    """
    note = strip_and_check_note(note)
    while True:
        record, solution = ensure_group_solution(store, group_id)
        stored, what = record.stored, f"group {record.stored.group.key}"
        before = record.make_state(solution)
        with store.write() as session:
            policy_hash = require_unchanged(session, group_id, if_match, what)
            require_unchanged_content(
                session, group_id, record.content_part_of_etag, if_match, what
            )
            require_group_open(session, stored.dataset_id, group_id)
            # After the ETag: a person who saw another state is told so first.
            finding = _find_named_finding(
                () if before.solution is None else before.solution.findings, named
            )
            # Under another policy other things may be found.
            if policy_hash == stored.policy.hash:
                dismissal = _make_dismissal(finding, actor, note)
                insert_dismissal(
                    session, stored.dataset_id, group_id, dismissal, dismissed=dismissed
                )
                refresh_queue(session, [group_id])
                dismissals = read_import_findings_and_dismissals(session, [group_id])[1][group_id]
                after = replace(record, dismissals=dismissals).make_state(solution)
                session.respond(after)
                return after


def _find_named_finding(findings: Sequence[Finding], named: FindingReference) -> Finding:
    """The finding that is meant; of several, the one with the nearest number."""
    names = (named.kind, named.view, named.marking, named.suggested)
    fitting = [one for one in findings if (one.kind, one.view, one.marking, one.suggested) == names]
    if not fitting:
        raise InputError(
            f'the group has no finding "{named.kind}" of that view and marking',
            hint="Send kind, view, marking and suggested as the group's solution has them.",
            pointer="/kind",
        )
    number = named.number
    if number is None:
        return fitting[0]
    return min(fitting, key=lambda one: abs((one.number or 0.0) - number))


def _make_dismissal(finding: Finding, actor: str, note: str | None) -> Dismissal:
    return Dismissal(
        finding.kind,
        finding.view,
        finding.marking,
        finding.suggested,
        finding.number,
        finding.sentence,
        actor,
        now(),
        note,
    )
