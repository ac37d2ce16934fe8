"""Verdicts in the database: everyone's are kept, the newest counts."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import cast

from sqlalchemy import Table, bindparam, insert, select
from sqlalchemy.orm import Session

from app.store.group_rows import next_id
from app.store.log import Entry, append
from app.store.models import VerdictModel
from app.store.view_models import VerdictBatchModel


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


def read_verdicts(session: Session, group_ids: Sequence[int]) -> dict[int, list[StoredVerdict]]:
    """All verdicts of groups, the newest first; groups without one are left out."""
    verdicts: dict[int, list[StoredVerdict]] = {}
    for row in session.execute(_OF_GROUPS, {"ids": list(group_ids)}):
        verdicts.setdefault(row.group_id, []).append(StoredVerdict(**row._mapping))
    return verdicts


def judged_between(session: Session, first: int, last: int) -> list[int]:
    """Ids of the groups that the verdicts of a range of ids judge."""
    statement = select(VerdictModel.group_id).where(VerdictModel.id.between(first, last))
    return list(session.scalars(statement.order_by(VerdictModel.id)))


def batch_undone(session: Session, batch_id: int) -> bool:
    """Whether verdicts that were given at once have been taken back, or are being."""
    model = VerdictBatchModel
    statement = select(model.undone, model.undo_spans).where(model.id == batch_id)
    row = session.execute(statement).one_or_none()
    return row is None or row.undone is not None or row.undo_spans is not None


def next_verdict_id(session: Session) -> int:
    """The id that the next verdict gets."""
    return next_id(session, VerdictModel)


def insert_verdicts(
    session: Session, dataset_id: int, given: Sequence[StoredVerdict], *, actor: str, at: str
) -> None:
    """Insert verdicts on groups of a dataset, and log them under who gives them."""
    rows = [dict(vars(verdict)) for verdict in given]
    session.execute(insert(_VERDICT), rows)
    entries = []
    for row in rows:
        body = {name: value for name, value in row.items() if name not in ("id", "group_id")}
        entries.append(Entry("verdict", actor, at, body, dataset_id, row["group_id"]))
    append(session, entries)
