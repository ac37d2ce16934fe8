"""GroupState: a group as people see it now, with its solution, its verdicts and its ETag."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

from sqlalchemy import select
from sqlalchemy.orm import Session

from app.errors import NotFoundError, StaleRevisionError
from app.review.editing.etags import group_etag, said_of, said_part
from app.review.editing.undo import read_stacks
from app.soccer.group import Group
from app.soccer.policy import Policy
from app.soccer.solution import Finding, Solution
from app.store.codecs import parse, policy_from_json
from app.store.digest import digest
from app.store.groups import StoredGroup, StoredStation, read_groups
from app.store.models import DatasetModel, VerdictModel
from app.store.queue import import_findings, is_fixed
from app.store.solutions import SolutionKey, read_solutions


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

    @property
    def solution_key(self) -> SolutionKey:
        """The key of this state's solution."""
        return SolutionKey(self.id, self.stored.inputs_hash, self.policy.hash)


Solutions = Callable[[Session, Sequence[SolutionKey]], Mapping[int, Solution]]
"""Where solutions come from: the database, or whoever knows them already."""


def unsolved(_session: Session, _keys: Sequence[SolutionKey]) -> Mapping[int, Solution]:
    """No solutions: for callers who only need what people said. The ETag of such a state says so."""
    return {}


def read_state(
    session: Session, group_id: int, solutions: Solutions = read_solutions
) -> GroupState:
    """A group as it is in a session's snapshot.

    Raises:
        NotFoundError: There is no such group.
    """
    states = read_states(session, [group_id], solutions)
    if not states:
        raise NotFoundError(f"there is no group {group_id}")
    return states[0]


def read_states(
    session: Session,
    group_ids: list[int],
    solutions: Solutions = read_solutions,
) -> list[GroupState]:
    """Groups of one dataset as they are, in the order asked for; at most a few hundred."""
    groups = read_groups(session, group_ids)
    if not groups:
        return []
    dataset = session.execute(
        select(*DatasetModel.__table__.columns).where(
            DatasetModel.id == next(iter(groups.values())).dataset_id
        )
    ).one()
    policy = policy_from_json(parse(dataset.policy))
    keys = [SolutionKey(item.id, item.inputs_hash, policy.hash) for item in groups.values()]
    found = solutions(session, keys)
    noticed = import_findings(session, group_ids)
    verdicts = _read_verdicts(session, group_ids)
    stacks = read_stacks(session, group_ids)
    return [
        _state(
            item,
            dataset.name,
            policy,
            _with_noticed(found.get(item.id), noticed[item.id]),
            verdicts.get(item.id, []),
            stacks[item.id].can_undo,
            stacks[item.id].can_redo,
        )
        for item in groups.values()
    ]


def _state(
    stored: StoredGroup,
    dataset: str,
    policy: Policy,
    solution: Solution | None,
    rows: list[Any],
    can_undo: bool,
    can_redo: bool,
) -> GroupState:
    passes = None if solution is None else solution.passes
    verdicts = _last_of_each([_verdict_state(row, stored, passes) for row in rows])
    return GroupState(
        id=stored.id,
        dataset_id=stored.dataset_id,
        dataset=dataset,
        number=stored.number,
        key=stored.group.key,
        revision=stored.revision,
        etag=_etag(stored, rows[0].id if rows else 0, policy, solution),
        group=stored.group,
        view_ids=stored.view_ids,
        station_ids={item.station.key: item.id for item in stored.stations.values()},
        station_etags={item.station.key: station_etag(item) for item in stored.stations.values()},
        solution=solution,
        policy=policy,
        verdict=next(iter(verdicts), VerdictState()),
        verdicts=verdicts,
        can_undo=can_undo,
        can_redo=can_redo,
        stored=stored,
    )


def _etag(stored: StoredGroup, verdict_id: int, policy: Policy, solution: Solution | None) -> str:
    said = said_part(stored.inputs_hash, stored.revision, verdict_id)
    kinds = None if solution is None else [item.kind for item in solution.findings]
    return group_etag(said, policy.hash, policy.name, kinds)


def station_etag(stored: StoredStation) -> str:
    """The station's own ETag, quoted."""
    return f'"{digest([stored.digest, stored.revision])[:16]}"'


def require_etag(current: str, if_match: str, what: str) -> None:
    """Refuse a change that builds on another state than the present one.

    Raises:
        StaleRevisionError: With both ETags.
    """
    if said_of(current) != said_of(if_match):
        raise StaleRevisionError(
            f"{what} has changed in the meantime", base_etag=if_match, current_etag=current
        )


def _read_verdicts(session: Session, group_ids: list[int]) -> dict[int, list[Any]]:
    statement = (
        select(*VerdictModel.__table__.columns)
        .where(VerdictModel.group_id.in_(group_ids))
        .order_by(VerdictModel.id.desc())
    )
    verdicts: dict[int, list[Any]] = {}
    for row in session.execute(statement):
        verdicts.setdefault(row.group_id, []).append(row)
    return verdicts


def _verdict_state(row: Any, stored: StoredGroup, passes: bool | None) -> VerdictState:
    reviewed = row.state != "unreviewed"
    return VerdictState(
        state=row.state,
        reason=row.reason,
        note=row.note,
        actor=row.actor,
        at=row.at,
        stale=reviewed and row.inputs_hash != stored.inputs_hash,
        fixed=is_fixed(row, stored.edited, passes),
        override=row.override,
    )


def _last_of_each(verdicts: list[VerdictState]) -> list[VerdictState]:
    last: dict[str | None, VerdictState] = {}
    for verdict in verdicts:
        last.setdefault(verdict.actor, verdict)
    return list(last.values())


def _with_noticed(solution: Solution | None, noticed: Iterable[Any]) -> Solution | None:
    found = tuple(Finding(item.kind, item.sentence, view=item.view) for item in noticed)
    if solution is None or not found:
        return solution
    return replace(solution, findings=solution.findings + found)
