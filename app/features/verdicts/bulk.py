"""Bulk: one verdict for every group that a query matches, tried first.

A batch is many short write transactions, so that others go on working; killed in between it
leaves whole verdicts, and given again it does the rest (under the same key as the same batch).
``bulk_undo`` takes it back, which ends a run that is still giving it, and its ``redo_bulk_verdict`` gives it
once more after that.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from typing import Any

from app.db.idempotency import read_progress, save_progress
from app.db.log import NewLogEntry, append_entries
from app.db.session import Session, now
from app.db.store import Store
from app.errors import ConflictError
from app.features.agreement.queries import list_undecided_groups
from app.features.independent_annotations.queries import list_closed_copies
from app.features.people.visibility_queries import COPIES, sees_independent_work
from app.features.queue.fields import query_reveals_hidden_work
from app.features.queue.queries import GroupListing, read_columns_of_groups
from app.features.queue.query import MAX_LISTED_LENGTH, parse_query
from app.features.queue.refresh_queries import filter_edited_groups, refresh_verdict_columns
from app.features.solutions.queries import list_unsolved_groups, read_current_solution_keys
from app.features.verdicts.queries import (
    Spans,
    StoredBulkVerdict,
    StoredVerdict,
    append_span,
    find_bulk_verdict,
    find_next_verdict_id,
    insert_bulk_verdict,
    insert_verdicts_and_end_work,
    read_bulk_verdicts,
    split_spans,
    update_bulk_verdict,
)
from app.features.verdicts.service import Verdict, check_verdict
from app.soccer.finding import has_unusable_ball
from app.wording import plural

CHUNK = 100
"""Groups a transaction: two or three hundredths of a second, for which others wait to write."""
SAMPLE = 5
SUBMITTED, UNDECIDED, UNSOLVED, NEEDS_NOTE, UNUSABLE_BALL, NO_PICTURE = (
    "submitted", "undecided", "unsolved", "needs_note", "unusable_ball", "no_picture",
)  # fmt: skip
"""Why a group is left alone: it is an independent annotation that was submitted, or its independent
annotations differ and nobody has decided, or its gates are not known to this solver, or it fails one, or its ball cannot be used, or no view of it has a
picture, and nobody says why it shall be accepted all the same."""


@dataclass(frozen=True)
class RefusedGroups:
    """Groups that a bulk verdict leaves alone.

    Attributes:
        reason: ``submitted`` (independent annotations that are closed), ``undecided`` (their
            independent annotations differ), ``unsolved``, ``needs_note`` (they fail a gate), ``unusable_ball`` or ``no_picture``.
    """

    reason: str
    groups: int


@dataclass(frozen=True)
class ReplacedVerdicts:
    """Groups that would change and have another verdict (``state``, or its reason) until then."""

    state: str
    groups: int


@dataclass(frozen=True)
class AffectedGroup:
    """A group that would change, with the number and label that the queue shows."""

    id: int
    key: str
    number: int
    label: str


@dataclass(frozen=True)
class BulkPlan:
    """What a bulk verdict would do.

    Attributes:
        matches: Groups that the query finds.
        would_change: Those that would get the verdict.
        unchanged: Those that have it already.
        replaced: What verdicts ``would_change`` replaces, by state.
        sample: The first of those that would change.
    """

    matches: int
    would_change: int
    unchanged: int
    replaced: tuple[ReplacedVerdicts, ...]
    refused: tuple[RefusedGroups, ...]
    sample: tuple[AffectedGroup, ...]


@dataclass(frozen=True)
class BulkVerdictReport:
    """What a bulk verdict did; ``batch`` is None when there was nothing to do."""

    batch: int | None
    changed: int
    refused: tuple[RefusedGroups, ...]


ASKED = (
    "group_id", "key", "number", "label", "status", "stale", "reason", "passes", "gate", "pictures",
    "findings", "dismissed", "sigma_m",
)  # fmt: skip
"""What a bulk verdict asks of a group's row in the queue."""


