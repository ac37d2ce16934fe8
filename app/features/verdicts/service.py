"""Accept, reject with a reason, defer, or withdraw a verdict; and who has judged how much."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import get_args

from app.db.session import Session, now
from app.db.store import Store
from app.errors import ConflictError, InputError
from app.features.agreement.queries import OPEN, read_agreement_states
from app.features.groups.queries import StoredGroup
from app.features.groups.state import GroupState, require_unchanged, require_unchanged_content
from app.features.groups.submit import ensure_group_solution
from app.features.queue.queries import count_reviewed_by_person_and_status
from app.features.queue.refresh_queries import update_row_verdict
from app.features.verdicts.queries import (
    StoredVerdict,
    count_groups_by_judge,
    find_next_verdict_id,
    insert_verdicts_and_end_work,
)
from app.json_text import Moment
from app.soccer.choices import VerdictState
from app.soccer.group import REASONS, Group, require_exclusion_note, strip_and_check_note
from app.soccer.solution import Solution

STATES: tuple[str, ...] = get_args(VerdictState)


@dataclass(frozen=True)
class Verdict:
    """A verdict as it is given, checked."""

    state: str
    reason: str | None
    note: str | None


def set_verdict(
    store: Store,
    group_id: int,
    state: str,
    reason: str | None = None,
    note: str | None = None,
    *,
    if_match: str,
    actor: str,
) -> GroupState:
    """Save a person's verdict on a group as it is; the newest of all people's counts.

    Accepting a group that fails a gate overrides the policy: it needs a note, which goes into
    the export. So does accepting a ball that cannot be used (below the grass, known to metres
    only), and a group without any picture: nobody can have looked at it.

    Raises:
        InputError: Unknown state or reason, or a note is missing.
        StaleRevisionError: The group is not what the person saw.
        ForbiddenError: It is somebody else's independent annotation.
        ConflictError: It is an independent annotation that was submitted, or the group waits for a
            decision between annotations that differ.
    """
    verdict = check_verdict(state, reason, note)
    while True:
        # Accepting weighs the gates, so they must be known.
        record, solution = ensure_group_solution(store, group_id, needed=state == "accepted")
        stored, what = record.stored, f"group {record.stored.group.key}"
        override = _overridden_gate(solution, verdict)
        _require_usable_ball(solution, verdict)
        _require_picture_to_accept(stored.group, verdict)
        with store.write() as session:
            policy_hash = require_unchanged(session, group_id, if_match, what)
            require_unchanged_content(
                session, group_id, record.content_part_of_etag, if_match, what
            )
            _require_decided(session, stored, verdict)
            # Under another policy other gates may fail.
            if policy_hash == stored.policy.hash:
                given = _make_verdict(session, stored, verdict, override, actor)
                insert_verdicts_and_end_work(
                    session, stored.dataset_id, [given], actor=actor, at=given.at
                )
                passes = None if solution is None else solution.passes
                update_row_verdict(session, stored, given, passes)
                after = replace(record, verdicts=(given, *record.verdicts)).make_state(solution)
                session.respond(after)
                return after


def check_verdict(state: str, reason: str | None, note: str | None) -> Verdict:
    """A verdict from what was sent.

    Raises:
        InputError: Unknown state or reason, or a note is missing or too long.
    """
    note = strip_and_check_note(note)
    if state not in STATES:
        known = ", ".join(STATES)
        raise InputError(f'"{state}" is not a verdict; verdicts are {known}', pointer="/state")
    if state != "rejected" and reason is not None:
        raise InputError("only a rejection has a reason", pointer="/reason")
    if state == "rejected" and reason not in REASONS:
        known = ", ".join(REASONS)
        raise InputError(f"a rejection needs a reason: {known}", pointer="/reason")
    require_exclusion_note(reason, note)
    return Verdict(state, reason, note)


def _overridden_gate(solution: Solution | None, verdict: Verdict) -> str | None:
    """The gate that an acceptance overrides, or None."""
    if verdict.state != "accepted" or solution is None or solution.passes:
        return None
    gate = solution.first_failing
    if verdict.note is None:
        sentence = gate.sentence if gate is not None else "it fails"
        raise InputError(
            f"this group fails a gate ({sentence}); accepting it needs a note that says why",
            hint="The note goes into the export as the reason of the override.",
            pointer="/note",
        )
    return gate.name if gate is not None else "unknown"


def _require_usable_ball(solution: Solution | None, verdict: Verdict) -> None:
    """Refuse a bare acceptance of a group whose ball nobody can use, though it passes."""
    found = None if solution is None else solution.unusable_ball_finding
    if verdict.state == "accepted" and verdict.note is None and found is not None:
        raise InputError(
            f"the ball of this group cannot be used ({found.sentence.rstrip('.')}); accepting it "
            "needs a note that says why",
            hint="Correct the ball or leave a view out, or say in the note why it is right.",
            pointer="/note",
        )


def _require_picture_to_accept(group: Group, verdict: Verdict) -> None:
    """Refuse a bare acceptance of a group that nobody can have looked at."""
    seen = any(view.media is not None for view in group.views)
    if verdict.state == "accepted" and verdict.note is None and not seen:
        raise InputError(
            "this group has no picture in any view; accepting it needs a note that says what it "
            "was judged by",
            hint="Import it again with its frames, or say in the note why it is right.",
            pointer="/note",
        )


def _require_decided(session: Session, stored: StoredGroup, verdict: Verdict) -> None:
    """Refuse a verdict that would pass over annotations that differ; withdrawing one is allowed."""
    if verdict.state == "unreviewed":
        return
    if read_agreement_states(session, [stored.id]).get(stored.id) == OPEN:
        raise ConflictError(
            "the independent annotations of this group differ, and nobody has decided yet",
            hint=f"Decide between them first: /adjudicate/{stored.id}",
        )


def _make_verdict(
    session: Session, stored: StoredGroup, verdict: Verdict, override: str | None, actor: str
) -> StoredVerdict:
    return StoredVerdict(
        id=find_next_verdict_id(session),
        group_id=stored.id,
        actor=actor,
        at=now(),
        **vars(verdict),
        inputs_hash=stored.inputs_hash,
        policy_hash=stored.policy.hash,
        fixed=stored.edited and verdict.state == "accepted" and override is None,
        override=override,
    )


@dataclass(frozen=True)
class Reviewer:
    """One person's verdicts.

    Attributes:
        accepted: Groups whose verdict counts and is this person's, like ``rejected`` and
            ``deferred``.
        today: Groups that this person has judged since midnight UTC.
        last: Time of this person's last verdict.
    """

    name: str
    accepted: int
    rejected: int
    deferred: int
    today: int
    last: Moment


def list_reviewers(store: Store, dataset_id: int) -> list[Reviewer]:
    """Everybody who has judged a group of a dataset, the most active first."""
    with store.read() as session:
        people = count_groups_by_judge(session, dataset_id, since=now()[:10])
        counts = count_reviewed_by_person_and_status(session, dataset_id)
    reviewers = [
        Reviewer(
            name=row.actor,
            today=row.groups,
            last=row.last,
            **{
                status: counts.get((row.actor, status), 0)
                for status in ("accepted", "rejected", "deferred")
            },
        )
        for row in people
    ]
    return sorted(
        reviewers, key=lambda item: (-item.accepted - item.rejected - item.deferred, item.name)
    )
