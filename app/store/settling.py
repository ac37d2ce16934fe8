"""Settling: the work on groups of batches is over, or waits again; a batch may be done by that."""

from __future__ import annotations

from collections.abc import Collection, Mapping
from typing import Any

from sqlalchemy import ColumnElement, delete, select, update
from sqlalchemy.orm import Session

from app.store.dialect.statements import numbers_in
from app.store.outbox import DONE, announce_batch
from app.store.webhook_models import WebhookModel
from app.store.work import OPEN
from app.store.work_models import BatchGroupModel, BatchModel, LeaseModel

_BATCH = BatchModel.__table__
_SINGLE = select(_BATCH.c.id).where(_BATCH.c.state == OPEN, _BATCH.c.verdicts == 1)
"""Open batches that ask for one verdict."""
_ANY_SINGLE = _SINGLE.limit(1)


def settle_judged(session: Session, states: Mapping[int, str], *, actor: str, at: str) -> None:
    """Groups were judged: in open batches that ask for one verdict their work is over.

    A group that is deferred, or not judged any more, waits again. Whoever has a settled group open
    needs it no longer.

    Args:
        session: The write session that holds the verdicts.
        states: The verdict on each group.
        actor: Who gave them.
        at: When they were given.
    """
    if session.scalar(_ANY_SINGLE) is None:
        return
    over = {group for group, state in states.items() if state in ("accepted", "rejected")}
    for ids, settled in ((over, at), (set(states) - over, None)):
        if ids:
            where = (BatchGroupModel.group_id.in_(numbers_in(ids)), _of(_SINGLE))
            near = [] if settled is None else _that_wait(session, *where)
            session.execute(update(BatchGroupModel).where(*where).values(settled=settled))
            _tell_done(session, near, actor=actor, at=at)
    gone = (LeaseModel.group_id.in_(numbers_in(over)), LeaseModel.batch_id.in_(_SINGLE))
    session.execute(delete(LeaseModel).where(*gone))


def settle_in_batch(session: Session, batch_id: int, group_id: int, *, actor: str, at: str) -> None:
    """The work on a group of a batch is over."""
    mine = (BatchGroupModel.batch_id == batch_id, BatchGroupModel.group_id == group_id)
    near = _that_wait(session, *mine)
    still = BatchGroupModel.settled.is_(None)
    session.execute(update(BatchGroupModel).where(*mine, still).values(settled=at))
    _tell_done(session, near, actor=actor, at=at)


def _of(batches: Any) -> ColumnElement[bool]:
    return BatchGroupModel.batch_id.in_(batches)


def _that_wait(session: Session, *where: ColumnElement[bool]) -> list[int]:
    """Ids of the batches with somebody to tell in which one of some groups waits."""
    told = (
        select(BatchModel.id)
        .join(WebhookModel, WebhookModel.dataset_id == BatchModel.dataset_id)
        .where(WebhookModel.off.is_(None))
    )
    waits = (BatchGroupModel.settled.is_(None), _of(told))
    return list(session.scalars(select(BatchGroupModel.batch_id).where(*where, *waits).distinct()))


def _tell_done(session: Session, batch_ids: Collection[int], *, actor: str, at: str) -> None:
    """Tell of those of some batches in which no group waits any more."""
    if not batch_ids:
        return
    waits = select(BatchGroupModel.batch_id).where(
        _of(batch_ids), BatchGroupModel.settled.is_(None)
    )
    for batch_id in sorted(set(batch_ids) - set(session.scalars(waits.distinct()))):
        announce_batch(session, batch_id, DONE, actor=actor, at=at)