def plan_verdicts(
    store: Store,
    dataset_id: int,
    query: str,
    state: str,
    reason: str | None = None,
    note: str | None = None,
) -> BulkPlan:
    """The plan of a verdict on all groups of a query; nothing is saved.

    Raises:
        InputError: The query or the verdict cannot be.
    """
    verdict = check_verdict(state, reason, note)
    conditions = parse_query(query, MAX_LISTED_LENGTH).conditions
    with store.read() as session:
        rows = GroupListing(session, dataset_id, conditions).columns(ASKED, by_number=True)
        sorted_out = select_groups_for_verdict(session, dataset_id, rows, verdict)
    sample = [
        AffectedGroup(row.group_id, row.key, row.number, row.label)
        for row in sorted_out.change[:SAMPLE]
    ]
    replaced = Counter(
        row.status for row in sorted_out.change if _has_another_verdict(row, verdict)
    )
    return BulkPlan(
        matches=len(rows),
        would_change=len(sorted_out.change),
        unchanged=sorted_out.unchanged,
        replaced=tuple(ReplacedVerdicts(*item) for item in sorted(replaced.items())),
        refused=sorted_out.refused,
        sample=tuple(sample),
    )


def give_verdicts(
    store: Store,
    dataset_id: int,
    query: str,
    state: str,
    reason: str | None = None,
    note: str | None = None,
    *,
    actor: str,
    expected: int | None = None,
) -> BulkVerdictReport:
    """Give a verdict to all groups of a query, as each of them is when its turn comes.

    Accepting a group that fails a gate overrides the policy, as it does for one group alone:
    without a note such groups are refused and counted, and so are groups whose ball cannot be
    used and groups without any picture. So are independent annotations that were submitted, and
    groups that wait for a decision between annotations that differ.
    A run that was stopped goes on with the groups behind its place that match then; what was
    imported since it began is not among them.

    Args:
        store: The database.
        dataset_id: The dataset.
        query: As ``query.parse_query`` reads it; its sort is of no matter. It may list
            thousands of groups one by one (``id:12,15``).
        state: As ``verdict.set_verdict`` takes it, like ``reason`` and ``note``.
        actor: Who says so.
        expected: How many groups ``plan_verdicts`` said would change; refuse another number.

    Raises:
        InputError: The query or the verdict cannot be.
        ConflictError: Another number of groups would change than the caller expects, or what was
            given before the run was killed has been taken back.
    """
    verdict = check_verdict(state, reason, note)
    conditions = parse_query(query, MAX_LISTED_LENGTH).conditions
    run = BulkVerdictRun(dataset_id, query, verdict, actor)
    with store.read() as session:
        begun = run.resume(session)
        rows = GroupListing(session, dataset_id, conditions).columns(ASKED, by_number=True)
        found = select_groups_for_verdict(session, dataset_id, rows, verdict)
    if begun is None:
        _require_expected_count(found, expected)
        left, refused = found.change, found.refused
        if not left:
            return BulkVerdictReport(None, 0, refused)
    else:
        left = _filter_remaining_rows(found.change, begun)
        refused = tuple(RefusedGroups(*item) for item in begun["refused"])
    places = [(row.number, row.group_id) for row in left]
    # Of a million groups, what the queue says of each is much.
    del rows, found, left
    counts = [[item.reason, item.groups] for item in refused]
    for start in range(0, max(len(places), 1), CHUNK):
        chunk = places[start : start + CHUNK]
        with store.write() as session:
            rows = read_columns_of_groups(session, [group for _, group in chunk], conditions, ASKED)
            run.save_chunk(
                session, select_groups_for_verdict(session, dataset_id, rows, verdict).change
            )
            if start + CHUNK < len(places):
                here, end = chunk[-1][0], places[-1][0]
                run.save_remaining(session, {"after": here, "until": end, "refused": counts})
            else:
                run.log_completion(session)
                report = BulkVerdictReport(run.batch, run.changed, refused)
                session.respond(report)
    return report


def _filter_remaining_rows(rows: Sequence[Any], begun: Mapping[str, Any]) -> list[Any]:
    """The groups that an interrupted run left over.

    It remembers the numbers between which they lie, so that whatever was imported since is not
    among them; one of an earlier version remembers each of them.
    """
    if "ids" in begun:
        ids = set(begun["ids"])
        return [row for row in rows if row.group_id in ids]
    return [row for row in rows if begun["after"] < row.number <= begun["until"]]


def _require_expected_count(found: VerdictSelection, expected: int | None) -> None:
    if expected is not None and expected != len(found.change):
        raise ConflictError(
            f"{plural(len(found.change), 'group')} would change, not {expected}",
            hint="Repeat the dry run (dry_run=true) and check its result.",
        )


