"""Dismissals: a person has checked a finding and says that it is fine, or opens it again."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

from app.errors import InputError
from app.review.editing.copies import require_open
from app.review.editing.etags import require_said, require_unchanged
from app.review.editing.state import GroupState
from app.review.editing.submit import read_solved
from app.soccer.finding import Dismissal, Finding
from app.soccer.reasons import checked_note
from app.store.clock import now
from app.store.dismissals import insert_dismissal
from app.store.queue import read_noticed, refresh_queue
from app.store.store import Store


@dataclass(frozen=True)
class FindingName:
    """What tells a finding of a group from the others; ``number`` where several have the rest."""

    kind: str
    view: str | None = None
    marking: str | None = None
    suggested: str | None = None
    number: float | None = None


def set_dismissal(
    store: Store,
    group_id: int,
    named: FindingName,
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
    note = checked_note(note)
    while True:
        record, solution = read_solved(store, group_id)
        stored, what = record.stored, f"group {record.stored.group.key}"
        before = record.state(solution)
        with store.write() as session:
            policy_hash = require_unchanged(session, group_id, if_match, what)
            require_said(session, group_id, record.said, if_match, what)
            require_open(session, stored.dataset_id, group_id)
            # After the ETag: a person who saw another state is told so first.
            finding = _found(() if before.solution is None else before.solution.findings, named)
            # Under another policy other things may be found.
            if policy_hash == stored.policy.hash:
                said = _said(finding, actor, note)
                insert_dismissal(session, stored.dataset_id, group_id, said, dismissed=dismissed)
                refresh_queue(session, [group_id])
                dismissals = read_noticed(session, [group_id])[1][group_id]
                after = replace(record, dismissals=dismissals).state(solution)
                session.respond(after)
                return after


def _found(findings: Sequence[Finding], named: FindingName) -> Finding:
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


def _said(finding: Finding, actor: str, note: str | None) -> Dismissal:
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
