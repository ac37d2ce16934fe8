"""Bells in the database: what each person was told, the newest first."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from enum import StrEnum
from typing import Any

from sqlalchemy import ColumnElement, delete, func, insert, literal, select, update

from app.db.session import Session
from app.features.comments.tables import BellModel
from app.features.datasets.tables import DatasetModel
from app.features.groups.insert_queries import next_id
from app.features.people.visibility_queries import Sight, seen_anywhere
from app.finite import Moment


class RingKind(StrEnum):
    """Why somebody is told."""

    MENTION = "mention"
    REPLY = "reply"
    JOB = "job"
    ASSIGNED = "assigned"
    RETURNED = "returned"


@dataclass(frozen=True)
class Ring:
    """One thing that a person was told.

    Attributes:
        kind: ``mention``, ``reply``, ``job``, ``assigned`` or ``returned``.
        actor: Who did it.
        address: Of the page that it is about.
        dataset: Name of its dataset; None where it has none.
        read: When they have seen it; None: not yet.
    """

    id: int
    at: Moment
    kind: RingKind
    actor: str
    sentence: str
    address: str
    dataset: str | None
    group_id: int | None
    read: Moment | None


def insert_ring(session: Session, person_id: int, values: dict[str, Any]) -> int:
    """Tell a person of something; returns its id."""
    identity = next_id(session, BellModel)
    session.execute(insert(BellModel), {"id": identity, "person_id": person_id, **values})
    return identity


def forget_rings(session: Session, person_id: int, before: str) -> None:
    """Forget what a person was told before a time."""
    mine = BellModel.person_id == person_id
    session.execute(delete(BellModel).where(mine, BellModel.at < before))


def read_rings(
    session: Session,
    person_id: int,
    sight: Sight,
    since: str,
    limit: int,
    before: int | None = None,
) -> list[Ring]:
    """What a person was told since a time of what they see now, the newest first."""
    columns = [getattr(BellModel, name) for name in Ring.__dataclass_fields__ if name != "dataset"]
    statement = (
        select(*columns, DatasetModel.name.label("dataset"))
        .outerjoin(DatasetModel, DatasetModel.id == BellModel.dataset_id)
        .where(*_seen(person_id, sight, since))
        .order_by(BellModel.id.desc())
        .limit(limit)
    )
    if before is not None:
        statement = statement.where(BellModel.id < before)
    rows = session.execute(statement)
    return [Ring(**{**row._mapping, "kind": RingKind(row.kind)}) for row in rows]


def count_unread(session: Session, person_id: int, sight: Sight, since: str) -> int:
    """How much of it they have not seen yet."""
    unread = (*_seen(person_id, sight, since), BellModel.read.is_(None))
    return session.scalar(select(func.count()).select_from(BellModel).where(*unread)) or 0


def mark_read(
    session: Session, person_id: int, sight: Sight, ids: Sequence[int] | None, at: str
) -> None:
    """They have seen some of it, or (None) all that they see now."""
    where = [*_seen(person_id, sight, ""), BellModel.read.is_(None)]
    if ids is not None:
        where.append(BellModel.id.in_(ids))
    session.execute(update(BellModel).where(*where).values(read=at))


def _seen(person_id: int, sight: Sight, since: str) -> list[ColumnElement[bool]]:
    where = [BellModel.person_id == person_id, BellModel.at >= since]
    # What is of no dataset was told to them, and is theirs.
    seen = sight.condition(BellModel.dataset_id, literal(sight.name))
    where += seen_anywhere(BellModel.dataset_id, BellModel.group_id)
    return where if seen is None else [*where, seen]
