"""Verdicts in the database: everyone's are kept, the newest counts."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Any, cast

from sqlalchemy import Table, bindparam, case, func, insert, select

from app.store.aliases import shown_actor
from app.store.group_rows import next_id
from app.store.log import Entry, append
from app.store.reader import seen_in
from app.store.session import Session
from app.store.settling import settle_judged
from app.store.sight import COPIES
from app.store.submissions import judge_copy
from app.store.tables.groups import GroupModel
from app.store.tables.verdicts import VerdictModel


@dataclass(frozen=True)
class StoredVerdict:
    """What one person decided on one state of a group, as ``VerdictModel`` has it."""

    id: int
    group_id: int
    actor: str
    at: str
    state: str
    reason: str | None
    note: str | None
    inputs_hash: str
    policy_hash: str
    fixed: bool
    override: str | None


_VERDICT = cast(Table, VerdictModel.__table__)
_OF_GROUPS = (
    select(*_VERDICT.columns)
    .where(_VERDICT.c.group_id.in_(bindparam("ids", expanding=True)))
    .order_by(_VERDICT.c.id.desc())
)
_SHOWN = [column for column in _VERDICT.columns if column.name != "actor"]
_LAST_OF_EACH = (
    select(*_SHOWN, shown_actor(_VERDICT.c.actor, _VERDICT.c.at).label("actor"))
    .where(
        _VERDICT.c.id.in_(
            select(func.max(_VERDICT.c.id))
            .where(_VERDICT.c.group_id.in_(bindparam("ids", expanding=True)))
            .group_by(_VERDICT.c.group_id, _VERDICT.c.actor)
        )
    )
    .order_by(_VERDICT.c.id.desc())
)


def read_verdicts(session: Session, group_ids: Sequence[int]) -> dict[int, list[StoredVerdict]]:
    """All verdicts of groups, the newest first; groups without one are left out."""
    return _by_group(session.execute(_OF_GROUPS, {"ids": list(group_ids)}))


def read_last_verdicts(
    session: Session, group_ids: Sequence[int]
) -> dict[int, list[StoredVerdict]]:
    """Like ``read_verdicts``, but of each person the last alone, under the name that is shown."""
    return _by_group(session.execute(_LAST_OF_EACH, {"ids": list(group_ids)}))


def _by_group(rows: Iterable[Any]) -> dict[int, list[StoredVerdict]]:
    verdicts: dict[int, list[StoredVerdict]] = {}
    for row in rows:
        verdicts.setdefault(row.group_id, []).append(StoredVerdict(**row._mapping))
    return verdicts


def judged_between(session: Session, first: int, last: int) -> list[int]:
    """Ids of the groups that the verdicts of a range of ids judge."""
    statement = select(VerdictModel.group_id).where(VerdictModel.id.between(first, last))
    return list(session.scalars(statement.order_by(VerdictModel.id)))


def newest_between(session: Session, first: int, last: int) -> list[int]:
    """Ids of the groups whose newest verdict is one of a range of ids."""
    judged = select(VerdictModel.group_id).where(VerdictModel.id.between(first, last))
    newest = func.max(VerdictModel.id)
    statement = (
        select(VerdictModel.group_id)
        .where(VerdictModel.group_id.in_(judged))
        .group_by(VerdictModel.group_id)
        .having(newest.between(first, last))
    )
    return list(session.scalars(statement))


def inputs_judged(
    session: Session, first: int, last: int, group_ids: Sequence[int]
) -> dict[int, str]:
    """Inputs hash that the verdicts of a range of ids judged, by the group's id."""
    statement = select(VerdictModel.group_id, VerdictModel.inputs_hash).where(
        VerdictModel.id.between(first, last), VerdictModel.group_id.in_(group_ids)
    )
    return {row.group_id: row.inputs_hash for row in session.execute(statement)}


def count_by_judge(session: Session, dataset_id: int, since: str) -> Sequence[Any]:
    """Rows (actor, last, groups): everybody who judged a group of a dataset, when for the last
    time, and how many groups since some time."""
    recent = case((VerdictModel.at >= since, VerdictModel.group_id))
    actor = shown_actor(VerdictModel.actor, VerdictModel.at)
    statement = (
        select(
            actor.label("actor"),
            func.max(VerdictModel.at).label("last"),
            func.count(recent.distinct()).label("groups"),
        )
        .join(GroupModel, GroupModel.id == VerdictModel.group_id)
        .where(GroupModel.dataset_id == dataset_id, *seen_in(dataset_id, GroupModel.id))
        .group_by(actor)
    )
    return session.execute(statement).all()


def next_verdict_id(session: Session) -> int:
    """The id that the next verdict gets."""
    return next_id(session, VerdictModel)


def insert_verdicts(
    session: Session, dataset_id: int, given: Sequence[StoredVerdict], *, actor: str, at: str
) -> None:
    """Insert verdicts on groups of a dataset, and log them under who gives them; work on these groups
    that was given out is over by that, and a copy is submitted.

    Raises:
        ForbiddenError: A group is somebody else's copy.
        ConflictError: A group is a copy that was submitted.
    """
    rows = [dict(vars(verdict)) for verdict in given]
    session.execute(insert(_VERDICT), rows)
    entries = []
    for row in rows:
        body = {name: value for name, value in row.items() if name not in ("id", "group_id")}
        entries.append(Entry("verdict", actor, at, body, dataset_id, row["group_id"]))
    append(session, entries)
    if dataset_id <= COPIES:
        states = {verdict.group_id: verdict.state for verdict in given}
        settle_judged(session, states, actor=actor, at=at)
        return
    for row in rows:
        judge_copy(session, row["group_id"], row["state"], actor=actor, at=at)


def newest_verdict(session: Session) -> int:
    """Id of the last verdict of any group; 0 where there is none."""
    return session.scalar(select(func.max(VerdictModel.id))) or 0


def judged_since(session: Session, dataset_id: int, after: int) -> list[int]:
    """Ids of the groups of a dataset that somebody judged after a verdict, or took that back."""
    statement = (
        select(VerdictModel.group_id)
        .join(GroupModel, GroupModel.id == VerdictModel.group_id)
        .where(GroupModel.dataset_id == dataset_id, VerdictModel.id > after)
    )
    return list(session.scalars(statement))