def list_bulk_verdicts(
    store: Store, dataset_id: int, limit: int = 20, before: int | None = None
) -> list[StoredBulkVerdict]:
    """The newest bulk verdicts of a dataset, the newest first.

    Those whose query asks what is for reviewers alone are told to these alone: they say how many
    groups it found.

    Args:
        store: The database.
        dataset_id: The dataset.
        limit: As many at most.
        before: Only those before this id; None: from the newest.
    """
    found: list[StoredBulkVerdict] = []
    with store.read() as session:
        while some := read_bulk_verdicts(session, dataset_id, limit, before):
            found += [
                one
                for one in some
                if sees_independent_work(dataset_id) or not query_reveals_hidden_work(one.query)
            ]
            if len(some) < limit or len(found) >= limit:
                break
            before = some[-1].id
    return found[:limit]


@dataclass(frozen=True)
class VerdictSelection:
    """Rows that a verdict changes, how many have it already, and those that it is refused for."""

    change: list[Any]
    unchanged: int
    refused: tuple[RefusedGroups, ...]


def select_groups_for_verdict(
    session: Session, dataset_id: int, rows: Sequence[Any], verdict: Verdict
) -> VerdictSelection:
    """The groups of a dataset that a verdict changes, and how many it is refused for, and why."""
    reasons = (SUBMITTED, UNDECIDED, UNSOLVED, NEEDS_NOTE, UNUSABLE_BALL, NO_PICTURE)
    change, unchanged, refused = [], 0, dict.fromkeys(reasons, 0)
    closed = list_closed_copies(session, dataset_id) if dataset_id > COPIES else ()
    judges = verdict.state != "unreviewed"
    undecided = list_undecided_groups(session, dataset_id) if judges else ()
    unsolved = _unsolved_groups(session, dataset_id, rows) if verdict.state == "accepted" else ()
    for row in rows:
        if _has_verdict(row, verdict):
            unchanged += 1
        elif row.group_id in closed:
            refused[SUBMITTED] += 1
        elif row.group_id in undecided:
            refused[UNDECIDED] += 1
        elif row.group_id in unsolved:
            refused[UNSOLVED] += 1
        elif verdict.state == "accepted" and not row.passes and verdict.note is None:
            refused[NEEDS_NOTE] += 1
        elif (
            verdict.state == "accepted"
            and verdict.note is None
            and has_unusable_ball(row.findings, row.dismissed, row.sigma_m)
        ):
            refused[UNUSABLE_BALL] += 1
        elif verdict.state == "accepted" and not row.pictures and verdict.note is None:
            refused[NO_PICTURE] += 1
        else:
            change.append(row)
    refusals = (RefusedGroups(reason, count) for reason, count in refused.items() if count)
    return VerdictSelection(change, unchanged, tuple(refusals))


def _unsolved_groups(session: Session, dataset_id: int, rows: Sequence[Any]) -> set[int]:
    """Groups that this solver has not solved as they are: their rows may tell of an earlier one."""
    few = [row.group_id for row in rows] if len(rows) <= CHUNK else None
    return set(list_unsolved_groups(session, dataset_id, few))


def _has_verdict(row: Any, verdict: Verdict) -> bool:
    """Whether a group has the verdict already; one with a note of its own is always new."""
    if verdict.state == row.status == "unreviewed":
        return True
    same = row.status == verdict.state and row.reason == verdict.reason and not row.stale
    return bool(same and verdict.note is None)


def _has_another_verdict(row: Any, verdict: Verdict) -> bool:
    """Whether a person would lose a verdict: one of an earlier state of the group is only renewed."""
    same = (row.status, row.reason) == (verdict.state, verdict.reason)
    return row.status != "unreviewed" and not same


