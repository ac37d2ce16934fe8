"""A group as people see it now, with its solution, its verdict and its ETag."""

from __future__ import annotations

import json
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

from app.db.session import Session
from app.errors import NotFoundError, StaleRevisionError
from app.features.datasets.queries import parse_stored_policy
from app.features.findings.queries import (
    NOTHING_DISMISSED,
    GroupDismissals,
    findings_from_rows,
    read_import_findings_and_dismissals,
    read_import_notices,
)
from app.features.groups.queries import StoredGroup, read_groups
from app.features.groups.revision_queries import find_etag_row, read_etag_rows
from app.features.groups.undo_stacks import UndoStacks, read_stacks
from app.features.groups.view_queries import StoredStation
from app.features.people.visibility_queries import COPIES
from app.features.solutions.queries import SolutionKey, read_solutions
from app.features.verdicts.queries import StoredVerdict, is_group_mended, read_last_verdicts
from app.soccer.codec import digest_json
from app.soccer.finding import Dismissal, Finding
from app.soccer.group import Group
from app.soccer.policy import Policy
from app.soccer.solution import SOLVER_VERSION, Solution


def content_tag(inputs_hash: str, revision: int, verdict_id: int, dismissal_id: int = 0) -> str:
    """What people said about a group: the part of its ETag that a change builds on.

    The ids are those of the newest verdict and of the newest dismissal; 0: there is none.
    """
    content = [inputs_hash, revision, verdict_id]
    return digest_json([*content, dismissal_id] if dismissal_id else content)[:16]


def group_etag(
    content: str,
    policy_hash: str,
    policy_name: str,
    findings: Iterable[str] | None,
    station_revisions: int,
) -> str:
    """The ETag of a group, quoted.

    Before the dash what people said, after it what was computed from that, and in how many steps
    its stations came to be as they are. A change builds on the first part alone: a solution that
    arrives is no conflict, but a cached document without it is out of date, as is one with ETags of
    stations that were changed and changed back.

    Args:
        content: ``content_tag``.
        policy_hash: Of the dataset's policy.
        policy_name: Of the dataset's policy.
        findings: Kinds of the solution's findings; None without a solution.
        station_revisions: Of the stations of its views, added up.
    """
    kinds = sorted(set(findings or ()))
    parts = [policy_hash, policy_name, SOLVER_VERSION, findings is None, kinds, station_revisions]
    computed = digest_json(parts)[:8]
    return f'"{content}-{computed}"'


@dataclass(frozen=True)
class GroupChangeBasis:
    """What a change of a group rests on.

    Attributes:
        content: ``content_tag``.
        policy_hash: Of the policy that judges it.
    """

    content: str
    policy_hash: str


def read_group_change_basis(session: Session, group_id: int) -> GroupChangeBasis | None:
    """What a change of a group would rest on now; None where there is no such group."""
    row = find_etag_row(session, group_id)
    if row is None:
        return None
    content = content_tag(row.inputs_hash, row.revision, row.last, row.last_dismissal)
    return GroupChangeBasis(content, row.policy_hash)


def content_tag_from_etag(etag: str) -> str:
    """The first part of an ETag, quoted or not."""
    return etag.strip().strip('"').partition("-")[0]


def require_unchanged(session: Session, group_id: int, if_match: str, what: str) -> str:
    """Refuse a change that builds on another state of a group than the present one.

    A few numbers and digests are read, and nothing is decoded: this is what runs while everybody
    else who writes is waiting.

    Returns:
        Hash of the policy that judges the group now.

    Raises:
        NotFoundError: The group is gone.
        StaleRevisionError: With both ETags.
    """
    head = read_group_change_basis(session, group_id)
    if head is None:
        raise NotFoundError.group(group_id)
    require_unchanged_content(session, group_id, head.content, if_match, what)
    return head.policy_hash


def require_unchanged_content(
    session: Session, group_id: int, content: str, if_match: str, what: str
) -> None:
    """``require_unchanged`` where what was said about the group is known."""
    if content != content_tag_from_etag(if_match):
        require_etag(read_etags(session, [group_id])[group_id], if_match, what)


