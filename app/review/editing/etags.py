"""ETags of groups: what names a group's state, worked out from its rows without decoding it."""

from __future__ import annotations

import json
from collections.abc import Iterable, Sequence
from dataclasses import dataclass

from app.errors import NotFoundError, StaleRevisionError
from app.soccer.solution import SOLVER_VERSION
from app.store.datasets import policy_of
from app.store.digest import digest
from app.store.heads import find_head, read_heads
from app.store.queue import import_findings
from app.store.session import Session


def said_part(inputs_hash: str, revision: int, verdict_id: int, dismissal_id: int = 0) -> str:
    """What people said about a group: the part of its ETag that a change builds on.

    The ids are those of the newest verdict and of the newest dismissal; 0: there is none.
    """
    said = [inputs_hash, revision, verdict_id]
    return digest([*said, dismissal_id] if dismissal_id else said)[:16]


def group_etag(
    said: str,
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
        said: ``said_part``.
        policy_hash: Of the dataset's policy.
        policy_name: Of the dataset's policy.
        findings: Kinds of the solution's findings; None without a solution.
        station_revisions: Of the stations of its views, added up.
    """
    kinds = sorted(set(findings or ()))
    parts = [policy_hash, policy_name, SOLVER_VERSION, findings is None, kinds, station_revisions]
    computed = digest(parts)[:8]
    return f'"{said}-{computed}"'


@dataclass(frozen=True)
class Head:
    """What a change of a group rests on.

    Attributes:
        said: ``said_part``.
        policy_hash: Of the policy that judges it.
    """

    said: str
    policy_hash: str


def read_head(session: Session, group_id: int) -> Head | None:
    """What a change of a group would rest on now; None where there is no such group."""
    row = find_head(session, group_id)
    if row is None:
        return None
    said = said_part(row.inputs_hash, row.revision, row.last, row.last_dismissal)
    return Head(said, row.policy_hash)


def said_of(etag: str) -> str:
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
    head = read_head(session, group_id)
    if head is None:
        raise NotFoundError.group(group_id)
    require_said(session, group_id, head.said, if_match, what)
    return head.policy_hash


def require_said(session: Session, group_id: int, said: str, if_match: str, what: str) -> None:
    """``require_unchanged`` where what was said about the group is known."""
    if said != said_of(if_match):
        require_etag(read_etags(session, [group_id])[group_id], if_match, what)


def require_etag(current: str, if_match: str, what: str) -> None:
    """Refuse a change that builds on another state than the present one.

    Raises:
        StaleRevisionError: With both ETags.
    """
    if said_of(current) != said_of(if_match):
        raise StaleRevisionError(
            f"{what} has changed in the meantime", base_etag=if_match, current_etag=current
        )


def read_etags(session: Session, group_ids: Sequence[int]) -> dict[int, str]:
    """ETags by group id; at most a few hundred groups, those that do not exist are left out."""
    noticed = import_findings(session, group_ids)
    etags = {}
    for row in read_heads(session, group_ids):
        said = said_part(row.inputs_hash, row.revision, row.last, row.last_dismissal)
        findings = None
        if row.summary is not None:
            kinds = [item.kind for item in noticed[row.id]]
            findings = [*json.loads(row.summary)["findings"], *kinds]
        name = policy_of(row.policy).name
        revisions = int(row.station_revisions)
        etags[row.id] = group_etag(said, row.policy_hash, name, findings, revisions)
    return etags