class BulkVerdictRun:
    """A batch while it is given, chunk by chunk.

    Args:
        again: The batch that it gives again, or None.
    """

    def __init__(
        self, dataset_id: int, query: str, verdict: Verdict, actor: str, again: int | None = None
    ):
        self._left: Any = None
        self._again = {} if again is None else {"again": again}
        self.batch: int | None = None
        self.changed = 0
        self._dataset_id, self._query = dataset_id, query
        self._verdict, self._actor = verdict, actor

    def resume(self, session: Session) -> Any:
        """Go on where a run was killed; returns what it said was left, None where none was.

        Raises:
            ConflictError: What it had given was taken back meanwhile.
        """
        self._left = read_progress(session)
        if self._left is None:
            return None
        self.batch = self._left["batch"]
        self._stored_batch(session)
        return self._left

    def save_remaining(self, session: Session, left: dict[str, Any]) -> None:
        """Say in the transaction of a chunk what is left once it is saved."""
        if session.idempotency_key is None:
            return
        if read_progress(session) != self._left:
            raise ConflictError(
                "the same request is still running",
                hint="Wait, then send it again with the same Idempotency-Key.",
            )
        self._left = {"batch": self.batch, **left}
        save_progress(session, self._left)

    def save_chunk(self, session: Session, rows: Sequence[Any]) -> None:
        """Save the verdicts of one chunk with its log entries, in one transaction.

        Raises:
            ConflictError: What was given before has been taken back meanwhile.
        """
        given = self._stored_batch(session)
        self.changed = 0 if given is None else given.changed
        if not rows:
            return
        at = now()
        verdicts = _make_verdicts(session, rows, self._verdict, self._actor, at)
        save_verdicts(session, self._dataset_id, verdicts, actor=self._actor, at=at)
        self.changed += len(verdicts)
        spans = [] if given is None else given.spans
        self._save_batch(session, at, append_span(spans, [item.id for item in verdicts]))

    def log_completion(self, session: Session) -> None:
        """Say in the log that the batch is complete."""
        if self.batch is None:
            return
        at = now()
        body = {"batch": self.batch, "q": self._query, "changed": self.changed}
        body |= asdict(self._verdict) | self._again
        entry = NewLogEntry("verdict_batch", self._actor, at, body, self._dataset_id)
        (log_id,) = append_entries(session, [entry])
        update_bulk_verdict(session, self.batch, log_id=log_id)

    def _stored_batch(self, session: Session) -> StoredBulkVerdict | None:
        """The batch as it is stored, which others may go on with or take back; None before it is.

        Raises:
            ConflictError: It has been taken back.
        """
        if self.batch is None:
            return None
        given = find_bulk_verdict(session, self.batch)
        if given is None or given.is_taken_back:
            raise ConflictError(
                "the verdicts of this request were undone meanwhile",
                hint="Give the verdict again, under another Idempotency-Key.",
            )
        return given

    def _save_batch(self, session: Session, at: str, spans: Spans) -> None:
        values: dict[str, Any] = {"changed": self.changed, "spans": spans}
        if self.batch is not None:
            update_bulk_verdict(session, self.batch, **values)
            return
        values |= {"dataset_id": self._dataset_id, "at": at, "actor": self._actor}
        self.batch = insert_bulk_verdict(
            session, query=self._query, **asdict(self._verdict), **values
        )


def _make_verdicts(
    session: Session, rows: Sequence[Any], verdict: Verdict, actor: str, at: str
) -> list[StoredVerdict]:
    ids = [row.group_id for row in rows]
    keys, edited = read_current_solution_keys(session, ids), filter_edited_groups(session, ids)
    number = find_next_verdict_id(session)
    accepts = verdict.state == "accepted"
    return [
        StoredVerdict(
            id=number + place,
            group_id=row.group_id,
            actor=actor,
            at=at,
            **vars(verdict),
            inputs_hash=keys[row.group_id].inputs_hash,
            policy_hash=keys[row.group_id].policy_hash,
            fixed=bool(accepts and row.passes and row.group_id in edited),
            override=(row.gate or "unknown") if accepts and not row.passes else None,
        )
        for place, row in enumerate(rows)
    ]


def split_for_transactions(spans: Spans) -> list[tuple[int, int]]:
    """The verdicts of some spans in spans of as many as a transaction may have."""
    return split_spans(spans, CHUNK)


def save_verdicts(
    session: Session, dataset_id: int, given: Sequence[StoredVerdict], *, actor: str, at: str
) -> None:
    """Insert verdicts, log them under who gives them, and show them in the queue."""
    insert_verdicts_and_end_work(session, dataset_id, given, actor=actor, at=at)
    refresh_verdict_columns(session, list({verdict.group_id: None for verdict in given}))