def require_etag(current: str, if_match: str, what: str) -> None:
    """Refuse a change that builds on another state than the present one.

    Raises:
        StaleRevisionError: With both ETags.
    """
    if content_tag_from_etag(current) != content_tag_from_etag(if_match):
        raise StaleRevisionError(
            f"{what} was changed meanwhile", base_etag=if_match, current_etag=current
        )


def read_etags(session: Session, group_ids: Sequence[int]) -> dict[int, str]:
    """ETags by group id; at most a few hundred groups, those that do not exist are left out."""
    noticed = read_import_notices(session, group_ids)
    etags = {}
    for row in read_etag_rows(session, group_ids):
        content = content_tag(row.inputs_hash, row.revision, row.last, row.last_dismissal)
        findings = None
        if row.summary is not None:
            kinds = [item.kind for item in findings_from_rows(noticed[row.id], row.inputs_hash)]
            findings = [*json.loads(row.summary)["findings"], *kinds]
        name = parse_stored_policy(row.policy).name
        revisions = int(row.station_revisions)
        etags[row.id] = group_etag(content, row.policy_hash, name, findings, revisions)
    return etags


@dataclass(frozen=True)
class VerdictState:
    """What one person decided.

    Attributes:
        state: ``unreviewed``, ``accepted``, ``rejected`` or ``deferred``.
        stale: The group has changed since.
        fixed: A person mended the group: it is edited, was accepted as such, and fails no gate.
        override: The gate that failed when the group was accepted all the same, or None.
    """

    state: str = "unreviewed"
    reason: str | None = None
    note: str | None = None
    actor: str | None = None
    at: str | None = None
    stale: bool = False
    fixed: bool = False
    override: str | None = None


@dataclass(frozen=True)
class GroupState:
    """A group as it is now.

    Attributes:
        number: Place in the dataset, from 1.
        etag: Quoted, for ETag and If-Match.
        view_ids: By key of the view.
        station_ids: By key of the station, like ``station_etags``.
        solution: For this state and the dataset's policy; None while it is not computed.
        verdict: The newest of all people's verdicts.
        verdicts: The last one of each person, newest first.
    """

    id: int
    dataset_id: int
    dataset: str
    number: int
    key: str
    revision: int
    etag: str
    group: Group
    view_ids: Mapping[str, int]
    station_ids: Mapping[str, int]
    station_etags: Mapping[str, str]
    solution: Solution | None
    policy: Policy
    verdict: VerdictState
    verdicts: list[VerdictState]
    can_undo: bool
    can_redo: bool
    stored: StoredGroup
    """The same group with its rows' keeping."""
    dismissed: tuple[Dismissal | None, ...] = ()
    """Of each finding of the solution: who has checked it; None: nobody."""

    @property
    def is_copy(self) -> bool:
        """Whether it is somebody's own annotation of another group."""
        return self.dataset_id > COPIES


@dataclass(frozen=True)
class GroupWithoutSolution:
    """A group with all that is kept about it but its solution.

    Attributes:
        said: Rows of what imports and tracks noticed.
        verdicts: The last of each person, the newest first.
        stacks: What can be undone and done again.
        dismissals: Findings that people have checked.
    """

    stored: StoredGroup
    said: tuple[Any, ...]
    verdicts: tuple[StoredVerdict, ...]
    stacks: UndoStacks
    dismissals: GroupDismissals = NOTHING_DISMISSED

    @property
    def solution_key(self) -> SolutionKey:
        """The key of the solution of this state."""
        return SolutionKey(self.stored.id, self.stored.inputs_hash, self.stored.policy.hash)

    @property
    def noticed_findings(self) -> tuple[Finding, ...]:
        """The stored findings of the group in its present state."""
        return tuple(findings_from_rows(self.said, self.stored.inputs_hash))

    @property
    def content_part_of_etag(self) -> str:
        """The part of the ETag that stands for annotations and verdict, on which a change builds."""
        newest = self.newest_verdict
        verdict_id = 0 if newest is None else newest.id
        stored = self.stored
        return content_tag(stored.inputs_hash, stored.revision, verdict_id, self.dismissals.last)

    @property
    def newest_verdict(self) -> StoredVerdict | None:
        """The verdict that counts, or None."""
        return next(iter(self.verdicts), None)

    def make_state(self, solution: Solution | None) -> GroupState:
        """The group as people see it, with its solution where that is known."""
        stored = self.stored
        passes = None if solution is None else solution.passes
        noticed = self.noticed_findings
        if solution is not None and noticed:
            solution = replace(solution, findings=solution.findings + noticed)
        edited = stored.edited
        verdicts = [
            _make_verdict_state(item, stored, edited, passes)
            for item in _select_newest_verdict_per_actor(self.verdicts)
        ]
        kinds = None if solution is None else [item.kind for item in solution.findings]
        stations = stored.stations.values()
        revisions = sum(item.revision for item in stations)
        return GroupState(
            id=stored.id,
            dataset_id=stored.dataset_id,
            dataset=stored.dataset,
            number=stored.number,
            key=stored.group.key,
            revision=stored.revision,
            etag=group_etag(
                self.content_part_of_etag, stored.policy.hash, stored.policy.name, kinds, revisions
            ),
            group=stored.group,
            view_ids=stored.view_ids,
            station_ids={item.station.key: item.id for item in stations},
            station_etags={item.station.key: station_etag(item) for item in stations},
            solution=solution,
            policy=stored.policy,
            verdict=next(iter(verdicts), VerdictState()),
            verdicts=verdicts,
            can_undo=self.stacks.can_undo,
            can_redo=self.stacks.can_redo,
            stored=stored,
            dismissed=()
            if solution is None
            else self.dismissals.find_dismissals(solution.findings),
        )


def require_group(session: Session, group_id: int) -> StoredGroup:
    """A group whole; raises NotFoundError where there is none."""
    stored = read_groups(session, [group_id]).get(group_id)
    if stored is None:
        raise NotFoundError.group(group_id)
    return stored


def read_group_without_solution(session: Session, group_id: int) -> GroupWithoutSolution:
    """A group's record as it is in a session's snapshot.

    Raises:
        NotFoundError: There is no such group.
    """
    records = read_groups_without_solution(session, [group_id])
    if not records:
        raise NotFoundError.group(group_id)
    return records[0]


def read_groups_without_solution(
    session: Session, group_ids: Sequence[int]
) -> list[GroupWithoutSolution]:
    """Records of groups in the order asked for; at most a few hundred."""
    groups = read_groups(session, group_ids)
    noticed, dismissals = read_import_findings_and_dismissals(session, group_ids)
    verdicts = read_last_verdicts(session, group_ids)
    stacks = read_stacks(session, group_ids)
    return [
        GroupWithoutSolution(
            stored,
            tuple(noticed[number]),
            tuple(verdicts.get(number, ())),
            stacks[number],
            dismissals.get(number, NOTHING_DISMISSED),
        )
        for number, stored in groups.items()
    ]


def read_state(session: Session, group_id: int) -> GroupState:
    """A group with its solution as it is in a session's snapshot.

    Raises:
        NotFoundError: There is no such group.
    """
    record = read_group_without_solution(session, group_id)
    key = record.solution_key
    return record.make_state(read_solutions(session, [key]).get(group_id))


def read_states(
    session: Session, group_ids: Sequence[int], *, markings: bool = True
) -> list[GroupState]:
    """Groups with their solutions, in the order asked for; at most a few hundred.

    Args:
        session: Any session.
        group_ids: Which groups.
        markings: Whether calibrations hold their markings.
    """
    records = read_groups_without_solution(session, group_ids)
    keys = [record.solution_key for record in records]
    found = read_solutions(session, keys, markings=markings)
    return [record.make_state(found.get(record.stored.id)) for record in records]


def station_etag(stored: StoredStation) -> str:
    """The station's own ETag, quoted."""
    return f'"{digest_json([stored.digest, stored.revision])[:16]}"'


def _make_verdict_state(
    given: StoredVerdict, stored: StoredGroup, edited: bool, passes: bool | None
) -> VerdictState:
    reviewed = given.state != "unreviewed"
    return VerdictState(
        state=given.state,
        reason=given.reason,
        note=given.note,
        actor=given.actor,
        at=given.at,
        stale=reviewed and given.inputs_hash != stored.inputs_hash,
        fixed=is_group_mended(given, edited, passes),
        override=given.override,
    )


def _select_newest_verdict_per_actor(verdicts: Iterable[StoredVerdict]) -> list[StoredVerdict]:
    last: dict[str, StoredVerdict] = {}
    for verdict in verdicts:
        last.setdefault(verdict.actor, verdict)
    return list(last.values())
